"""``granswim conceal``: draw a case with a concealed effect (or none) and seal the truth.

Writes DIR/KIND-SEED/ (a recording, or a folder for each of several films), DIR/KIND-SEED.sha256 (the hash that binds
the truth) and, in another folder, the truth with its salt. Drawing needs the secret besides the seed.
Kinds: bodies without a bed; bed, a swimmer and its grains filmed; unseen, films of the swimmer alone; curve, its
speeds; small-bed, small-unseen, small-curve the same with 200 to 300 grains.
--real-life draws, beside the effect, what laboratories add: coloured noise, outliers, masses that are off, and so on.
"""

import argparse
from pathlib import Path

HELP = "draw a recording with a concealed effect, and seal the truth"
NEEDS = ("proof.conceal",)
FOLDERS = ("out", "sealed")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--seed", type=int, required=True, metavar="S")
    parser.add_argument(
        "--out", type=Path, default=Path("out/conceal"), metavar="DIR",
        help="folder for the recording and its hash (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument("--sealed", type=Path, metavar="DIR", help="folder for the truth (default: DIR-sealed)")
    parser.add_argument(
        "--secret", type=Path, metavar="FILE", help="what drawing needs besides the seed (default: yours)"
    )
    parser.add_argument("--kind", default="bodies", help="sort of recording, as above (default: bodies)")
    parser.add_argument("--real-life", action="store_true", help="draw what laboratories add, beside the effect")
    parser.add_argument("--effect", metavar="NAME", help="a mechanism, or null, outside, pair, decoy_camera, ...")


def main(args: argparse.Namespace) -> int:
    from ..errors import InputError
    from ..proof.beds import SUSPECTS
    from ..proof.candidates import STRENGTH
    from ..proof.cases import CATEGORIES
    from ..proof.conceal import conceal, real_kind
    from ..proof.seal import read_secret

    if args.seed < 0:
        raise InputError(f"should be zero or more, got {args.seed}", where="--seed")
    known = (*CATEGORIES, "none", *STRENGTH, "restitution", "actuator_saturation", *SUSPECTS)
    if args.effect is not None and args.effect not in known:
        raise InputError(f"unknown effect {args.effect!r}; known: {', '.join(dict.fromkeys(known))}", where="--effect")
    sealed = args.sealed or args.out.with_name(f"{args.out.name}-sealed")
    kind = real_kind(args.kind) if args.real_life else args.kind
    folder = conceal(args.seed, args.out, read_secret(args.secret), sealed, kind=kind, effect=args.effect)
    print(f"recording: {folder}")
    print(f"hash: {folder}.sha256")
    print(f"sealed: {sealed / (folder.name + '.json')}")
    return 0
