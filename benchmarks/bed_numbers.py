"""``python -m granswim_pymunk.benchmarks.bed_numbers RECORDING [REPLICATES]``: what each choice of numbers tells of a
law.

Of one recording of a swimmer and its grains: standard errors of a law of usual strength, by the numbers that are
compared in a window (disks alone; with five sums over grains near and five over grains far; with all moments of the
grains; with means about each disk, too), by whether grains count alike or by how well they are predicted, and by how
far the covariance of replicates is shrunk. The noise is that of a replicate which the covariance was not made of; what
adjustables imitate is not taken off. Some five minutes for a full bed.
"""

from __future__ import annotations

import sys

import numpy as np

from granswim_pymunk.inference.windows.driver import begin
from granswim_pymunk.inference.windows.likelihood import WindowLikelihood
from granswim_pymunk.inference.windows.plan import Plan
from granswim_pymunk.inference.windows.signatures import mean_of_replicates, to_values
from granswim_pymunk.inference.windows.sums import MOMENTS, size_of
from granswim_pymunk.recording import read_recording

LAWS = ("restitution", "ambient_flow", "cohesion", "contact_friction", "coulomb_substrate", "linear_drag p = 0",
        "actuator_lag", "weak_joint at joint 2", "a force across the motion")  # fmt: skip
FIVE = ("mean dx", "mean dy", "along", "size across", "spread")
SHARES = (0.1, 0.3, 0.5, 1.0)


def standard_errors(change: np.ndarray, replicates: np.ndarray, share: float) -> float:
    """Of a change (W, M, D) of the members' prediction, by innovations of replicates (N, W, D), NaN where not seen.

    Scalar products are those of different members: their chaos adds nothing to the signal.
    """
    number, members = len(replicates), change.shape[1]
    change = np.nan_to_num(change)
    signal, noise = [], []
    for k in range(number):
        others = np.delete(replicates, k, axis=0)
        bias = mean_of_replicates(others)
        flat = np.nan_to_num((others - bias) * np.sqrt((number - 1) / (number - 2))).reshape(-1, replicates.shape[2])
        covariance = flat.T @ flat / len(flat) + 1e-16 * np.eye(flat.shape[1])
        covariance = (1 - share) * covariance + share * np.diag(np.diag(covariance))
        sought = np.linalg.solve(covariance, change.mean(axis=1).T).T
        products = np.einsum("wmd,dwn->mn", change, np.linalg.solve(covariance, change.reshape(-1, len(covariance)).T)
                             .reshape(len(covariance), *change.shape[:2]))  # fmt: skip
        signal.append((products.sum() - np.trace(products)) / (members * (members - 1)))
        away = np.nan_to_num(replicates[k] - bias) / np.sqrt(1 + 1 / (number - 1))
        noise.append(np.sum(np.sum(sought * away, axis=1) ** 2))
    return float(np.sign(np.mean(signal)) * abs(np.mean(signal)) / np.sqrt(np.mean(noise)))


def main(folder: str, replicates: int = 6) -> None:
    """Print the table for the recording in ``folder``."""
    plan = Plan.usual(replicates)
    start = begin([read_recording(folder)], [], 60.0, 0, None, plan, True, [])
    terms = [t for t in start.terms if t.label in LAWS]
    bed = start.likelihood.beds[0]
    used = start.likelihood.training[0]
    disks, one = bed.swimmer_size, size_of(len(bed.rows))
    moments = np.concatenate([disks + k * one + np.arange(2 * len(MOMENTS)) for k in range(len(bed.looks) - 1)])
    few = [k for k, name in enumerate(MOMENTS * 2) if name in FIVE]
    five = np.concatenate([disks + k * one + np.array(few) for k in range(len(bed.looks) - 1)])
    chosen = {"disks": np.arange(disks), "and five sums": np.concatenate([np.arange(disks), five]),
              "and moments": np.concatenate([np.arange(disks), moments]),
              "and means about disks": np.arange(bed.size)}  # fmt: skip
    print("recording", folder, "|", replicates, "replicates |", len(used), "windows")
    print("| numbers | grains count | shrunk | " + " | ".join(t.label for t in terms) + " |")
    print("|---" * (3 + len(terms)) + "|")
    for weighed in (False, True):
        likelihood = WindowLikelihood([bed], replicates, plan.members)
        if weighed:
            likelihood.weigh(start.hypothesis, start.naive_values)
        likelihood.make_replicates(start.hypothesis, start.naive_values)
        innovations = likelihood.noises[0].replicates[:, used]
        changes = []
        for term in terms:
            hypothesis = start.hypothesis.with_term(term)
            ends = [np.concatenate([start.naive_values, to_values(term, side * np.eye(len(term.free))[0])])
                    for side in (-1.0, 1.0)]  # fmt: skip
            before, after = likelihood.predict_surely([(hypothesis, end) for end in ends], [used])
            changes.append((after[0] - before[0])[used])
        for name, kept in chosen.items():
            for share in SHARES:
                told = [standard_errors(c[..., kept], innovations[..., kept], share) for c in changes]
                how = "by how sure they are" if weighed else "alike"
                print(f"| {name} | {how} | {share:g} | " + " | ".join(f"{z:.2g}" for z in told) + " |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:3]))
