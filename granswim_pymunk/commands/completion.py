"""``granswim completion SHELL``: print a script that lets the shell complete commands and options.

bash: granswim completion bash > ~/.local/share/bash-completion/completions/granswim; zsh: the same into a folder of
$fpath, as _granswim.
"""

import argparse
import sys

HELP = "print a completion script for bash, zsh or tcsh"
EXAMPLES = ('eval "$(granswim completion bash)"', "granswim completion zsh > ~/.zfunc/_granswim")
SHELLS = ("bash", "zsh", "tcsh")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("shell", choices=SHELLS)


def main(args: argparse.Namespace) -> int:
    import shtab

    from ..cli import build_parser

    sys.stdout.write(shtab.complete(build_parser(), shell=args.shell))
    return 0
