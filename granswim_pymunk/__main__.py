"""``python -m granswim_pymunk`` is ``granswim``."""

import sys

from .cli import main

if __name__ == "__main__":
    sys.exit(main())
