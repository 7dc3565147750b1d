"""The result of a diagnosis of whole tracks: the contract's verdict, and the revised scenes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from ..inference.judge import explained_dict
from ..inference.result import (
    FORMAT,
    HELD_OUT,
    PARTLY,
    TRAINING,
    Diagnosis,
    Progress,
    Used,
    rival_entries,
    with_camera,
)
from ..laws import all_laws
from ..recording import Recording
from ..scene import Scene, Time
from .candidates import distinct_bodies, joints_by_body, owners
from .data import Case
from .driver import TrackFinding, diagnose_bodies
from .fit import Fit
from .held_out import Errors
from .hypothesis import NO_CAMERA, equation_with
from .name import Trial
from .start import states


def _number(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


def _term_offset(fit: Fit, trial: Trial) -> int:
    """Where the numbers of a trial's term begin among those of the fit."""
    at = 0
    for term in fit.hypothesis.terms:
        if term.label == trial.term.label and term.mechanism == trial.mechanism:
            return at
        at += len(term.free)
    raise KeyError(trial.term.label)


def _entries(diagnosis: TrackFinding, trial: Trial, gain: float | None) -> list[dict[str, Any]]:
    """The entries of ``mechanisms`` for one law: one, or one for each body that has a strength of its own."""
    fit = diagnosis.revised
    offset = _term_offset(fit, trial)
    term = trial.term
    bodies = owners(term)
    # a joint is named by the bodies that it joins
    known = all_laws().get(term.law)
    of_joint = known is not None and known.kind == "joint"
    joints = {b: list(names) for b, names in joints_by_body(diagnosis.cases).items()} if of_joint else {}
    entries = []
    for owner in list[str | None](bodies) or [None]:
        parameters: dict[str, Any] = {}
        for name, rows in term.groups:
            mine = [r for r in rows if r < 0 or owner is None or term.free[r].name.endswith(f"[{owner}]")]
            if not any(r >= 0 for r in mine):
                continue
            parameters[name] = _parameter(diagnosis, fit, offset, term, mine)
        for name, (value, unit) in ({k: (v, "1") for k, v in term.choices.items()} | dict(term.fixed)).items():
            parameters[name] = {"value": value, "low": None, "high": None, "unit": unit}
        entries.append(
            {
                "name": trial.mechanism,
                "expression": equation_with(
                    term.expression, ((k, p["value"], p["unit"]) for k, p in parameters.items())
                ),
                "bodies": _acting(diagnosis, trial) if owner is None else joints.get(owner, [owner]),
                "parameters": parameters,
                "surviving_fraction": _number(trial.signature.surviving),
                "gain_heldout": _number(gain),
            }
        )
    return entries


def _parameter(diagnosis: TrackFinding, fit: Fit, offset: int, term, rows: list[int]) -> dict[str, Any]:
    found: list[tuple[float, float | None, float | None]] = []
    for r in rows:
        if r < 0:  # a component that these recordings do not show
            found.append((0.0, None, None))
        else:
            value, *ends = fit.interval(offset + r, diagnosis.spread)
            low, high = (end if math.isfinite(end) else None for end in ends)
            found.append((value, low, high))
    unit = next(term.free[r].unit for r in rows if r >= 0)
    if len(found) == 1:
        value, low, high = found[0]
        return {"value": value, "low": low, "high": high, "unit": unit}
    return {
        "value": [f[0] for f in found], "low": [f[1] for f in found], "high": [f[2] for f in found], "unit": unit,
    }  # fmt: skip


def _acting(diagnosis: TrackFinding, trial: Trial) -> list[str]:
    if trial.term.bodies is not None:
        return list(trial.term.bodies)
    return list(distinct_bodies(diagnosis.cases))


def heldout_gain(diagnosis: TrackFinding, errors: Errors) -> float | None:
    """Half the fall of chi2 on held-out data, recalibrated less this."""
    before = diagnosis.held["recalibrated"]
    if before.rms is None or errors.rms is None:
        return None
    return (before.chi2 - errors.chi2) / 2


def verdict_dict(diagnosis: TrackFinding) -> dict[str, Any]:
    """The contents of verdict.json (contract version 2)."""
    d = diagnosis
    mechanisms: list[dict[str, Any]] = []
    rival_gain = {name: heldout_gain(d, e) for name, e in d.rival_held.items()}
    gain = heldout_gain(d, d.held["revised"])
    if d.verdict == "unmodelled" and d.found:
        entry = _entries(d, d.found[0], gain)[0]
        entry["name"] = "unknown"
        mechanisms.append(entry)
    else:
        for trial in d.found:
            mechanisms += _entries(d, trial, gain)

    errors = {
        part: {
            "naive": _number(source["naive"].rms),
            "recalibrated": _number(source["recalibrated"].rms),
            "revised": _number(source["revised"].rms),
            "noise_floor": _number(floor),
        }
        for part, source, floor in (("train", d.train, d.floor[0]), ("heldout", d.held, d.floor[1]))
    }
    whole = {k: _number(v.whole) for k, v in d.held.items()}
    result: dict[str, Any] = {
        "format": FORMAT,
        "verdict": d.verdict,
        "mismatch": [place.as_dict() for place in d.places],
        "mechanisms": mechanisms,
        "rivals": _rivals(d, rival_gain),
        "heldout": d.heldout,
        "fit": {**errors, "unit": next(c.unit for c in d.cases), "window": d.window},
        "null": {"p_false_alarm": d.null.p, "replicates": len(d.null.gains)} if d.null else None,
        "explained": explained_dict(d.judged),
        "complete": d.complete,
        "remains": None if d.remains is None else d.remains.as_dict(),
        "next_experiment": None
        if d.proposal is None
        else {"change": d.proposal.change, "separates": list(d.proposal.separates), "d_prime": d.proposal.d_prime},
        "recalibrated": {
            f.name: dict(zip(("value", "low", "high"), d.revised.interval(k, d.spread), strict=True))
            for k, f in enumerate(d.recalibrated.hypothesis.free)
        },
        "notes": list(d.notes) + [f"{b}: not named, {why}" for b, why in d.dropped_bodies.items()] + _remaining(d),
    }
    if any(whole.values()):
        result["fit"]["heldout_start_fitted_to_whole"] = whole
    return result


