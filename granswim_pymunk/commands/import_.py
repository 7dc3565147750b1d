"""``granswim import SOURCE --out DIR``: bring a tracker's output or a trajectory into the form of a recording.

What the file is is found by looking into it. Everything in DIR is in SI, y points up; DIR/tracks.png shows the tracks,
and recording.toml has a remark at each key. One recording becomes the folder DIR, several become folders in it.
"""

import argparse

from ..console import default_out, put_figures

HELP = "bring a tracker's output, a table or a trajectory into the form of a recording"
FOLDERS = ("out",)
EXAMPLES = (
    "granswim import swing.csv --body bob:2cm:100g --scene pendulum --out swing",
    "granswim import linked.csv --unit 0.1mm/px --fps 60 --body '*:5mm:10g' --scene puck --out pucks",
    "granswim import messung.csv --unit cm --body ball:3cm:50g --gravity --out ball",
)

OPTIONS = (
    "bodies", "scene", "laws", "inputs", "hold", "gravity", "columns", "unit", "time_unit", "fps", "angle_unit",
    "flip_y", "missing", "delimiter", "decimal", "skip_rows", "encoding", "table", "likelihood", "min_frames", "title",
    "sampling", "position_noise", "angle_noise", "bowling_ball", "film", "adjustables",
)  # fmt: skip


def _yes_or_no(text: str) -> bool:
    if text.lower() in ("yes", "no"):
        return text.lower() == "yes"
    raise argparse.ArgumentTypeError(f"should be yes or no, got {text!r}")


def _flip(text: str) -> float | bool:
    if text.lower() in ("no", "false", "none"):
        return False
    if text.lower() in ("yes", "true"):
        return 0.0
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"should be a height or no, got {text!r}") from None


def add_arguments(parser: argparse.ArgumentParser) -> None:
    from ..recording.importers import FORMATS, TEMPLATES

    listed = "; ".join(f"{f.name}: {f.help}" for f in FORMATS.values())
    templates = ", ".join(f"{t.name} ({t.help})" for t in TEMPLATES.values())
    parser.add_argument("source", metavar="SOURCE", help="file to import (falling_balls ...: or its folder)")
    parser.add_argument("--out", metavar="DIR", help="folder of the recording (default: out/import-NAME)")
    parser.add_argument(
        "--format", choices=tuple(FORMATS), default="auto", metavar="FORMAT", help=f"{listed} (default: auto)"
    )
    scene = parser.add_argument_group("what was recorded")
    scene.add_argument(
        "--body", action="append", dest="bodies", metavar="ID:RADIUS:MASS[:ROLE]",
        help="a body, as bob:5mm:10g or in m and kg; * stands for all that are not named; once for each",
    )  # fmt: skip
    scene.add_argument(
        "--scene", metavar="NAME|TOML", help=f"{templates}; or a TOML with bodies, laws, walls ([[wall]]) ..."
    )
    scene.add_argument(
        "--law", action="append", dest="laws", metavar="LAW",
        help="a law that is believed, as 'pin:bob,anchor=0 0,length=0.25', 'rod:a,b,length=0.25' (granswim laws lists "
        "them); once for each",
    )  # fmt: skip
    scene.add_argument(
        "--adjustable", action="append", dest="adjustables", metavar="LAW.PARAMETER=LOW:HIGH",
        help="a number of a law that is not known well, as spring.stiffness=3:5: it is fitted before anything is "
        "called missing; once for each",
    )  # fmt: skip
    scene.add_argument(
        "--input", action="append", dest="inputs", metavar="[BODY=]FILE[:COLUMN]",
        help="commands a motor was given: a table t,name,value, or a time and a column for each driven body; the file "
        "of the tracks too, as cart=log.csv:command; once for each",
    )  # fmt: skip
    scene.add_argument(
        "--hold", type=_yes_or_no, metavar="yes|no",
        help="commands stay until the next row, or are linear between rows (default: as they look)",
    )  # fmt: skip
    scene.add_argument(
        "--gravity", nargs="?", const="9.81", metavar="G", help="m/s^2 along -y (default 9.81), or gx,gy"
    )
    scene.add_argument("--title")
    scene.add_argument("--sampling", type=float, metavar="HZ", help="nominal frame rate [Hz] (default: from the times)")
    scene.add_argument("--position-noise", type=float, metavar="M", help="one standard deviation [m]")
    scene.add_argument("--angle-noise", type=float, metavar="RAD", help="one standard deviation [rad]")
    scene.add_argument(
        "--film", metavar="MOVIE", help="what positions in pixels were read from: reports draw the simulation over it"
    )
    units = parser.add_argument_group("units and axes of the file")
    units.add_argument("--unit", help="of positions: mm, '0.5 mm', 0.1mm/px, or metres per unit")
    units.add_argument("--time-unit", metavar="UNIT", help="s, ms, us, min or seconds per unit (a time step)")
    units.add_argument(
        "--fps", type=float, metavar="HZ",
        help="frame rate [Hz]; the time column then counts frames, or, where it holds times and --columns leaves it "
        "out, is not used",
    )  # fmt: skip
    units.add_argument("--angle-unit", metavar="UNIT", help="rad, deg, rev or rad per unit")
    units.add_argument(
        "--flip-y", nargs="?", type=_flip, const=0.0, metavar="HEIGHT",
        help="y points down: y = HEIGHT - y (default 0, in the file's unit); no: leave y as it is",
    )  # fmt: skip
    file = parser.add_argument_group("how the file is read")
    file.add_argument(
        "--columns", metavar="MAP",
        help="t=time,x=cx,body=id (long), t=time,A.x=left,B.angle=right (wide), y=z (3-D); columns by name, in quotes "
        "where it holds a comma, or by number from 1",
    )  # fmt: skip
    file.add_argument(
        "--missing", action="append", metavar="VALUE", help="what means not seen, besides nothing and NaN"
    )
    file.add_argument("--delimiter", metavar="SIGN", help="between columns, also tab or space (default: found)")
    file.add_argument("--decimal", metavar="SIGN", help=". or , (default: found)")
    file.add_argument("--skip-rows", type=int, metavar="N", help="leave the first rows out")
    file.add_argument("--encoding", metavar="NAME", help="utf-8, utf-16, cp1252 ... (default: found)")
    file.add_argument("--table", metavar="NAME", help="sheet of a workbook, key or group of an HDF5 file")
    file.add_argument("--likelihood", type=float, metavar="P", help="pose trackers: less likely is not seen (0.6)")
    file.add_argument("--min-frames", type=int, metavar="N", help="leave out tracks seen in fewer frames")
    file.add_argument("--bowling-ball", type=int, metavar="OZ", help="falling_balls: 81 or 208 (default) ounces")


def main(args: argparse.Namespace) -> int:
    from ..recording.importers import import_all

    given = {name: value for name in OPTIONS if (value := getattr(args, name)) is not None}
    done = import_all(args.source, args.out or default_out("import", args.source), args.format, **given)
    put_figures(args, [item.as_dict() for item in done])
    for item in done[:3]:
        print("\n".join(item.lines()))
    if len(done) > 3:
        print(f"... and {len(done) - 3} more")
    for item in done:
        print(f"{item.folder}: recording.toml, tracks.png")
    return 0
