"""``granswim import SOURCE --format FORMAT --out DIR``: bring a foreign file into the form of a recording.

One recording becomes the folder DIR, several become folders in it. Everything in it is in SI, y points up.
"""

import argparse

from ..recording.importers import FORMATS, import_to

HELP = "bring a tracker's output or a plain table into the form of a recording"

OPTIONS = (
    "bodies", "scene", "columns", "unit", "time_unit", "fps", "angle_unit", "flip_y", "missing", "delimiter",
    "title", "sampling", "position_noise", "angle_noise", "bowling_ball",
)  # fmt: skip


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("source", metavar="SOURCE", help="file to import (named formats: or its folder)")
    parser.add_argument("--out", required=True, metavar="DIR", help="folder of the recording")
    parser.add_argument(
        "--format",
        required=True,
        choices=tuple(FORMATS),
        help="; ".join(f"{f.name}: {f.help}" for f in FORMATS.values()),
    )
    parser.add_argument(
        "--body",
        action="append",
        dest="bodies",
        metavar="ID:RADIUS:MASS[:ROLE]",
        help="a body, in m and kg; once for each",
    )
    parser.add_argument("--scene", metavar="TOML", help="bodies, laws, gravity ... as in recording.toml")
    parser.add_argument("--columns", metavar="MAP", help="t=time,x=cx,... (long), t=time,1.x=left,... (wide)")
    parser.add_argument("--unit", help="of positions: m, cm, mm, um, in, ft or metres per unit (a pixel)")
    parser.add_argument("--time-unit", help="s, ms, us, min or seconds per unit")
    parser.add_argument("--fps", type=float, help="frame rate [Hz]; the time column then counts frames")
    parser.add_argument("--angle-unit", help="rad, deg, rev or rad per unit")
    parser.add_argument(
        "--flip-y",
        nargs="?",
        type=float,
        const=0.0,
        metavar="HEIGHT",
        help="y points down: y = HEIGHT - y (default 0)",
    )
    parser.add_argument(
        "--missing", action="append", metavar="VALUE", help="what means not seen, besides nothing and NaN"
    )
    parser.add_argument("--delimiter", help="between columns (default: a comma)")
    parser.add_argument("--title")
    parser.add_argument("--sampling", type=float, help="nominal frame rate [Hz] (default: from the times)")
    parser.add_argument("--position-noise", type=float, help="one standard deviation [m]")
    parser.add_argument("--angle-noise", type=float, help="one standard deviation [rad]")
    parser.add_argument("--bowling-ball", type=int, metavar="OZ", help="falling_balls: 81 or 208 (default) ounces")


def main(args: argparse.Namespace) -> int:
    given = {name: value for name in OPTIONS if (value := getattr(args, name)) is not None}
    for folder in import_to(args.source, args.out, args.format, **given):
        print(folder)
    return 0
