"""``python -m granswim_pymunk.benchmarks.attainable RECORDING ...``: the held-out error that a right law leaves.

Bodies without a bed. The noise floor knows the physics with its numbers; a diagnosis has to find these from noisy
frames, and held-out frames come later, where a wrong number has carried the bodies away. So each recording is
diagnosed, what the revised scene shows is filmed again with noise of its own, and the numbers of the same law are
fitted to the training part of each such repeat: nothing is wrong there, and yet the held-out error is above the floor.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np

from granswim_pymunk.diagnosis.driver import Diagnosis, diagnose_bodies
from granswim_pymunk.diagnosis.fit import Fitter
from granswim_pymunk.diagnosis.hypothesis import Failed, Predictor
from granswim_pymunk.recording import read_recording

REPEATS = 12


def repeats(d: Diagnosis, rng: np.random.Generator, count: int = REPEATS) -> np.ndarray:
    """Held-out errors (count,) [m or rad, rms] where the law is right and its numbers are fitted."""
    predictor, fit = Predictor(d.dt), d.revised
    fitter = Fitter(d.cases, predictor)
    whole = {c.name: fitter.predict(fit, c, np.ones(len(c.t), dtype=bool)) for c in d.cases if c.scored.any()}
    result = []
    for _ in range(count):
        twins = []
        for case in d.cases:
            if case.name in whole:
                noisy = whole[case.name] + rng.normal(size=whole[case.name].shape) * case.sigma
                noisy[~np.isfinite(case.values)] = np.nan
                case = replace(case, values=noisy)
            twins.append(case)
        again = Fitter(twins, predictor)
        try:
            found = again.fit(fit.hypothesis, fit.values, fit.starts, evaluations=20)
            parts = [(c.values - again.predict(found, c, c.training | c.scored))[c.scored] for c in twins]
        except Failed:
            continue
        errors = np.concatenate([p.ravel() for p in parts])
        result.append(float(np.sqrt(np.nanmean(errors**2))))
    return np.array(result)


def main(argv: list[str]) -> int:
    if not argv:
        print("which recordings?", file=sys.stderr)
        return 2
    print("| recording | named | held-out over floor | its law refitted to repeats: median, 90 % below |")
    print("|---|---|---|---|")
    rows = []
    for name in argv:
        recording = read_recording(name)
        d = diagnose_bodies([recording])
        rms, floor = d.held["revised"].rms, d.floor[1]
        if d.verdict != "missing_physics" or rms is None or not floor:
            print(f"| {recording.name} | {d.verdict} | – | – |", flush=True)
            continue
        alike = repeats(d, np.random.default_rng(0)) / floor
        rows.append((rms / floor, float(np.median(alike)), float(np.mean(alike < rms / floor))))
        named = " + ".join(t.term.label for t in d.found)
        most = float(np.quantile(alike, 0.9))
        print(f"| {recording.name} | {named} | {rms / floor:.2f} | {rows[-1][1]:.2f}, {most:.2f} |", flush=True)
    if rows:
        ratio, usual, rank = np.median(rows, axis=0)
        print(
            f"\nmedian of {len(rows)}: {ratio:.2f} of the floor; repeats of the right law {usual:.2f}; "
            f"above {100 * rank:.0f} % of its repeats"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