def _rivals(d: TrackFinding, gains: dict[str, float | None]) -> list[dict[str, Any]]:
    gone = [] if d.withdrawn_held is None else [(t.mechanism, heldout_gain(d, d.withdrawn_held)) for t in d.withdrawn]
    near = [(t.mechanism, gains.get(t.mechanism), e.share) for t, e in d.closest]
    return rival_entries(gone, near, [(t.mechanism, gains.get(t.mechanism), same) for t, same in d.rivals])


def _remaining(d: TrackFinding) -> list[str]:
    revised, floor = d.held["revised"].rms, d.floor[1]
    if revised and floor and revised > 1.5 * floor:
        unit = next(c.unit for c in d.cases)
        text = f"a held-out misfit of {revised:.3g} {unit} remains, {revised / floor:.1f} times the noise floor"
        if len(d.right_law):
            text += f"; where the law is right, numbers found from as noisy frames leave {told_range(d)} {unit}"
        return [text]
    return []


def told_range(diagnosis: TrackFinding) -> str:
    """The smallest and largest held-out error that numbers found from noisy frames leave where the law is right."""
    least, most = float(diagnosis.right_law.min()), float(diagnosis.right_law.max())
    return f"{least:.2g} to {most:.2g}"


def revised_scene(diagnosis: TrackFinding, case: Case) -> Scene:
    """The scene of a recording with what was found added; it runs as it is."""
    fit = diagnosis.revised
    values = (diagnosis.held["revised"].values or {}).get(case.name, fit.values)
    scene, camera = fit.hypothesis.scene(case, values)
    t0 = float(case.t[0]) + float(camera["time_offset"])
    if case.name in fit.starts:
        scene = scene.with_initial(states(*fit.start_of(case.name), scene, t0))
    else:
        from .start import describe_starts, first_numbers

        described = describe_starts(case, case.start, scene)
        scene = scene.with_initial(states(described, first_numbers(described), scene, t0))
    duration = float(case.t[-1] - case.t[0])
    spacing = duration / max(len(case.t) - 1, 1)
    scene = with_camera(scene, {k: v for k, v in camera.items() if v != NO_CAMERA[k]})
    return replace(
        scene,
        time=Time(
            dt=diagnosis.dt[case.name], start=t0, duration=duration, output=spacing, scheme=scene.time.scheme
        ),
        title=f"{case.recording.title or case.name}, revised",
    )


def diagnose_tracks(
    training: Sequence[Recording], held: Sequence[Recording] = (), *, minutes: float | None = None, seed: int = 0,
    progress: Progress = lambda text, share: None,
) -> Diagnosis:  # fmt: skip
    """Explain recordings of free, pinned, sprung and colliding bodies by what their scene lacks.

    ``minutes``: the budget;  ``seed``: of the nulls.  Raises InputError for recordings that cannot be used.
    """
    return result_of(diagnose_bodies(training, held, minutes=minutes, seed=seed, progress=progress))


def result_of(d: TrackFinding) -> Diagnosis:
    """Verdict, revised scenes and how each recording was used."""
    return Diagnosis(
        kind="bodies", verdict=verdict_dict(d), revised={case.name: revised_scene(d, case) for case in d.cases},
        evidence=d, used=tuple(_used(d, case) for case in d.cases),
        believed={f.name: (f.first, f.low, f.high) for f in d.recalibrated.hypothesis.free},
        places_in=tuple(place.case for place in d.places),
        right_law=(float(d.right_law.min()), float(d.right_law.max())) if len(d.right_law) else None,
        widened=math.sqrt(d.spread), seconds=d.seconds, runs=d.runs, seed=d.seed,
    )  # fmt: skip


def _used(d: TrackFinding, case: Case) -> Used:
    part = HELD_OUT if case.held_out else PARTLY if case.scored.any() else TRAINING
    sizes = zip(case.sigma, case.channels, strict=True)
    return replace(
        Used.of(case.recording, part, d.dt.get(case.name)), frames=len(case.t), length=float(case.t[-1] - case.t[0]),
        noise=tuple((float(s), "rad" if c.kind == "angle" else "m") for s, c in sizes), estimated=not case.sigma_known,
    )  # fmt: skip
