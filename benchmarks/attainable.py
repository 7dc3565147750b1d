"""``python -m granswim_pymunk.benchmarks.attainable RECORDING ...``: the held-out error that a right law leaves.

Bodies without a bed. The noise floor knows the physics with its numbers; a diagnosis has to find these from noisy
frames, and held-out frames come later, where a wrong number has carried the bodies away. So each recording is
diagnosed, what the revised scene shows is filmed again with noise of its own, and the numbers of the same law are
fitted to the training part of each such repeat: nothing is wrong there, and yet the held-out error is above the floor.
"""

from __future__ import annotations

import sys

import numpy as np

from granswim_pymunk.inference.hypothesis import Predictor
from granswim_pymunk.inference.tracks import diagnose_tracks
from granswim_pymunk.inference.tracks.held_out import right_law_errors
from granswim_pymunk.recording import read_recording

REPEATS = 12


def main(argv: list[str]) -> int:
    if not argv:
        print("which recordings?", file=sys.stderr)
        return 2
    print("| recording | named | held-out over floor | its law refitted to repeats: median, 90 % below |")
    print("|---|---|---|---|")
    rows = []
    for name in argv:
        recording = read_recording(name)
        result = diagnose_tracks([recording])
        d = result.evidence
        rms, floor = d.held["revised"].rms, d.floor[1]
        if d.verdict != "missing_physics" or rms is None or not floor:
            print(f"| {recording.name} | {d.verdict} | – | – |", flush=True)
            continue
        predictor, fit = Predictor({u.name: u.dt for u in result.used}), d.revised
        rng = np.random.default_rng(0)
        alike = right_law_errors(fit, d.cases, predictor, lambda: False, rng, REPEATS) / floor
        if not len(alike):
            continue
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
