"""``python -m granswim_pymunk.benchmarks.cut_out [MINUTES]``: the neighbourhood of a swimmer against its whole bed.

The paper's bed with joint 4 at half its stiffness, filmed for 0.6 s at 500 frames a second with 20 micrometres of
noise. First its windows with cuts of several sizes: how far from the whole bed's predictions, how far from the film,
how much faster. The same for the time step. Then the diagnosis with the usual cut, and without one.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import granswim_pymunk
from granswim_pymunk.engine import Simulation
from granswim_pymunk.inference.criteria import DEFAULT
from granswim_pymunk.inference.hypothesis import Hypothesis
from granswim_pymunk.inference.windows import diagnose_bed
from granswim_pymunk.inference.windows.cut import cut_out
from granswim_pymunk.inference.windows.windows import BedCase, BedPredictor, bed_case
from granswim_pymunk.packing import pack
from granswim_pymunk.recording import Recording
from granswim_pymunk.scene import Adjustable, read_scene, use

NOISE = 2e-5  # m
FACTOR = 0.5
REACHES = (0.006, 0.008, DEFAULT.windows.cut.reach, 0.012, 0.015)


def film() -> Recording:
    """The paper's swimmer with a weak joint; the scene of the recording does not know of it."""
    scene = read_scene(Path(granswim_pymunk.__file__).parents[1] / "scenarios" / "swim.toml")
    packed = replace(pack(scene), bed=None)
    weak = packed.with_laws(use("weak_joint", joint=4, factor=FACTOR))
    t = 0.1 + 0.002 * np.arange(301)
    xy = Simulation(weak, dt=3e-6).sample(t)
    xy += np.random.default_rng(1).normal(0.0, NOISE, xy.shape)
    mobile = np.array([b.mobile for b in packed.bodies])
    stiffness = float(packed.laws_named("bending")[0].values["stiffness"])
    believed = replace(packed, adjustable=(Adjustable("bending", "stiffness", 0.5 * stiffness, 2 * stiffness),))
    ids = tuple(b.id for b in packed.bodies if b.mobile)
    return Recording("weak-joint", believed, t, ids, xy[:, mobile], position_noise=NOISE)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def steps(bed: BedCase, members: int = 6) -> None:
    """Print how far predictions shift with the time step: the mean over windows and members, and its scatter."""
    print("| step, advised = 1 | shift of the disks | its standard error | from the film | time, coarsest = 1 |")
    print("|---|---|---|---|---|")
    windows = list(range(len(bed.starts)))
    disks, rows = slice(0, bed.swimmer_size), []
    coarse = DEFAULT.windows.plan.coarse
    for share in (1.0, 0.5 * coarse, coarse, 1.5 * coarse):
        predictor = BedPredictor(replace(bed, dt=bed.dt * share / coarse), members=members)
        predictor(Hypothesis(()), np.zeros(0), windows, 1)  # starts are estimated
        began = time.perf_counter()
        found = predictor(Hypothesis(()), np.zeros(0), windows)[..., disks]
        rows.append((share, found, predictor.seen(windows)[:, disks], time.perf_counter() - began))
    for share, found, seen, took in rows:
        change = (found - rows[0][1]).mean(axis=1)
        error = change.std(axis=0) / np.sqrt(len(windows))
        print(
            f"| {share:g} | {1e6 * rms(change.mean(axis=0)):.1f} µm | {1e6 * rms(error):.1f} µm | "
            f"{1e6 * rms(found.mean(axis=1) - seen):.0f} µm | {took / rows[-1][3]:.2f} |"
        )
    print()


def main(argv: list[str]) -> int:
    minutes = float(argv[0]) if argv else 10.0
    recording = film()
    bed = bed_case(recording)
    windows = list(range(0, len(bed.starts), 2))
    nothing, none = Hypothesis(()), np.zeros(0)
    disks = slice(0, bed.swimmer_size)
    print("| bodies within | bodies simulated, carried | from the whole bed | from the film | time, whole = 1 |")
    print("|---|---|---|---|---|")
    base, cost = None, 0.0
    for reach in (None, *REACHES):
        predictor = BedPredictor(bed, cut=False)
        if reach is not None:
            predictor.cut = cut_out(recording.scene, bed.film.xy, bed.starts, int(bed.looks[-1]), reach)
            if predictor.cut is None:
                continue
            predictor.free = np.isin(bed.grains, predictor.cut.inside)
        predictor(nothing, none, windows, 3)  # starts are estimated
        began = time.perf_counter()
        found = predictor(nothing, none, windows, 3).mean(axis=1)[:, disks]
        took = time.perf_counter() - began
        error = 1e6 * rms(found - predictor.seen(windows)[:, disks])
        if base is None or predictor.cut is None:
            base, cost = found, took
            print(f"| whole bed | {len(recording.scene.bodies)}, 0 | 0 µm | {error:.0f} µm | 1 |")
        else:
            sizes = f"{len(predictor.cut.inside)}, {len(predictor.cut.wall)}"
            away = 1e6 * rms(found - base)
            print(f"| {1e3 * (reach or 0):g} mm | {sizes} | {away:.0f} µm | {error:.0f} µm | {took / cost:.2f} |")
    print()
    steps(bed)
    print("| diagnosis | law | factor, 95 % | held out: recalibrated, revised, floor | time, whole = 1 |")
    print("|---|---|---|---|---|")
    spent = 0.0
    for cut in (False, True):
        began = time.perf_counter()
        d = diagnose_bed([recording], minutes=10 * minutes if not cut else minutes, cut=cut)
        took = time.perf_counter() - began
        spent = spent or took
        law, factor = "none", ""
        laws = d.evidence.laws
        if laws:
            law = laws[0].label
            half = 1.96 * float(np.sqrt(laws[0].covariance[0, 0]))
            factor = f"{laws[0].values[0]:.3f}, {laws[0].values[0] - half:.3f} to {laws[0].values[0] + half:.3f}"
        held = [d.verdict["fit"]["heldout"][k] for k in ("recalibrated", "revised", "noise_floor")]
        errors = ", ".join(f"{1e6 * e:.0f} µm" for e in held if e is not None)
        print(f"| {'cut' if cut else 'whole bed'} | {law} | {factor} | {errors} | {took / spent:.2f} |")
    print(f"\nconcealed: joint 4, factor {FACTOR:g}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
