"""``python -m granswim_pymunk.validation.place_nulls``: z of the first place where nothing is missing.

Recordings in which nothing is missing, by the proof's own simulator: bodies in its apparatus, and small beds that are
seen. Each scene is recalibrated and its places are told as a diagnosis tells them, however small they are. z of the
first is the normal score of p after all looks (``inference.significance``): it should be standard normal, or below
where places depend on one another. One row a kind; numbers are kept in ``--out`` and not computed again.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy import stats

from granswim_pymunk.inference.criteria import DEFAULT, using
from granswim_pymunk.inference.tracks.innovations import locate, variance_by_case, window_map
from granswim_pymunk.inference.tracks.study import calibrated, study_of
from granswim_pymunk.inference.windows.model import Windows
from granswim_pymunk.inference.windows.places import locate as locate_windows
from granswim_pymunk.proof.cases import bodies_case
from granswim_pymunk.recording import read_recording
from granswim_pymunk.validation.bed_effects import keep, tell
from granswim_pymunk.validation.bed_nulls import make

SECRET = b"places where nothing is missing"
EVERY = replace(
    DEFAULT,
    left=replace(DEFAULT.left, places=1.0),
    windows=replace(DEFAULT.windows, places=replace(DEFAULT.windows.places, level=np.inf)),
)  # places however small


def of_bodies(seed: int) -> tuple[float, int]:
    """z of the first place in one recording of bodies, and how many places were looked at."""
    (recording,) = bodies_case(seed, SECRET, "null").recordings
    study = study_of([recording], [], np.random.default_rng(seed), lambda text, share: None, lambda share: False)
    _, fit = calibrated(study)
    windows = window_map(study.fitter, fit, variance_by_case(fit, study.training))
    return locate(windows)[0].z, len(windows.rows)


def of_bed(seed: int) -> tuple[float, int]:
    """The same of one small bed."""
    with tempfile.TemporaryDirectory() as folder:
        make(seed, True, Path(folder) / "bed")
        model = Windows([read_recording(Path(folder) / "bed")], seed=seed)
    model.recalibrate()
    likelihood = model.state.likelihood
    predicted = likelihood.predict([(model.state.hypothesis, model.state.values)], likelihood.every)[0]
    assert predicted is not None
    places = locate_windows(likelihood, predicted, likelihood.every)
    return places[0].z, len(places)


KINDS: Mapping[str, Callable[[int], tuple[float, int]]] = {"bodies": of_bodies, "small beds": of_bed}


ABOUT = (
    "z of the first place of a recording in which nothing is missing, after all looks. It should be standard",
    "normal; smaller is on the safe side. In brackets what as many standard normal numbers give, central 95 %.",
    "Both p are those of Kolmogorov and Smirnov: of z larger than standard normal numbers, and other than these.",
)
HEADER = (
    "| kind | recordings | mean z | spread | z above 1.64 | p, larger | p, other |",
    "|---|---|---|---|---|---|---|",
)


def line(kind: str, values: Sequence[float]) -> str:
    z, n = np.array(values), len(values)
    mean = stats.norm.ppf(0.975) / np.sqrt(n)
    low, high = np.sqrt(stats.chi2.ppf([0.025, 0.975], max(n - 1, 1)) / max(n - 1, 1))
    few, many = stats.binom.ppf([0.025, 0.975], n, 0.05)
    larger, other = (stats.kstest(z, "norm", alternative=side).pvalue for side in ("less", "two-sided"))
    cells = (
        kind,
        f"{n}",
        f"{z.mean():.2f} ({-mean:.2f} to {mean:.2f})",
        f"{z.std(ddof=1):.2f} ({low:.2f} to {high:.2f})",
        f"{int(np.sum(z > 1.645))} ({few:.0f} to {many:.0f})",
        f"{larger:.2g}",
        f"{other:.2g}",
    )
    return f"| {' | '.join(cells)} |"


def page(found: Mapping[str, Sequence[float]]) -> str:
    lines = [
        "# Places where nothing is missing",
        "",
        "Made by `python -m granswim_pymunk.validation.place_nulls --page FILE`; do not edit.",
        "",
        *ABOUT,
        "",
        *HEADER,
        *(line(kind, values) for kind, values in found.items() if values),
    ]
    return "\n".join([*lines, ""])


def main(argv: list[str] | None = None, say: Callable[[str], None] = print) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", required=True, metavar="DIR")
    parser.add_argument("--bodies", type=int, default=60, metavar="N")
    parser.add_argument("--beds", type=int, default=40, metavar="N")
    parser.add_argument("--page", metavar="FILE", help="write the table here")
    args = parser.parse_args(argv)
    found: dict[str, list[float]] = {}
    for (kind, of), count in zip(KINDS.items(), (args.bodies, args.beds), strict=True):
        found[kind] = []
        for seed in range(count):
            file = Path(args.out) / f"{kind.replace(' ', '-')}-{seed:02d}.json"
            if not file.exists():
                with using(EVERY):
                    z, places = of(seed)
                keep(file, {"z": z, "places": places})
                say(f"{kind} {seed}: z = {z:.2f} of {places} places")
            found[kind].append(float(json.loads(file.read_text())["z"]))
    return tell(page(found), args.page, say)


if __name__ == "__main__":
    sys.exit(main())
