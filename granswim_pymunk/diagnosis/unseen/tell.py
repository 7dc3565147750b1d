"""The outcome of a diagnosis of an unseen bed: verdict, scenes that run, plain answers, tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ...scene import Scene, Time
from ..choose import ALARM
from ..outcome import Outcome, Table, empty_verdict, mechanism_entry, mismatch_entry
from ..swimmer_terms import equation, reported_parameters
from .conclude import Finding, Spot
from .figures import draw_all
from .search import NAIVE, Trial, change_of

SPOKEN = {
    "no_mismatch": "The simulation agrees with what was seen, within what packings do.",
    "recalibrate": "No law is missing: a parameter of the scene was off.",
    "missing_physics": "A law is missing from the scene.",
    "unmodelled": "Something is missing from the scene, and none of the named laws explains it.",
    "measurement": "The apparatus, not the physics, explains the difference.",
}


def outcome_of(f: Finding, seconds: float, seed: int) -> Outcome:
    """Everything that is written, from a finding."""
    s = f.search
    curves_only = all(c.any_view.curve for c in s.conditions)
    verdict = empty_verdict(f.verdict, None if curves_only else "m rms")
    verdict["mismatch"] = [_mismatch(f, spot) for spot in f.spots]
    verdict["mechanisms"] = _mechanisms(f)
    verdict["rivals"] = [
        {"name": t.suspect.name, "gain_heldout": f.rival_gain.get(t.suspect.label), "indistinguishable": same}
        for t, same in f.rivals
    ]
    for key, errors in (("train", f.train), ("heldout", f.held)):
        verdict["fit"][key].update({k: v for k, v in errors.items() if not curves_only})
    if s.nulls is not None:
        p = s.p_recalibration if f.verdict == "recalibrate" else s.p_search
        if f.verdict == "unmodelled" and not f.found:
            p = min(f.left[0], s.p_search)
        verdict["null"] = {"p_false_alarm": p, "replicates": len(s.nulls.best)}
    if f.proposal is not None:
        change, names, d = f.proposal
        verdict["next_experiment"] = {"change": change, "separates": names, "d_prime": float(d)}
    n = len(s.adjust)
    verdict["recalibrated"] = {
        term.label: dict(zip(("value", "low", "high"), (float(f.revised.u[k]), *f.revised.interval(k)), strict=True))
        for k, term in enumerate(s.adjust[:n])
    }
    notes = _notes(f, curves_only)
    verdict["notes"] = notes
    held = sorted({c.recording.name for c in s.conditions if c.view is None and not c.any_view.curve})
    training = sorted({c.recording.name for c in s.training})
    revised: dict[str, tuple[Scene, Mapping[str, Any]]] = {}
    for c in s.conditions:
        if c.recording.name not in revised:
            revised[c.recording.name] = (_revised_scene(f, c), f.camera())
    outcome = Outcome(
        verdict=verdict, revised=revised, headline=_headline(f), answers=_answers(f), figures=draw_all(f),
        tables=_tables(f), notes=notes, training=training,
        held_out=held or [c.name for c in s.testing if c.view is None],
        seconds=seconds, runs=s.runner.runs + s.runner.cached, seed=seed,
    )  # fmt: skip
    return outcome


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
                            parameters, t.surviving, f.gain_held)
        )  # fmt: skip
        if t.suspect.apparatus:
            entries[-1]["bodies"] = ids
    if f.verdict != "unmodelled":
        return entries
    where = next((spot.joint for spot in f.spots if spot.joint is not None), None)
    expression = _curve(f, where)
    if entries:
        expression += f"; of the named laws {entries[0]['name']} comes closest: {entries[0]['expression']}"
    bodies = ids if where is None else [ids[where]]
    return [mechanism_entry("unknown", expression, bodies, {}, None, f.gain_held)]


def _curve(f: Finding, joint: int | None) -> str:
    """What is left over, as a short expression in the drive's phase theta."""
    s = f.search
    c = s.training[0]
    r, _ = (f.revised if f.found else s.base).left[c.name]
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


def _revised_scene(f: Finding, c: Any) -> Scene:
    """The scene of a recording with what was found; its bed is packed when it is run."""
    s = f.search
    scene: Scene = change_of(c, s.adjust, f.values, f.extra())(c.scene)
    start, end = float(c.frames[0]), float(c.frames[-1])
    dt = s.runner._dt.get((c.name, False))
    spacing = (end - start) / max(len(c.frames) - 1, 1)
    return replace(
        scene, adjustable=(), title=f"{c.recording.title or c.recording.name}, revised",
        time=Time(dt=dt, start=start, duration=end - start, output=spacing, scheme=scene.time.scheme),
        seed=c.recording.scene.seed,
    )  # fmt: skip


