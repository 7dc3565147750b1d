"""The subcommands of ``granswim``, one file each.

A command module has ``HELP`` (one line), ``add_arguments(parser)`` and ``main(args) -> int``; what it
does is a plain function elsewhere in the package that a script can call. It imports nothing heavy before
``main``. It may have

``NEEDS`` : modules of the package that ``main`` imports, loaded before the command can be interrupted halfway
``FOLDERS``, ``FILES`` : names of arguments that say where it writes; they are tried before any work is done
"""

COMMANDS = (
    "run", "sweep", "diagnose", "conceal", "prove", "import", "track", "export", "validate", "crosscheck", "benchmark",
    "laws", "cache", "paper", "completion",
)  # fmt: skip
