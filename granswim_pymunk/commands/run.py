"""``granswim run SCENE``: simulate a scene, and keep its trajectory, frames and a video.

SCENE is a TOML file or the name of a scene that comes with the package (swim, two_disks, pendulum ...).
Ctrl-C stops between blocks of steps; what was written is kept and can be read, and ``granswim run --resume DIR``
goes on from the last checkpoint. A folder that holds a run is not written to without --overwrite.
"""

import argparse
from pathlib import Path

from ..choices import COLORS, MODES, VIDEOS
from ..console import put_figures

EXAMPLES = (
    "granswim run pocket_swim",
    "granswim run two_disks --duration 2 --video mp4 --out out/disks",
    "granswim run --resume out/swim",
)
HELP = "simulate a scene: trajectory, frames, video"
NEEDS = ("run",)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", nargs="?", help="a TOML file, or the name of a scene that comes with the package")
    parser.add_argument("--resume", metavar="DIR", help="go on with the run in this folder, from its last checkpoint")
    parser.add_argument("--out", metavar="DIR", help="where to write (default: out/NAME)")
    parser.add_argument("--duration", type=float, metavar="S", help="how long to run [s] (default: as the scene says)")
    parser.add_argument("--dt", type=float, metavar="S", help="time step [s] (default: one that resolves the laws)")
    parser.add_argument("--mode", choices=MODES, default="verlet", help="how forces enter (default: verlet)")
    count = parser.add_mutually_exclusive_group()
    count.add_argument("--frames", type=int, metavar="N", help="number of pictures, 0 for none (default: 60)")
    count.add_argument("--fps", type=float, metavar="F", help="pictures per simulated second, instead of --frames")
    parser.add_argument("--color", choices=COLORS, help="what colours the grains (default: speed)")
    parser.add_argument("--video", choices=VIDEOS, help="of the frames, 25 a second (default: gif)")
    parser.add_argument("--seed", type=int, help="how the bed is packed (default: as the scene says)")
    parser.add_argument(
        "--max-overlap", type=float, metavar="P",
        help="stop when two bodies overlap by more than P %% of the smaller radius (default: 2 in a scene with grains)",
    )  # fmt: skip
    parser.add_argument(
        "--softened", type=float, metavar="F", help="contacts F times softer and steps longer, for screening runs"
    )
    parser.add_argument("--overwrite", action="store_true", help="replace the run that lies in --out")
    parser.add_argument("--no-cache", action="store_true", help="pack the bed anew, and do not keep it")


def main(args: argparse.Namespace) -> int:
    from ..errors import InputError
    from ..run import find_scene, resume_run, run_scene

    if args.resume:
        if args.scene:
            raise InputError("a run goes on with its own scene: leave out SCENE", where="--resume")
        put_figures(args, resume_run(args.resume, quiet=args.quiet).diagnostics)
        return 0
    if args.max_overlap is not None and not args.max_overlap > 0:
        raise InputError(f"should be above zero, got {args.max_overlap}", where="--max-overlap")
    if not args.scene:
        raise InputError("give a scene, or a folder with --resume")
    scene = find_scene(args.scene)
    result = run_scene(
        scene,
        args.out or Path("out") / scene.stem,
        duration=args.duration,
        dt=args.dt,
        mode=args.mode,
        frames=args.frames,
        fps=args.fps,
        color=args.color,
        video=args.video,
        seed=args.seed,
        cache=not args.no_cache,
        max_overlap=None if args.max_overlap is None else args.max_overlap / 100,
        soft=args.softened,
        overwrite=args.overwrite,
        quiet=args.quiet,
    )
    put_figures(args, result.diagnostics)
    return 0
