"""The result of a diagnosis of an unseen bed: the contract's verdict, scenes that run, tables."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ...inference.criteria import current
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
from ...scene import Scene, Time
from ..swimmer_terms import equation, reported_parameters
from . import search
from .checks import rest_of
from .conclude import Finding, Spot
from .search import Trial, change_of
from .summaries import Condition


def result_of(f: Finding, seconds: float, seed: int) -> Diagnosis:
    """Everything that is written, from a finding."""
    s = f.search
    curves_only = all(c.any_view.curve for c in s.conditions)
    verdict = empty_verdict(f.verdict, None if curves_only else "m rms")
    verdict["mismatch"] = [_mismatch(f, spot) for spot in f.spots]
    verdict["mechanisms"] = _mechanisms(f)
    verdict["rivals"] = _rivals(f)
    for key, errors in (("train", f.train), ("heldout", f.held)):
        verdict["fit"][key].update({k: v for k, v in errors.items() if not curves_only})
    if s.nulls is not None:
        p = s.p_recalibration if f.verdict == "recalibrate" else s.p_search
        if f.verdict == "unmodelled" and not f.found:
            p = min(f.left[0], s.p_search)
        verdict["null"] = {"p_false_alarm": p, "replicates": len(s.nulls.best)}
        if any(spot.p < 1 / (len(s.nulls.best) + 1) for spot in f.spots):
            verdict["null"]["tail"] = "F with the degrees of freedom of the spread, all places counted"
    verdict["fit"]["window"] = None
    verdict |= _said_of_the_rest(f)
    if f.proposal is not None:
        change, names, d = f.proposal
        verdict["next_experiment"] = {"change": change, "separates": names, "d_prime": float(d)}
    n = len(s.adjust)
    verdict["recalibrated"] = {
        term.label: dict(zip(("value", "low", "high"), (float(f.revised.u[k]), *f.revised.interval(k)), strict=True))
        for k, term in enumerate(s.adjust[:n])
    }
    verdict["notes"] = _notes(f, curves_only)
    revised = {c.recording.name: c for c in reversed(s.conditions)}  # the first condition of each
    order = dict.fromkeys(c.recording.name for c in s.conditions)
    return Diagnosis(
        kind="unseen", verdict=verdict, revised={name: _revised_scene(f, revised[name]) for name in order},
        evidence=f, tables=_tables(f), used=_used(s),
        believed={t.label: (t.free[0].first, t.free[0].low, t.free[0].high) for t in s.adjust},
        seconds=seconds, runs=s.runner.runs + s.runner.cached, seed=seed,
    )  # fmt: skip


def _used(s: search.Search) -> tuple[Used, ...]:
    """How each recording was used: rows of a curve are one recording."""
    used = {}
    for recording in {c.recording.name: c.recording for c in s.conditions}.values():
        mine = [c for c in s.conditions if c.recording is recording]
        learnt = any(c.view is not None for c in mine)
        split = any(c.test is not None for c in mine)
        used[recording.name] = Used.of(recording, PARTLY if learnt and split else TRAINING if learnt else HELD_OUT)
    return tuple(used.values())


def _said_of_the_rest(f: Finding) -> dict[str, Any]:
    """``explained``, ``complete``, ``remains`` and ``heldout`` of the contract."""
    said: dict[str, Any] = {"explained": None, "complete": f.complete, "remains": None, "heldout": f.holds}
    if f.verdict in ("no_mismatch", "recalibrate"):
        return said
    if f.explained is not None:
        e = f.explained
        said["explained"] = {"share": e.share, "low": e.low, "high": e.high, "best_free_form": e.free}
    if not f.complete:
        rms, floor = f.train.get("revised"), f.train.get("noise_floor")
        spot = rest_of(f)
        said["remains"] = {
            "rms": rms, "times_floor": rms / floor if rms is not None and floor else None,
            "bodies": _ids(f) if spot.joint is None else [_ids(f)[spot.joint]],
            "when": {"t": None, "phase": spot.phase, "before_contact": None},
            "looks_like": "the drift, or all joints alike" if spot.joint is None
            else f"a bend at joint {spot.joint} that the drive's phase sets",
        }  # fmt: skip
    return said


def _ids(f: Finding) -> list[str]:
    scene = f.search.conditions[0].scene
    return [scene.bodies[k].id for k in scene.chains[0]]


def _region(joint: int | None, joints: int) -> str:
    if joint is None:
        return "swimmer"
    return "head" if joint == 0 else "tail" if joint >= joints - 2 else "middle"


def _mismatch(f: Finding, spot: Spot) -> dict[str, Any]:
    s = f.search
    ids = _ids(f)
    frequencies = [c.frequency for c in s.training]
    views = [c.view for c in s.training if c.view is not None]
    t = [float(min(v.t[v.keep][0] for v in views)), float(max(v.t[v.keep][-1] for v in views))]
    return mismatch_entry(
        ids if spot.joint is None else [ids[spot.joint]], spot.z, spot.p, region=_region(spot.joint, len(ids) - 1), t=t,
        phase=spot.phase, frequency=[min(frequencies), max(frequencies)],
    )  # fmt: skip


def parameters_of(f: Finding, trial: Trial) -> dict[str, tuple[Any, Any, Any, str]]:
    """Name to (value, low, high, unit) of a found law."""
    values, covariance = f.own(trial)
    x = trial.suspect
    if x.name == "ambient_flow":
        c, push = float(values[0]), values[1:]
        root = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        found: dict[str, tuple[Any, Any, Any, str]] = {
            "c": (c, max(c - 1.96 * float(root[0]), 0.0), c + 1.96 * float(root[0]), "kg/s")
        }
        if c > 0:
            # u = push/c, to first order in both
            u = push / c
            own, with_c = np.diag(covariance)[1:], covariance[0, 1:]
            wide = 1.96 * np.sqrt(np.maximum(own - 2 * u * with_c + u**2 * covariance[0, 0], 0.0)) / c
            found["u"] = (u.tolist(), (u - wide).tolist(), (u + wide).tolist(), "m/s")
        return found
    return reported_parameters(x.term, values, covariance)


def _mechanisms(f: Finding) -> list[dict[str, Any]]:
    entries = []
    ids = _ids(f)
    for t in f.found:
        parameters = parameters_of(f, t)
        entries.append(
            mechanism_entry(t.suspect.name, equation(t.suspect.term, parameters), list(t.suspect.extent) or ["camera"],
                            parameters, t.surviving, f.named_gain)
        )  # fmt: skip
        if t.suspect.apparatus:
            entries[-1]["bodies"] = ids
    if f.verdict != "unmodelled":
        return entries
    if f.free_gain is not None and f.free_gain <= 0:
        return []  # its curve predicts nothing
    where = next((spot.joint for spot in f.spots if spot.joint is not None), None)
    return [mechanism_entry("unknown", _curve(f, where), ids if where is None else [ids[where]], {}, None, f.free_gain)]


def _rivals(f: Finding) -> list[dict[str, Any]]:
    """Other laws, best first; where nothing is named, what came closest is the first, with its share."""
    fallen = f.found if f.verdict == "unmodelled" else []
    gone = [(t.suspect.name, f.named_gain) for t in fallen if t is f.withdrawn]
    near = [
        (t.suspect.name, f.named_gain, f.explained.share)
        for t in fallen if t is not f.withdrawn and f.explained is not None
    ]  # fmt: skip
    others = [(t.suspect.name, f.named_gain, False) for t in fallen if t is not f.withdrawn and f.explained is None]
    others += [(t.suspect.name, f.rival_gain.get(t.suspect.label), same) for t, same in f.rivals]
    return rival_entries(gone, near, others)


def _curve(f: Finding, joint: int | None) -> str:
    """What is left over, as a short expression in the drive's phase theta."""
    s = f.search
    c = s.training[0]
    r, _ = s.base.left[c.name]
    if c.any_view.curve:
        return f"speed seen less predicted at {c.frequency:g} Hz: {1e3 * r[0]:.3g} mm/s"
    at = {(n.kind, n.place, n.harmonic): k for k, n in enumerate(c.numbers)}
    j = joint or 0

    def bend(kind: str, h: int) -> float:
        value = r[at[kind, j, h]]
        return float(value - (r[at[kind, j - 1, h]] if j else 0.0))

    parts = [f"{bend('mean', 0):.3g}"]
    for h in c.any_view.harmonics:
        turn = "theta" if h == 1 else f"{h} theta"
        parts += [f"{bend('cos', h):+.3g} cos({turn})", f"{bend('sin', h):+.3g} sin({turn})"]
    return f"bend at joint {j}, seen less predicted: {' '.join(parts)} rad, theta = 2 pi f t + phase, {c.name}"


