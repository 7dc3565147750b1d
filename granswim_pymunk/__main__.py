"""``python -m granswim_pymunk`` is ``granswim``."""

import os
import signal
import sys


def leave(number: int, frame: object) -> None:
    """Ctrl-C or SIGTERM while modules are still being imported: nothing has been done yet."""
    os.write(2, b"granswim: interrupted\n")
    os._exit(128 + number)


if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # not where the shell has it ignored
    signal.signal(signal.SIGINT, leave)


def main() -> int:
    """The console command: as ``cli.main``, and quiet when it is interrupted while it starts."""
    if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
        signal.signal(signal.SIGTERM, leave)
    from .cli import at_the_end
    from .cli import main as command

    return at_the_end(command(ready=_ready))


def _ready() -> None:
    """From here on Ctrl-C is an exception, and what was written is kept."""
    if signal.getsignal(signal.SIGINT) is leave:
        signal.signal(signal.SIGINT, signal.default_int_handler)


if __name__ == "__main__":
    sys.exit(main())
