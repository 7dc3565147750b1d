"""The subcommands of ``granswim``, one file each.

A command module has ``HELP`` (one line), ``add_arguments(parser)`` and ``main(args) -> int``; what it
does is a plain function elsewhere in the package that a script can call.
"""

COMMANDS = (
    "run", "sweep", "diagnose", "conceal", "prove", "import", "track", "export", "validate", "crosscheck", "benchmark",
    "laws", "cache", "paper", "completion",
)  # fmt: skip