def _said(value: Any, unit: str) -> str:
    if isinstance(value, list):
        return "(" + ", ".join(_said(v, "") for v in value) + ")" + (f" {unit}" if unit else "")
    if isinstance(value, str):
        return value
    return f"{value:.3g}" + (f" {unit}" if unit not in ("", "1") else "")


def _law_text(f: Finding, t: Trial) -> str:
    parts = []
    for name, (value, low, high, unit) in parameters_of(f, t).items():
        between = f" (95 %: {_said(low, '')} to {_said(high, '')})" if isinstance(low, float) else ""
        parts.append(f"{name} = {_said(value, unit)}{between}")
    return f"{t.suspect.name.replace('_', ' ')}: {', '.join(parts)}"


def _headline(f: Finding) -> str:
    text = SPOKEN[f.verdict]
    same = [t.suspect.name.replace("_", " ") for t, same in f.rivals if same]
    if f.verdict in ("missing_physics", "measurement") and f.found:
        names = " and ".join(t.suspect.name.replace("_", " ") for t in f.found)
        text = f"{text} It is {names}" if not same else f"{text} It is {names}, or {', or '.join(same)}"
        text += "." if not same else ": these data cannot tell."
    return text


def _answers(f: Finding) -> list[tuple[str, str]]:
    s = f.search
    answers = [("What is wrong?", _headline(f))]
    ids = _ids(f)
    if f.spots and f.verdict != "no_mismatch":
        spot = f.spots[0]
        if spot.joint is None:
            where = "The swimmer as a whole: its drift or speed."
        else:
            where = f"The bend at disk {ids[spot.joint]} (joint {spot.joint} from the head), z = {spot.z:.1f}"
            if spot.phase is not None and spot.phase != (0.0, 1.0):
                where += f", most between {spot.phase[0]:.2f} and {spot.phase[1]:.2f} of the drive's cycle"
            where += "."
        answers.append(("Where?", where))
    if f.found and f.verdict != "unmodelled":
        answers.append(("Which law?", "; ".join(_law_text(f, t) for t in f.found) + "."))
    elif f.verdict == "recalibrate":
        shown = [
            f"{t.label} = {f.revised.u[k]:.4g} (was {t.free[0].first:.4g})" for k, t in enumerate(s.adjust)
        ]
        answers.append(("Which parameter?", "; ".join(shown) + "."))
    before, after, floor = (f.held.get(k) for k in ("recalibrated", "revised", "noise_floor"))
    part = "held-out data"
    if before is None:
        before, after, floor = (f.train.get(k) for k in ("naive", "revised", "noise_floor"))
        part = "the data"
    if before is not None and after is not None and f.verdict != "no_mismatch":
        naive = f.held.get("naive")
        start = naive if f.verdict == "recalibrate" and naive is not None else before
        text = f"The error on {part} falls from {1e3 * start:.3g} to {1e3 * after:.3g} mm"
        text += f"; perfect physics would leave {1e3 * floor:.3g} mm." if floor is not None else "."
        answers.append(("How much better?", text))
    if s.nulls is not None:
        n = len(s.nulls.best)
        p = s.p_recalibration if f.verdict == "recalibrate" else s.p_search
        text = f"Of {n} simulated recordings of the recalibrated physics in other packings, "
        text += f"{round(p * (n + 1)) - 1} gave as much to any suspect" if f.verdict != "recalibrate" else (
            f"{round(p * (n + 1)) - 1} moved the parameters as much")  # fmt: skip
        answers.append(("How sure?", text + f"; what the last fit leaves has p = {f.left[0]:.2g}."))
    if f.proposal is not None:
        change, names, d = f.proposal
        text = f"{change[0].upper()}{change[1:]}: it separates {' from '.join(names)} (d' = {d:.1f})."
        answers.append(("What next?", text))
    return answers


def _tables(f: Finding) -> list[Table]:
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
    tables.append(Table("Recordings", header, runs, (1, 3, 4)))
    return tables


def _notes(f: Finding, curves_only: bool) -> list[str]:
    s = f.search
    notes = list(s.notes)
    if curves_only:
        notes.append("the contract's units of errors do not fit a curve of speeds: fit is null, see the figure")
    if f.left[0] <= ALARM and f.verdict not in ("unmodelled",):
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
    if f.found and not f.true and f.label != NAIVE:
        notes.append("numbers are from softened contacts: the time was up before the revised scene was run as it is")
    return notes


