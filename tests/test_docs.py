"""What README and docs say can be done: commands parse, code runs, pages made of declarations are whole."""

import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from granswim_pymunk.cli import build_parser
from granswim_pymunk.commands import COMMANDS
from granswim_pymunk.proof.prove import FULL, FULL_REAL
from granswim_pymunk.recording.importers import FORMATS
from granswim_pymunk.recording.keys import KEYS, format_page

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.glob("*.md"))]
PLACEHOLDERS = re.compile(r"\b(RECORDING|SCENE|DIR|FILE|MOVIE|RUN|SOURCE|FORMAT|CLAIM|NAME|BED)\b|\.\.\.|\[")


def blocks(page, *languages):
    return re.findall(rf"```(?:{'|'.join(languages)})[^\n]*\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)


def commands():
    for page in PAGES:
        for block in blocks(page, "sh", "bash"):
            for line in block.replace("\\\n", " ").splitlines():
                line = line.partition("#")[0].strip().removeprefix(".venv/bin/")
                if line.startswith("granswim ") and not PLACEHOLDERS.search(line.replace("'.[", "")):
                    yield pytest.param(line, id=f"{page.stem}: {line[:60]}")


@pytest.mark.parametrize("line", list(commands()))
def test_a_command_in_the_docs_is_one_that_exists(line):
    words = shlex.split(line)[1:]
    assert words[0] in COMMANDS
    build_parser(words[0]).parse_args(words)


def test_there_are_commands_to_check():
    assert len(list(commands())) >= 30


def test_every_command_is_in_the_readme():
    readme = (ROOT / "README.md").read_text()
    for name in COMMANDS:
        assert f"`granswim {name}" in readme, name


def test_every_format_is_on_the_page_of_importing():
    page = (DOCS / "import_tracks.md").read_text()
    for name, chosen in FORMATS.items():
        assert chosen.importer is None or f"`{name}`" in page, name


def test_the_gallery_has_pictures_that_are_there():
    page = (DOCS / "gallery.md").read_text()
    pictures = re.findall(r"!\[([^\]]+)\]\(([^)]+)\)", page)
    assert len(pictures) >= 14 and all((DOCS / file).is_file() for _, file in pictures)


def test_the_page_on_the_format():
    page = format_page()
    for key in KEYS:
        assert f"| `{key.name}` | {key.unit} | {key.default} |" in page
    (example,) = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    assert tomllib.loads(example)["law"][0]["length"] == 0.25
    assert "`linear_drag`" in page and "flexible" not in page


def test_the_page_on_the_format_in_the_repository_is_that_of_the_site():
    """``python -m granswim_pymunk.recording.keys > docs/format.md`` writes it again where a key or law has changed."""
    made = subprocess.run([sys.executable, "-m", "granswim_pymunk.recording.keys"], cwd=ROOT, capture_output=True,
                          text=True, timeout=600)  # fmt: skip
    assert (DOCS / "format.md").read_text(encoding="utf-8") == made.stdout, made.stderr[-2000:]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_to_files_lead_to_files(page):
    links = re.findall(r"\]\(([^)#\s]+)", page.read_text(encoding="utf-8"))
    lost = [link for link in links if ":" not in link and not (page.parent / link).exists()]
    assert not lost


def test_examples_of_keys_are_toml():
    for key in KEYS:
        tomllib.loads(f"{key.name} = {key.example}")


def run(code, folder):
    done = subprocess.run([sys.executable, "-W", "error::DeprecationWarning", "-c", code], cwd=folder,
                          capture_output=True, text=True, timeout=600)  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


def test_the_tutorial_on_a_scene_of_your_own(tmp_path):
    said = run("\n".join(blocks(DOCS / "tutorial_scene.md", "python")), tmp_path)
    assert "30 free" in said and "the disks move at" in said
    assert (tmp_path / "box.png").read_bytes()[:4] == b"\x89PNG"
    assert (tmp_path / "out/box/video.gif").stat().st_size > 1000


def test_seeds_of_the_full_form_are_those_that_the_page_says():
    said = " ".join((DOCS / "proof.md").read_text(encoding="utf-8").split())
    for kind, seeds in (FULL | FULL_REAL).items():
        assert f"`{kind}` {seeds[0]} to {seeds[-1]}" in said, kind
