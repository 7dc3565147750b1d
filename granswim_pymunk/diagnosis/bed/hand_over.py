"""The result of a diagnosis of a bed: the contract's verdict, and scenes that run."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...inference.judge import explained_dict
from ...inference.result import (
    HELD_OUT,
    PARTLY,
    TRAINING,
    Diagnosis,
    Table,
    Used,
    empty_verdict,
    mechanism_entry,
    mismatch_entry,
    rival_entries,
    with_camera,
)
from ...recording import Recording
from ...scene import Scene, Time
from ..hypothesis import NO_CAMERA, Failed, Hypothesis, Term
from ..swimmer_terms import INTERVAL, equation, reported_parameters
from .candidates import LawAdder
from .driver import BedDiagnosis, diagnose_windows
from .trial import BedTrial
from .windows import HALF, BedPredictor, placed

CONTACT_LAWS = ("contact_friction", "restitution", "cohesion", "pair_lubrication", "distance_force")
MAP_MEMBERS = 6


def diagnose_bed(
    training: Sequence[Recording],
    held: Sequence[Recording] = (),
    *,
    minutes: float | None = None,
    seed: int = 0,
    progress: Callable[[str, float], None] = lambda text, share: None,
) -> Diagnosis:
    """Explain recordings of a swimmer and its grains, both seen, by what their scene lacks.

    ``minutes``: the budget, ten where not given;  ``seed``: of draws, twins and nulls.
    Raises InputError for recordings that cannot be used.
    """
    return result_of(diagnose_windows(training, held, minutes=minutes, seed=seed, progress=progress))


# ---- the verdict -----------------------------------------------------------------------------


def parameters_of(trial: BedTrial) -> dict[str, tuple[Any, Any, Any, str]]:
    """Name to (value, low, high, unit) of what was found; a force of a flow as its velocity."""
    covariance = trial.covariance if np.isfinite(trial.covariance).all() else None
    apply = trial.term.apply
    flow = apply.flow(trial.values, covariance) if isinstance(apply, LawAdder) else None
    if flow is None or not isinstance(apply, LawAdder):
        return reported_parameters(trial.term, trial.values, covariance)
    value = [float(v) for v in flow[0]]
    low: list[float | None] = [None] * 3
    high: list[float | None] = [None] * 3
    if flow[1] is not None:
        half = INTERVAL * np.sqrt(np.maximum(np.diag(flow[1]), 0.0))
        low = [max(value[0] - float(half[0]), 0.0), *(v - float(h) for v, h in zip(value[1:], half[1:], strict=True))]
        high = [v + float(h) for v, h in zip(value, half, strict=True)]
    return {
        apply.law.strength[0]: (value[0], low[0], high[0], "kg/s"),
        apply.pushed: (value[1:], low[1:], high[1:], "m/s"),
    }


def _acting(term: Term, scene: Scene) -> list[str]:
    return list(term.bodies or tuple(b.id for b in scene.bodies if b.mobile))


def verdict_of(d: BedDiagnosis) -> dict[str, Any]:
    """The content of verdict.json."""
    verdict = empty_verdict(d.verdict)
    scene = d.beds[0].scene
    if d.found is not None:
        for trial in d.laws:
            parameters = parameters_of(trial)
            verdict["mechanisms"].append(
                mechanism_entry(
                    trial.mechanism, equation(trial.term, parameters), _acting(trial.term, scene), parameters,
                    trial.signature.surviving, d.gain_held,
                )
            )  # fmt: skip
    verdict["mismatch"] = [
        mismatch_entry(
            q.bodies, q.z, q.p, region=q.region, phase=q.phase, t=q.t, speed=q.speed,
            frequency=_frequencies(d),
        )
        for q in d.places
    ]  # fmt: skip
    verdict["mismatch"] = _where_it_acts(d) + verdict["mismatch"]
    verdict["rivals"] = _rivals(d)
    verdict["heldout"] = d.heldout
    verdict["notes"] = list(d.notes)
    verdict["explained"] = None if d.judged is None else explained_dict(d.judged)
    verdict["complete"] = d.complete
    verdict["remains"] = None if d.remains is None else d.remains.as_dict()
    verdict["fit"]["window"] = d.window
    for part, source, floor in (("train", d.train, d.floor[0]), ("heldout", d.held, d.floor[1])):
        verdict["fit"][part] = {k: v.rms for k, v in source.items()} | {"noise_floor": floor}
        for model in ("naive", "recalibrated", "revised"):
            verdict["fit"][part].setdefault(model, None)
    verdict["null"] = {"p_false_alarm": d.p, "replicates": len(d.null)}
    if d.proposal is not None:
        verdict["next_experiment"] = {
            "change": d.proposal.change,
            "separates": list(d.proposal.separates),
            "d_prime": d.proposal.d_prime,
        }
    at = 0
    for term in d.adjustables:
        for f in term.free:
            value = float(d.values[at])
            half = INTERVAL * math.sqrt(max(float(d.value_covariance[at, at]), 0.0))
            known = math.isfinite(half)
            verdict["recalibrated"][f.name] = {
                "value": value, "low": max(value - half, f.low) if known else None,
                "high": min(value + half, f.high) if known else None,
            }  # fmt: skip
            at += 1
    return verdict


def _rivals(d: BedDiagnosis) -> list[dict[str, Any]]:
    gains = d.rival_gains
    return rival_entries(
        [(t.mechanism, d.withdrawn_gain) for t in d.withdrawn],
        [(t.mechanism, gains.get(t.term.label), share) for t, share in d.closest],
        [(t.mechanism, gains.get(t.term.label), same) for t, same in d.rivals],
    )


def _frequencies(d: BedDiagnosis) -> tuple[float, float] | None:
    found = [f for b in d.beds if (f := b.frequency()) is not None]
    return (min(found), max(found)) if found else None


def _where_it_acts(d: BedDiagnosis) -> list[dict[str, Any]]:
    """Where the laws that were found do their work: one joint, the head, contacts. Significance is the law's."""
    if d.verdict != "missing_physics":
        return []
    found = []
    for trial in d.laws:
        z = math.sqrt(max(trial.gain or trial.linear, 0.0))
        found += _place_of(trial, d.beds[0].scene, z, d.p, _frequencies(d))
    return found


