"""What every command shares: JSON of its figures, quiet, examples in the help, "did you mean".

Exit codes: 0 done; 1 it ran, and does not hold or could not go on; 2 wrong input, told in one line on stderr;
130 stopped by Ctrl-C, 143 by SIGTERM, what was written is kept.
"""

from __future__ import annotations

import argparse
import difflib
import json
import os
import re
import sys
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, redirect_stdout
from pathlib import Path
from typing import Any, NoReturn, TextIO

from .errors import InputError
from .files import written_whole

EXIT_CODES = (
    "exit codes: 0 done; 1 it ran, and does not hold or could not go on; 2 wrong input (one line on stderr); "
    "130 stopped by Ctrl-C, 143 by SIGTERM, what was written is kept"
)
WHERE = "where a command is not told --out, it writes to out/COMMAND-NAME (run: out/NAME)"
STDOUT = "-"


def default_out(command: str, source: str | Path) -> Path:
    """Where a command writes when it is not told: out/COMMAND-NAME, NAME being what it was given."""
    return Path("out") / f"{command}-{Path(source).resolve().stem}"


class Parser(argparse.ArgumentParser):
    """A parser that prints paragraphs and examples as they were written, and guesses what was meant."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        kwargs.setdefault("formatter_class", argparse.RawDescriptionHelpFormatter)
        kwargs.setdefault("allow_abbrev", True)
        super().__init__(*args, **kwargs)

    def error(self, message: str) -> NoReturn:
        """One line and exit code 2, with the nearest words that are known."""
        self.exit(2, f"{self.prog}: {message}{self.meant(message)} ({self.prog} --help)\n")

    def meant(self, message: str) -> str:
        """``; did you mean --length?`` for what a message says is not known."""
        unknown = re.match(r"unrecognized arguments: (\S+)", message)
        if unknown:
            return did_you_mean(unknown[1].split("=")[0], self.known_options())
        choice = re.match(r"argument [^:]+: invalid choice: '?([^' ]+)'? \(choose from (.*)\)", message)
        if choice:
            return did_you_mean(choice[1], re.findall(r"[\w.-]+", choice[2]))
        return ""

    def known_options(self) -> list[str]:
        found = [option for action in self._actions for option in action.option_strings]
        for action in self._actions:
            if isinstance(action, argparse._SubParsersAction):
                for child in action.choices.values():
                    found += [option for inner in child._actions for option in inner.option_strings]
        return list(dict.fromkeys(found))


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """``; did you mean diagnose?``, or nothing where no known word is near."""
    near = difflib.get_close_matches(word, list(known), n=2, cutoff=0.6)
    return f"; did you mean {' or '.join(near)}?" if near else ""


def epilog(examples: Iterable[str]) -> str:
    """The end of a command's help: its examples."""
    lines = [f"  {example}" for example in examples]
    return "\n".join(["examples:", *lines]) if lines else ""


def add_common(parser: argparse.ArgumentParser) -> None:
    """``--quiet`` and ``--json`` where a command does not have its own."""
    known = {option for action in parser._actions for option in action.option_strings}
    group = parser.add_argument_group("output")
    if "--quiet" not in known:
        group.add_argument("-q", "--quiet", action="store_true", help="say only what went wrong, and no progress")
    if "--json" not in known:
        group.add_argument(
            "--json", nargs="?", const=STDOUT, metavar="FILE", help="the figures as JSON, into FILE or instead of text"
        )


@contextmanager
def routed(args: argparse.Namespace) -> Iterator[None]:
    """Text on stdout goes to stderr where stdout is for JSON, and nowhere when quiet; results go where they belong."""
    global _results
    before, _results = _results, sys.stdout
    try:
        with ExitStack() as stack:
            if getattr(args, "quiet", False):
                nowhere = stack.enter_context(open(os.devnull, "w", encoding="utf-8"))
                stack.enter_context(redirect_stdout(nowhere))
            elif getattr(args, "json", None) == STDOUT:
                stack.enter_context(redirect_stdout(sys.stderr))
            yield
    finally:
        _results = before


_results: TextIO | None = None  # stdout as it was when the command began


def put_figures(args: argparse.Namespace, data: Any) -> None:
    """Write the figures where ``--json`` says, if it was given. Raises InputError where that cannot be done."""
    target = getattr(args, "json", None)
    if target is None:
        return
    text = json.dumps(data, indent=1, default=_plain) + "\n"
    if target == STDOUT:
        (_results or sys.stdout).write(text)
        return
    try:
        with written_whole(target) as stream:
            stream.write(text.encode("utf-8"))
    except OSError as error:
        raise InputError(f"cannot write it: {error.strerror}", file=target) from None


def _plain(value: Any) -> Any:
    """Numbers of NumPy, paths and tuples as JSON knows them."""
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"{type(value).__name__} has no JSON form")

