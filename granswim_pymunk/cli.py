"""The console command ``granswim``."""

from __future__ import annotations

import _thread
import argparse
import importlib
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Sequence
from types import ModuleType
from typing import Any

# many small matrices: threads of the linear algebra library would only wait for each other
for _name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

from . import __version__  # noqa: E402
from .commands import COMMANDS  # noqa: E402
from .console import EXIT_CODES, STDOUT, WHERE, Parser, add_common, epilog, routed  # noqa: E402
from .errors import InputError, SimulationError, Terminated  # noqa: E402
from .files import try_file, try_folder  # noqa: E402


def command_module(name: str) -> ModuleType:
    """The module of a command."""
    return importlib.import_module(f".commands.{name.replace('import', 'import_')}", __package__)


def build_parser(only: str | None = None, options: bool = True) -> Parser:
    """The parser; with ``only`` of that command, without ``options`` just names and help: start-up stays short."""
    parser = Parser(
        prog="granswim",
        description="Grains and swimmers on pymunk: simulate, compare with a recording, "
        "find the physics that was left out.",
        epilog=f"granswim COMMAND --help has examples of each command; {WHERE}.\n\n{EXIT_CODES}",
    )
    parser.add_argument("--version", action="version", version=f"granswim_pymunk {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name in COMMANDS if only is None else (only,):
        module = command_module(name)
        examples = epilog(getattr(module, "EXAMPLES", ()))
        child = commands.add_parser(name, help=module.HELP, description=module.__doc__, epilog=examples)
        if options:
            module.add_arguments(child)
            add_common(child)
    return parser


LATER = 0.05  # s, in which a callback that swallowed an interruption has ended


def _terminate(number: int, frame: Any) -> None:
    raise Terminated


def _interrupt(number: signal.Signals) -> None:
    """Send a signal to the main thread, which it wakes up where the system can."""
    if hasattr(signal, "pthread_kill"):
        signal.pthread_kill(threading.main_thread().ident or 0, number)
    else:
        _thread.interrupt_main(number)


def _not_lost(otherwise: Callable[[Any], Any]) -> Callable[[Any], None]:
    """A ``sys.unraisablehook`` by which an interruption that came within a callback of Python's own is not lost.

    What is raised in one, as when an object of a weak dictionary dies, is printed and passed over: the work would go on
    as if nobody had stopped it. The signal is sent again.
    """

    def hook(unraisable: Any) -> None:
        kind = unraisable.exc_type
        if not isinstance(kind, type) or not issubclass(kind, KeyboardInterrupt):
            otherwise(unraisable)
            return
        number = signal.SIGTERM if issubclass(kind, Terminated) else signal.SIGINT
        threading.Timer(LATER, _interrupt, (number,)).start()

    return hook


def _prepare(module: ModuleType, args: argparse.Namespace) -> None:
    """Load what the command needs, and find out whether it can write where it is to. Raises InputError."""
    for name in getattr(module, "FOLDERS", ()):
        if getattr(args, name) is not None:
            try_folder(getattr(args, name))
    for name in ("json", *getattr(module, "FILES", ())):
        if getattr(args, name, None) not in (None, STDOUT):
            try_file(getattr(args, name))
    for name in getattr(module, "NEEDS", ()):
        importlib.import_module(f".{name}", __package__)


def in_one_line(
    message: Warning | str, category: type[Warning], filename: str, lineno: int, line: str | None = None
) -> str:
    """A warning as a user of the commands reads it: what is wrong, not where in the package it was seen."""
    return f"granswim: {message}\n"


def main(argv: Sequence[str] | None = None, ready: Callable[[], None] | None = None) -> int:
    """Run a command. Wrong input: one clear line on stderr and exit code 2; Ctrl-C: 130, SIGTERM: 143.

    ready : called when all is loaded and the work begins
    """
    argv = list(sys.argv[1:] if argv is None else argv)
    empty = next((text for text in argv if text.startswith("--") and text.endswith("=--")), None)
    if empty is not None:  # argparse would make a list of it
        print(f"granswim {argv[0]}: {empty[:-3]}: needs a value, got '--'", file=sys.stderr)
        return 2
    only = argv[0] if argv and argv[0] in COMMANDS else None
    parser = build_parser(only, options=only is not None)
    if argv and argv[0].startswith("-") and argv[0] not in parser.known_options():
        # rather than that there is no command
        build_parser().error(f"unrecognized arguments: {argv[0]}")
    args = parser.parse_args(argv)
    module = command_module(args.command)
    shown, passed_over = warnings.formatwarning, sys.unraisablehook
    try:
        _prepare(module, args)
        if ready is not None:
            ready()
        # not before: modules of others take an exception in an import for a broken installation
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGTERM, _terminate)
        warnings.formatwarning = in_one_line
        sys.unraisablehook = _not_lost(passed_over)
        with routed(args):
            return int(module.main(args))
    except InputError as error:
        print(f"granswim {args.command}: {error}", file=sys.stderr)
        return 2
    except SimulationError as error:
        print(f"granswim {args.command}: the run stopped: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt as error:
        print(f"granswim {args.command}: interrupted{_kept(args)}", file=sys.stderr)
        return 128 + (signal.SIGTERM if isinstance(error, Terminated) else signal.SIGINT)
    except BrokenPipeError:
        return 1
    finally:
        warnings.formatwarning, sys.unraisablehook = shown, passed_over


def _kept(args: argparse.Namespace) -> str:
    """What is said of a folder in which something was written."""
    out = getattr(args, "out", None)
    if out is None:
        return ""
    try:
        with os.scandir(out) as entries:
            written = any(entries)
    except OSError:  # not there yet, or a file
        written = os.path.isfile(out)
    return f"; what was written is kept in {out}" if written else ""


def at_the_end(code: int) -> int:
    """``code``; after an interruption a second signal ends the process at once.

    As an exception it would break off the wait for threads that are in a step, whose Space is then taken apart under
    them, and Chipmunk aborts.
    """
    if code in (128 + signal.SIGINT, 128 + signal.SIGTERM):
        for number in (signal.SIGINT, signal.SIGTERM):
            if signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, signal.SIG_DFL)
    return code


if __name__ == "__main__":
    sys.exit(at_the_end(main()))
