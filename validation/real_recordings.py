"""``python -m granswim_pymunk.validation.real_recordings [NAME ...] [--page FILE] [--minutes M] [--out DIR]``.

Diagnoses the real recordings that come with the package and writes the page of them: the picture, the verdict, how much
it explains, what remains, and what somebody who knows the apparatus would add. A diagnosis that lies in DIR already is
read and not made again. Beside the double pendulum stands what each friction leaves of its errors in short windows.
"""

from __future__ import annotations

import argparse
import shutil
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from granswim_pymunk.files import written_whole
from granswim_pymunk.inference import diagnose
from granswim_pymunk.inference.entry import ProgressLine
from granswim_pymunk.recording.importers import import_double_pendulum
from granswim_pymunk.result import load_verdict

from . import swings

MOST_NUMBERS = 5  # of a law that are shown: a form without a name has twenty
HEAD = """# Real recordings

The recordings of real apparatus that come with the package, each diagnosed with the defaults by
`python -m granswim_pymunk.validation.real_recordings`. The naive scenes hold what the sources say of their apparatus
and no friction, drag or error of the camera. Sources and licences stand beside the recordings in
`granswim_pymunk/recordings`.
"""


@dataclass(frozen=True)
class Shown:
    """A shipped recording: title of its section, what it is, and what somebody who knows such apparatus would add."""

    title: str
    what: str
    expert: str


SHOWN: Mapping[str, Shown] = {
    "pendulum": Shown(
        "An arm that swings freely",
        "55 s of a single arm on an axle with an encoder, released near 90 degrees.",
        "A bearing has a dry and a viscous part, and air drag on a bar grows with the square of its speed: three "
        "terms, of which two are found here. They differ most where the swing is small, at the end of the record, "
        "where dry friction stops the arm in finite time. The length is fitted with them, since the source's own "
        "was fitted and not measured. A release from a small angle would part the terms.",
    ),
    "string_pendulum": Shown(
        "A bob on a string",
        "17 s of a cup with coins on a string of 65 cm, let go at 83 degrees and read off the film of a phone.",
        "The swing loses a third of its angle in ten swings, and less the smaller it is: the drag of the air on a cup, "
        "with the square of the speed. A fit by hand adds a tenth in proportion to the speed, and finds a string of "
        "67 cm where 65 +/- 1 were measured. In the first 0.3 s a hand still draws the bob aside, and the angle is "
        "read off pixels of a camera that may look at the swing from aside.",
    ),
    "double_pendulum": Shown(
        "Two arms, one hung from the other",
        "6 s of a double pendulum with encoders at both axles.",
        "Its source fitted viscous torques, 2.4e-4 N m s at the pivot and 1e-5 N m s, a bound of that search, at "
        "the joint. In 6 s of a chaotic motion the masses, lengths and inertias of the source matter as much as "
        "friction does; they are given to three or four digits.",
    ),
    "falling_balls": Shown(
        "Balls dropped from a bridge",
        "Ten kinds of balls, two drops each, at 15 frames a second over about 35 m; of each kind the second drop "
        "is held out.",
        "Physics says a drag in proportion to the square of the speed at these Reynolds numbers (1e4 to 1e6), "
        "with a coefficient that falls at the drag crisis for the smoother balls, and wind. The scale of the "
        "camera and the moment of release are known to some per cent only; for dense balls a wrong scale does as "
        "well as any drag, so nothing should be claimed for them.",
    ),
    "two_disk_spin": Shown(
        "Two spinning disks that collide",
        "One collision on a table, filmed with a marker on each rim and a rough calibration.",
        "The disks' apparent radius grows by a fifth along the way: the camera looks at an angle, which a single "
        "scale cannot describe. Only what happens in the collision can be trusted: the disks' spins and "
        "velocities just before and after it, which tell restitution and friction of the rims.",
    ),
}


def section(name: str, verdict: Mapping[str, Any], said: str, picture: str) -> str:
    """Markdown of one recording; ``said``: the summary of its verdict."""
    shown = SHOWN[name]
    return "\n".join([
        f"## {shown.title}", "", f"`granswim diagnose {name}`: {shown.what}", "",
        f"![{shown.title}: recorded and simulated]({picture})", "",
        "```", said, "```", "", f"What an expert would add: {shown.expert}", "",
    ])  # fmt: skip


def told(verdict: Mapping[str, Any], summary: str) -> str:
    """The part of the summary that belongs here: not every candidate and note."""
    kept, keep, numbers = [], False, 0
    for line in summary.splitlines():
        if line.startswith("[["):
            keep = line[2:-2].split(" in ")[0] in ("Verdict", "Laws", "Explained", "Recalibrated", "Errors", "Rivals")
        numbers = numbers + 1 if line.startswith(8 * " ") else 0
        if keep and numbers <= MOST_NUMBERS:
            kept.append(line if numbers < MOST_NUMBERS else 8 * " " + "...")
    return "\n".join(kept)


def in_windows(out: Path) -> str:
    """How each friction follows the two arms in windows of the last 40 % of 48 s, as Markdown; kept in ``out``."""
    kept = out / "windows.md"
    if not kept.exists():
        rows = swings.compared(import_double_pendulum(swings.shipped()), swings.LAWS, lambda text: None)
        with written_whole(kept) as stream:
            stream.write((swings.table(rows) + "\n").encode())
    return "\n".join([
        "Each friction fitted to the first 60 % of 48 s of the same swing, and the last 40 % followed in windows whose "
        "starts are fitted on their first third: what is left of the error without friction, by "
        "`python -m granswim_pymunk.validation.swings`.", "", kept.read_text(encoding="utf-8"),
    ])  # fmt: skip


def main(argv: Sequence[str] | None = None) -> int:
    how = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(prog="real_recordings", description=__doc__, formatter_class=how)
    parser.add_argument("names", nargs="*", default=list(SHOWN), metavar="NAME", help=", ".join(SHOWN))
    parser.add_argument("--page", type=Path, metavar="FILE", help="the page; its pictures go to pictures/ beside it")
    parser.add_argument("--minutes", type=float, metavar="M", help="time budget of each")
    parser.add_argument("--out", type=Path, default=Path("out/real_recordings"), metavar="DIR")
    args = parser.parse_args(argv)
    unknown = [name for name in args.names if name not in SHOWN]
    if unknown:
        parser.error(f"no such recording: {unknown[0]}; there are {', '.join(SHOWN)}")
    parts = [HEAD.rstrip() + "\n"]
    for name in args.names:
        out = args.out / name
        if not (out / "verdict.json").exists():
            diagnose([name], out, minutes=args.minutes, progress=ProgressLine())
        result = load_verdict(out)
        picture = f"real_{name}.png"
        if args.page:
            folder = args.page.parent / "pictures"
            folder.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(out / "figures" / "overlay.png", folder / picture)
        parts.append(section(name, result.verdict, told(result.verdict, result.summary()), f"pictures/{picture}"))
        if name == "double_pendulum":
            parts.append(in_windows(out))
    text = "\n".join(parts)
    if args.page:
        args.page.write_text(text, encoding="utf-8")
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
