"""Every command in README and tutorials runs, in the order of its page; long ones with what makes them short."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from test_docs import PLACEHOLDERS, ROOT, blocks, run

from granswim_pymunk.cli import main
from granswim_pymunk.inference.mechanisms import not_told_apart
from granswim_pymunk.recording import shipped_names
from granswim_pymunk.report.words import spoken

# those of the first are run in test_track.py
PAGES = ("docs/tutorial_video.md", "README.md", "docs/index.md", "docs/import_tracks.md", "docs/export.md")
SHORT = {"diagnose": ("--minutes", "0.05"), "run": ("--duration", "0.004", "--frames", "2", "--video", "none")}
# where the quick option would leave nothing to say
WHOLE = ("run two_disks",)


def commands(page):
    """Lines that begin with granswim, without where it is installed."""
    for block in blocks(page, "sh", "bash"):
        for line in block.replace("\\\n", " ").splitlines():
            line = line.partition("#")[0].strip().removeprefix(".venv/bin/")
            if line.startswith("granswim ") and not PLACEHOLDERS.search(line):
                yield line


def new_commands(name):
    """Those that no page before has, and what they begin with: the same words do the same on every page."""
    known = {line for before in PAGES[: PAGES.index(name)] for line in commands(ROOT / before)}
    kept, needed = [], []
    for line in reversed(list(commands(ROOT / name))):
        words = shlex.split(line)
        out = words[words.index("--out") + 1] if "--out" in words else None
        if line not in known or any(word.startswith(str(out)) for word in needed):
            kept.insert(0, line)
            needed += [word for word in words if word != out]
    return kept


def swing(folder):
    """What the pages call swing.csv: frame, x, y in cm, y from the top of a picture 60 cm high."""
    t = np.arange(150) / 60
    angle = 0.5 * np.exp(-0.1 * t) * np.cos(6.0 * t)
    x, y = 30 + 27 * np.sin(angle), 20 + 27 * np.cos(angle)
    rows = [f"{k},{a:.3f},{b:.3f}" for k, (a, b) in enumerate(zip(x, y, strict=True))]
    (folder / "swing.csv").write_text("frame,x (cm),y (cm)\n" + "\n".join(rows) + "\n")


def test_every_page_has_commands():
    assert all(list(commands(ROOT / name)) for name in PAGES)


@pytest.mark.parametrize("name", [name for name in PAGES[1:] if new_commands(name)])
def test_the_commands_of_a_page_run_one_after_the_other(name, tmp_path, monkeypatch, capsys):
    said = new_commands(name)
    monkeypatch.chdir(tmp_path)
    swing(tmp_path)
    if any("--to gsd" in line for line in said):
        pytest.importorskip("gsd")
    for line in said:
        words = shlex.split(line)[1:]
        short = () if " ".join(words[:2]) in WHOLE else SHORT.get(words[0], ())
        assert main([*words, *short]) == 0, (line, capsys.readouterr().err)
        if "--out" in words:
            out = Path(words[words.index("--out") + 1])
            assert any(out.iterdir()), line
            # the second time is as good as the first: a folder is said to be taken, or made anew
            capsys.readouterr()


def test_the_python_of_the_readme_runs(tmp_path):
    for code in blocks(ROOT / "README.md", "python"):
        run(code, tmp_path)


def test_what_the_readme_says_is_shipped_is():
    table = re.findall(r"^\| `(\w+)` \|", (ROOT / "README.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert set(table) <= set(shipped_names()) and len(table) >= 3


def test_the_readme_prints_what_the_verdict_of_the_pictures_says():
    """The words of the README's block are those of the result's own lines."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (printed,) = re.findall(r"```\n(verdict: .*?)```", text, re.DOTALL)
    for word in ("explains", "held-out data:", "these data cannot tell it from", "training [rad rms]:", "noise floor"):
        assert word in printed


def test_laws_not_told_apart_are_those_of_what_was_withdrawn_where_nothing_is_named():
    """ "Cannot tell it" stood there without an it."""
    rivals = [
        {"name": "linear_drag", "indistinguishable": False, "withdrawn": True},
        {"name": "uniform_force", "indistinguishable": True}, {"name": "spring", "indistinguishable": False},
    ]  # fmt: skip
    named = not_told_apart({"mechanisms": [{}], "rivals": rivals[1:]})
    assert named == "these data cannot tell it from uniform_force"
    gone = not_told_apart({"mechanisms": [], "rivals": rivals}, spoken)
    assert gone == "the data that were learnt from could not tell linear drag from a uniform force"
    assert not_told_apart({"mechanisms": [], "rivals": rivals[:1]}) == ""
