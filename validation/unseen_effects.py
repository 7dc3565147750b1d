"""``python -m granswim_pymunk.validation.unseen_effects [NAME ...] --out DIR``: full beds, only the swimmer filmed.

Four films of 0.8 s at some 500 frames a second with 20 micrometres of noise, each at a frequency and in a packing of
its own, of the paper's bed of some 2200 grains, simulated by the proof's own code; then ``granswim diagnose`` in
another process, which is given the four folders and nothing else. Strengths are chosen, not drawn.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

from granswim_pymunk.proof.bed_cases import shown
from granswim_pymunk.proof.beds import digits, draw_bed, packed
from granswim_pymunk.proof.fitting import with_adjusted
from granswim_pymunk.proof.packings import tracks
from granswim_pymunk.proof.suspects import camera_of, physics_of
from granswim_pymunk.recording import Recording, write_recording
from granswim_pymunk.validation.bed_effects import Row, adjustable, effects_of, run_rows, table, table_parser, tell

TITLE = "Known effects in full beds of which only the swimmer is seen"
ABOUT = (
    "Every line is four films of 0.8 s (500 frames a second, 20 µm), each at a frequency and in a packing of its own",
    "(some 2200 grains), simulated by the proof's code, not by the engine, and diagnosed together in another process",
    "from the tracks of the swimmer alone. Strengths are chosen. Errors: held-out recordings, rms of the disks over",
    "a cycle, µm.",
)
ROWS = (
    Row("actuator_saturation", {"limit": 0.6}, number=("limit", 0.6)),
    Row("weak_joint", {"joint": 4, "factor": 0.5}, number=("factor", 0.5)),
    Row("coulomb_substrate", {"mu": 0.6}, number=("mu", 0.6)),
    Row("quadratic_drag", {"c": 2e-3, "p": 0}, number=("c", 2e-3)),
    Row("stiffness off", {}, "recalibrate", moved=(("bending.stiffness", 0.8),)),
    Row("nothing", {}, "no_mismatch"),
    Row("camera_scale", {"s": 0.01}, "measurement", ("camera_scale",)),
)


def make(row: Row, number: int, folder: Path) -> list[Path]:
    """The four recordings of a row, written where they are not there. Raises SimulationError where a run fails."""
    seed = 9000 + number
    rng = np.random.default_rng(seed)
    for k in range(1000):
        setup = draw_bed(np.random.default_rng((seed, k)), "unseen", False)
        if not setup.scene.laws_named("confinement"):
            break
    setup = adjustable(setup, [("bending", "stiffness")])
    stiffness = float(setup.scene.parameter("bending.stiffness"))
    effects = effects_of(row, setup)
    off = 0.0 if row.moved else float(rng.choice([-1.0, 1.0]) * rng.uniform(0.02, 0.06))
    belief = with_adjusted(setup.scene, {"bending.stiffness": digits(stiffness * (1 + off))})
    true = with_adjusted(setup.scene, {name: f * float(setup.scene.parameter(name)) for name, f in row.moved})
    written = []
    for d in range(len(setup.drives)):
        target = folder / f"{number:02d}" / f"film-{d + 1}"
        written.append(target)
        if (target / "recording.toml").exists():
            continue
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
    args = table_parser(__doc__, 40.0).parse_args(argv)
    return tell(table(ROWS, run_rows(args, ROWS, make, say), TITLE, "unseen_effects", ABOUT), args.page, say)


if __name__ == "__main__":
    sys.exit(main())
