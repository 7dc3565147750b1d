"""``granswim track MOVIE --radius 1.5mm --scale 0.1mm/px --out DIR``: from a film of round bodies to a recording.

Finds and follows the bodies (with trackpy: pip install 'granswim_pymunk[track]'), and writes the recording, the film
beside it and found.png, frames of the film with what was found in them: look at it before anything else.
"""

import argparse

HELP = "make a recording of a film of round bodies"
FOLDERS = ("out",)
EXAMPLES = (
    "granswim track pucks.mp4 --radius 4mm --scale 0.25mm/px --mass 5g --scene puck --out pucks",
    "granswim track drop.mov --radius 2cm --scale 1m=870px --mass 50g --scene drop --out drop",
    "granswim track swimmer.avi --radius 1.5mm --scale linked --radius-px 11 --scene swimmer --out swimmer",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    from ..recording.importers import TEMPLATES

    parser.add_argument("movie", metavar="MOVIE", help="a film (mp4, mov, avi ...), a GIF, or a folder of pictures")
    parser.add_argument("--out", metavar="DIR", help="folder of the recording (default: out/track-NAME)")
    parser.add_argument("--radius", required=True, metavar="R", help="of the bodies, as 1.5mm")
    parser.add_argument(
        "--scale", required=True, metavar="S",
        help="0.1mm/px, a known length in the picture (50mm=640px), or linked: neighbours touch",
    )  # fmt: skip
    parser.add_argument(
        "--radius-px", type=float, metavar="PX", help="of the bodies in the picture (for --scale linked)"
    )
    parser.add_argument("--mass", metavar="M", help="of a body, as 10g (default: that of a ball of water)")
    parser.add_argument("--fps", type=float, metavar="HZ", help="frame rate [Hz] (default: the film's)")
    shade = parser.add_mutually_exclusive_group()
    shade.add_argument("--dark", action="store_const", const=True, dest="dark", help="bodies are darker than the rest")
    shade.add_argument("--bright", action="store_const", const=False, dest="dark", help="brighter (default: found)")
    parser.add_argument("--count", type=int, metavar="N", help="how many bodies there are at most")
    parser.add_argument(
        "--search", type=float, metavar="PX", help="how far off its expected place a body may be (0.8 d)"
    )
    parser.add_argument("--minmass", type=float, metavar="B", help="least brightness of a body (default: found)")
    parser.add_argument(
        "--min-frames", type=int, metavar="N", help="drop shorter tracks (default: a tenth of the film)"
    )
    names = ", ".join(t.name for t in TEMPLATES.values())
    parser.add_argument("--scene", metavar="NAME|TOML", help=f"{names}, or a TOML with laws, gravity ...")
    parser.add_argument("--law", action="append", dest="laws", metavar="LAW", help="as for granswim import")
    parser.add_argument("--gravity", nargs="?", const="9.81", metavar="G", help="m/s^2 along -y (9.81), or gx,gy")
    parser.add_argument("--title")


def main(args: argparse.Namespace) -> int:
    from ..console import default_out, put_figures
    from ..recording.track_film import track

    names = ("radius_px", "mass", "fps", "dark", "count", "search", "minmass", "min_frames", "scene", "laws", "gravity",
             "title")  # fmt: skip
    given = {name: value for name in names if (value := getattr(args, name)) is not None}
    out = args.out or default_out("track", args.movie)
    done = track(args.movie, out, radius=args.radius, scale=args.scale, **given)
    put_figures(args, done.as_dict())
    print("\n".join(done.lines()))
    print(f"{done.folder}: recording.toml, film.mp4, found.png (what was found), tracks.png")
    return 0