def _revised_scene(f: Finding, c: Condition) -> Scene:
    """The scene of a recording with what was found; its bed is packed when it is run."""
    s = f.search
    scene: Scene = change_of(c, s.adjust, f.values, f.extra())(c.scene)
    start, end = float(c.frames[0]), float(c.frames[-1])
    dt = s.runner.time_step(c, False)
    spacing = (end - start) / max(len(c.frames) - 1, 1)
    return replace(
        with_camera(scene, f.camera()), title=f"{c.recording.title or c.recording.name}, revised",
        time=Time(dt=dt, start=start, duration=end - start, output=spacing, scheme=scene.time.scheme),
        seed=c.recording.scene.seed,
    )  # fmt: skip


def _tables(f: Finding) -> tuple[Table, ...]:
    rows = []
    for t in sorted(f.search.trials, key=lambda t: -t.gain):
        state = t.reason or (f"refitted {t.refitted} times" if t.refitted else "first order")
        amount = ""
        if t.fit is not None:
            amount = ", ".join(f"{v:.3g} {x.unit}" for v, x in zip(t.values(), t.suspect.term.free, strict=True))
        rows.append([t.suspect.label, f"{t.surviving:.2f}", f"{t.gain:.1f}", amount, state])
    tables = [
        Table("Suspects", ["suspect", "surviving", "gain", "amount", "state"], rows, (1, 2),
              "surviving: share of the signature that recalibration cannot imitate; gain: fall of the misfit")
    ]  # fmt: skip
    runs = []
    for c in f.search.conditions:
        count = sum(len(v) for (name, _, _), v in f.search.runner.tracks.items() if name == c.name)
        said = "held out" if c.view is None else "training and held out" if c.test is not None else "training"
        runs.append([c.name, f"{c.frequency:g}", said, str(count), str(f.search.means.dof.get(c.name, 0))])
    header = ["recording", "frequency [Hz]", "use", "runs", "dof of the spread"]
    return (*tables, Table("Recordings", header, runs, (1, 3, 4)))


def _notes(f: Finding, curves_only: bool) -> list[str]:
    s = f.search
    notes = list(s.notes)
    if curves_only:
        notes.append("the contract's units of errors do not fit a curve of speeds: fit is null, see the figure")
    if f.left[0] <= current().verdict.alarm and f.verdict not in ("unmodelled",):
        rank, tail = f.left
        notes.append(f"the last fit leaves more than packings do (rank p = {rank:.2g}, chi2 tail p = {tail:.2g})")
    unseen = [t.suspect.label for t in s.trials if t.reason.startswith("no amount")]
    if unseen:
        notes.append("these recordings would not show: " + ", ".join(unseen))
    failed = [t for t in s.trials if t.reason and not t.reason.startswith(("no amount", "recalibration"))]
    for t in failed[:5]:
        notes.append(f"{t.suspect.label} was not judged: {t.reason}")
    notes.append(
        "p_false_alarm ranks this recording among replicates, each the deviations of two simulated packings mixed in a "
        "random proportion, with tracking noise; z and p of places are tails of F with the runs' degrees of freedom"
    )
    if f.found and not f.true and f.label != search.NAIVE:
        notes.append("numbers are from softened contacts: the time was up before the revised scene was run as it is")
    return notes