def _place_of(
    trial: BedTrial, scene: Scene, z: float, p: float, frequency: tuple[float, float] | None
) -> list[dict[str, Any]]:
    acting = _acting(trial.term, scene)
    if trial.mechanism in CONTACT_LAWS:
        bounded = trial.mechanism not in ("distance_force", "cohesion", "pair_lubrication")
        return [mismatch_entry([], z, p, region="contacts", before_contact=False if bounded else None,
                               frequency=frequency)]  # fmt: skip
    if not set(acting) <= set(scene.swimmer_ids):
        return []
    region = "swimmer"
    if len(acting) == 1:
        joint = trial.term.choices.get("joint")
        if joint is not None:
            region = f"joint {joint}"
        elif acting[0] == scene.bodies[scene.swimmer[0]].id:
            region = "head"
    return [mismatch_entry(acting, z, p, region=region, frequency=frequency)]


def revised_scene(d: BedDiagnosis, number: int) -> Scene:
    """The scene of a recording with what was found, from a state estimated at its third frame."""
    bed = d.beds[number]
    hypothesis, values = Hypothesis(d.adjustables), d.values
    for trial in d.laws:
        hypothesis, values = hypothesis.with_term(trial.term), np.concatenate([values, trial.values])
    scene, camera = hypothesis.scene(bed.case, values)
    xy, v = BedPredictor(bed, cut=False).start_at(HALF, (3, 0), camera)
    start = float(bed.film.t[HALF])
    spacing = float(np.median(np.diff(bed.film.t)))
    scene = replace(
        placed(scene, xy, v),
        bed=None,
        time=Time(
            dt=bed.dt,
            start=start + float(camera["time_offset"]),
            duration=float(bed.film.t[-1]) - start,
            output=spacing,
            scheme=scene.time.scheme,
        ),
        title=f"{bed.recording.title or bed.name}, revised",
    )
    return with_camera(scene, {k: x for k, x in camera.items() if x != NO_CAMERA[k]})


# ---- all of it -------------------------------------------------------------------------------


def body_map(d: BedDiagnosis) -> tuple[np.ndarray, int] | None:
    """Of the training window with the largest misfit: (n,) size of each body's innovation in expected spreads.

    The spread is that of a few members and of the noise; NaN where a body was not seen.
    """
    bed, bench = d.beds[0], d.bench
    used = np.flatnonzero(bed.training)
    if not len(used):
        return None
    model = "naive" if d.verdict == "recalibrate" else "recalibrated"
    if model not in d.predicted:
        return None
    white = bench.noises[0].whiten(bench.innovations(d.predicted[model])[0], used)
    window = int(used[np.argmax(np.sum(white**2, axis=1))])
    values = d.naive_values if model == "naive" else d.recalibrated_values
    predictor = BedPredictor(bed, cut=False)
    frames = int(bed.starts[window]) + bed.looks
    try:
        simulation, camera = predictor.simulation(Hypothesis(d.adjustables), values)
        ends = []
        for member in range(MAP_MEMBERS):
            xy, v = predictor.start(window, member, camera)
            simulation.restart(xy, v, float(bed.film.t[frames[0]]))
            ends.append(simulation.sample([float(bed.film.t[frames[-1]])])[0])
    except Failed:
        return None
    d.runs += MAP_MEMBERS
    stack = np.stack(ends)
    spread = np.sqrt(stack.var(axis=0, ddof=1).mean(axis=1) * (1 + 1 / MAP_MEMBERS) + bed.film.sigma**2)
    gone = np.hypot(*(bed.film.xy[frames[-1]] - stack.mean(axis=0)).T)
    z = gone / (math.sqrt(2.0) * spread)
    z[[not b.mobile for b in bed.scene.bodies]] = np.nan
    return z, window


def result_of(d: BedDiagnosis) -> Diagnosis:
    """Verdict, scenes that run, candidates and how each recording was used, of a finished diagnosis."""
    d.map = body_map(d) if d.verdict != "no_mismatch" else None
    rows = [
        [
            t.term.label, f"{t.linear:.0f}", "–" if t.gain is None else f"{t.gain:.0f}",
            f"{t.signature.surviving:.2f}", ", ".join(f"{v:.3g}" for v in t.values),
        ]
        for t in d.trials[:25]
    ]  # fmt: skip
    table = Table(
        "Candidates", ("law", "gain, first order", "gain, simulated", "surviving", "numbers"), rows, (1, 2, 3),
        "Gains are falls in χ² of the training windows after recalibration.",
    )  # fmt: skip
    used = []
    for bed in d.beds:
        part = HELD_OUT if not bed.training.any() else TRAINING if bed.training.all() else PARTLY
        used.append(Used.of(bed.recording, part, bed.dt))
    return Diagnosis(
        kind="bed", verdict=verdict_of(d), revised={bed.name: revised_scene(d, k) for k, bed in enumerate(d.beds)},
        evidence=d, tables=(table,) if rows else (), used=tuple(used),
        believed={f.name: (f.first, f.low, f.high) for t in d.adjustables for f in t.free},
        seconds=d.seconds, runs=d.runs, seed=d.seed,
    )  # fmt: skip
