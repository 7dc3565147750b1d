"""Hooks of the site: pages that are made of the package itself, and links to files that are not part of the site."""

from __future__ import annotations

import io
import re
import sys
from contextlib import redirect_stdout
from pathlib import Path

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT))


def command_page() -> str:
    """The page on the command line, made of the help texts."""
    from granswim_pymunk.cli import build_parser
    from granswim_pymunk.commands import COMMANDS
    from granswim_pymunk.console import EXIT_CODES

    lines = ["# Command line", "", EXIT_CODES[0].upper() + EXIT_CODES[1:] + ".", ""]
    for name in COMMANDS:
        said = io.StringIO()
        with redirect_stdout(said):
            try:
                build_parser(name).parse_args([name, "--help"])
            except SystemExit:
                pass
        lines += [f"## granswim {name}", "", "```text", said.getvalue().rstrip(), "```", ""]
    return "\n".join(lines)


def on_files(files: Files, config: object) -> Files:
    from granswim_pymunk.recording.keys import format_page

    made = {
        "format.md": format_page(),
        "cli.md": command_page(),
        "changes.md": (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"),
    }
    for name, text in made.items():
        known = files.get_file_from_path(name)
        if known is not None:
            files.remove(known)
        files.append(File.generated(config, name, content=text))  # type: ignore[arg-type]
    return files


_AWAY = re.compile(r"\[([^\]]+)\]\((\.\./[^)]+)\)")


def on_page_markdown(markdown: str, **_: object) -> str:
    """A link to a file beside the docs becomes its name: it stands in the source, not on the site."""
    return _AWAY.sub(lambda m: f"{m[1]} (`{m[2].removeprefix('../')}` in the source)", markdown)
