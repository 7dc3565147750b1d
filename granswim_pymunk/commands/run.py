"""``granswim run SCENE``: simulate a scene, and keep its trajectory, frames and a video.

SCENE is a TOML file or the name of a scene that comes with the package (swim, two_disks, pendulum ...).
Ctrl-C stops between blocks of steps; what was written is kept and can be read.
"""

import argparse
from pathlib import Path

from ..engine import MODES
from ..render import COLORS
from ..run import VIDEOS, find_scene, run_scene

HELP = "simulate a scene: trajectory, frames, video"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", help="a TOML file, or the name of a scene that comes with the package")
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
    parser.add_argument("--no-cache", action="store_true", help="pack the bed anew, and do not keep it")


def main(args: argparse.Namespace) -> int:
    scene = find_scene(args.scene)
    run_scene(
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
    )
    return 0
