"""``python -m granswim_pymunk.validation.unseen_effects [NAME ...] --out DIR``: full beds, only the swimmer filmed.

Four films of 0.8 s at some 500 frames a second with 20 micrometres of noise, each at a frequency and in a packing of
its own, of the paper's bed of some 2200 grains, simulated by the proof's own code; then ``granswim diagnose`` in
another process, which is given the four folders and nothing else. Strengths are those of ``bed_effects``, chosen, not
drawn. All rows are the same swimmer in beds of the same numbers, believed alike, so that their diagnoses share the
runs of the naive scene and of the candidates through the cache: one row alone takes its full time. ``--film 2``: of
each row the second film alone. ``--small``: the same effects in small beds of softer grains, which take a minute.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from granswim_pymunk.proof.bed_cases import shown
from granswim_pymunk.proof.beds import BedSetup, digits, draw_bed, packed
from granswim_pymunk.proof.candidates import camera_of, physics_of
from granswim_pymunk.proof.fitting import with_adjusted
from granswim_pymunk.proof.packings import tracks
from granswim_pymunk.recording import Recording, write_recording
from granswim_pymunk.validation import bed_effects
from granswim_pymunk.validation.bed_effects import Row, adjustable, effects_of, run_table, table_parser

TITLE = "Known effects in full beds of which only the swimmer is seen"
ABOUT = (
    "Every line is four films of 0.8 s (500 frames a second, 20 µm), each at a frequency and in a packing of its own",
    "(some 2200 grains), simulated by the proof's code, not by the engine, and diagnosed together in another process",
    "from the tracks of the swimmer alone. The bending stiffness is believed 4 % too high. Strengths are those of",
    "[bed_effects.md](bed_effects.md), chosen, not drawn. Errors: held-out data, rms of the disks over a cycle, µm.",
    "Lines find the runs of the naive scene and of the candidates that earlier ones left in the cache; a line made",
    "again by later code finds its own, too, and is said with the longer time. Several diagnoses shared two cores.",
)
# beds in which nothing is missing, packed anew; in every third the stiffness is off by a fifth
NULLS = tuple(
    Row(f"stiffness off, packing {k}", {}, "recalibrate", moved=(("bending.stiffness", 1.2),)) if k % 3 == 0
    else Row(f"nothing, packing {k}", {}, "no_mismatch")
    for k in range(2, 13)
)  # fmt: skip
ROWS = (*(row for row in bed_effects.ROWS if not (row.confined or row.masked)), *NULLS)
SEED = 9000  # of the swimmer and the numbers of its bed
BELIEVED = 1.04  # of the true bending stiffness


def bed_of(small: bool = False, number: int = 0) -> BedSetup:
    """The swimmer and its bed, without layers, k_B adjustable; ``small``: some 220 softer grains and two films.

    ``number``: 0 for the bed of the table, others have numbers of their own.
    """
    for k in range(1000):
        setup = draw_bed(np.random.default_rng((SEED + 1000 * number, k)), "unseen", small)
        if not setup.scene.laws_named("confinement"):
            break
    return adjustable(setup, [("bending", "stiffness")])


def make(
    row: Row, number: int, folder: Path, small: bool = False, only: int | None = None, bed: int = 0
) -> list[Path]:
    """The recordings of a row, or film ``only`` of it, written where not there. Raises SimulationError.

    ``bed``: which one, see ``bed_of``.
    """
    seed = SEED + 1 + number
    setup = bed_of(small, bed)
    if row.known:
        setup = replace(setup, scene=replace(setup.scene, adjustable=()))
    stiffness = float(setup.scene.parameter("bending.stiffness"))
    off = 1.0 if row.known else BELIEVED
    belief = with_adjusted(setup.scene, {"bending.stiffness": digits(stiffness * off)})
    true = with_adjusted(setup.scene, {name: f * float(setup.scene.parameter(name)) for name, f in row.moved})
    written = []
    for d in range(len(setup.drives)) if only is None else (only - 1,):
        target = folder / f"{number:02d}" / f"film-{d + 1}"
        written.append(target)
        if (target / "recording.toml").exists():
            continue
        effects = effects_of(row, replace(setup, scene=setup.driven(setup.scene, d)))
        scene = packed(setup.driven(true, d), 10 * seed + d)
        xy = tracks(setup, scene, physics_of(effects), setup.t, setup.dt, camera_of(effects).time_offset)
        film = shown(setup, xy, effects, np.random.default_rng((seed, d)))
        write_recording(
            Recording(
                f"film-{d + 1}", setup.driven(belief, d), setup.t, setup.swimmer, film, title="swimmer in a bed",
                sampling=float(f"{1 / np.median(np.diff(setup.t)):.6g}"), position_noise=setup.noise,
            ),
            target,
        )  # fmt: skip
    return written


def main(argv: list[str] | None = None, say: Callable[[str], None] = print) -> int:
    parser = table_parser(__doc__, 15.0)
    parser.add_argument("--film", type=int, metavar="K", help="of each row film K alone; results go to OUT/film-K")
    parser.add_argument("--small", action="store_true", help="small beds of softer grains, two films of 0.5 s a row")
    args = parser.parse_args(argv)
    films = Path(args.out) / "recordings"
    if args.film is not None:
        args.out = Path(args.out) / f"film-{args.film}"

    def wanted(row: Row, number: int, folder: Path) -> list[Path]:
        return make(row, number, films, args.small, args.film)

    seen = "four films" if args.film is None else f"film {args.film} of four"
    about = (ABOUT[0].replace("four films", seen), *ABOUT[1:])
    return run_table(args, ROWS, wanted, TITLE, "unseen_effects", about, say)


if __name__ == "__main__":
    sys.exit(main())
