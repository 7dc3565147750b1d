"""``granswim cache``: what is kept between runs, and where; ``--clear`` removes it.

Kept are machine code, packed beds and the runs of diagnoses. All of it can be made again: removing it costs time only.
GRANSWIM_CACHE names another folder.
"""

import argparse

HELP = "show what is kept between runs, or remove it"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    from ..storage import KINDS

    parser.add_argument(
        "--clear", nargs="*", metavar="KIND", help=f"remove all of it, or some of {', '.join(KINDS)}"
    )


def main(args: argparse.Namespace) -> int:
    from ..errors import InputError
    from ..storage import KINDS, cache_folder, clear, what_is_kept

    for name in args.clear or ():
        if name not in KINDS:
            raise InputError(f"unknown kind {name!r}; known: {', '.join(KINDS)}", where="--clear")
    try:
        found = what_is_kept() if args.clear is None else clear(*args.clear)
    except OSError as error:
        raise InputError(f"cannot remove it: {error.strerror or error}", file=error.filename) from None
    print(f"{cache_folder()}{'' if args.clear is None else ', removed:'}")
    for kept in found:
        print(f"  {kept.name:<10} {kept.files:>7} files {kept.size / 1e6:>9.1f} MB  {kept.what}")
    if not found:
        print("  nothing")
    return 0
