"""``granswim export RUN --to FORMAT``: a run or a recording for another program.

RUN is the folder of a run, its trajectory.h5, or a recording. Everything in SI, but for H5MD, whose lengths are in nm.
"""

import argparse

HELP = "write a run or a recording for OVITO, MDAnalysis, ASE, ParaView or pandas"
FILES = ("out",)
EXAMPLES = (
    "granswim export out/swim --to gsd",
    "granswim export out/swim --to vtk --every 5 --out swim.pvd",
    "granswim export pendulum --to csv",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    from ..export import EXPORTERS

    parser.add_argument("run", metavar="RUN", help="folder of a run, trajectory.h5, or a recording")
    listed = "; ".join(f"{e.name}: {e.help}" for e in EXPORTERS.values())
    parser.add_argument("--to", required=True, choices=tuple(EXPORTERS), metavar="FORMAT", help=listed)
    parser.add_argument("--out", metavar="FILE", help="default: out/export-NAME with the format's ending")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="one frame in N (default: 1)")


def main(args: argparse.Namespace) -> int:
    from pathlib import Path

    from ..console import default_out, put_figures
    from ..errors import InputError
    from ..export import EXPORTERS, export, open_frames

    frames = open_frames(args.run, args.every)
    out = args.out
    if out is None:
        out = f"{default_out('export', frames.name)}{EXPORTERS[args.to].suffix}"
        try:
            Path(out).parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"cannot be written to: {error.strerror}", file=Path(out).parent) from None
    path = export(frames, args.to, out)
    put_figures(args, {"file": path})
    print(path)
    return 0
