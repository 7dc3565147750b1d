"""The outcome of a diagnosis of an unseen bed: verdict, scenes that run, plain answers, tables, figures."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ...report.style import FLOOR, MUTED, NAIVE, RECALIBRATED, REVISED, SEEN, legend_above, panels, shortened, styled
from ...scene import Scene, Time
from ..choose import ALARM
from ..outcome import Outcome, Table, empty_verdict, mechanism_entry, mismatch_entry
from ..swimmer_terms import equation, reported_parameters
from . import search
from .checks import prediction, rest_of
from .conclude import Finding, Spot
from .response import spread_of
from .search import Trial, change_of
from .summaries import Condition

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
    rows: list[dict[str, Any]] = []
    if f.verdict == "unmodelled":
        for t in f.found:
            row = {"name": t.suspect.name, "gain_heldout": f.named_gain, "indistinguishable": False}
            if f.explained is not None:
                row["share"] = f.explained.share
            if t is f.withdrawn:
                row["withdrawn"] = True
            rows.append(row)
    return rows + [
        {"name": t.suspect.name, "gain_heldout": f.rival_gain.get(t.suspect.label), "indistinguishable": same}
        for t, same in f.rivals
    ]


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
    if f.found and not f.true and f.label != search.NAIVE:
        notes.append("numbers are from softened contacts: the time was up before the revised scene was run as it is")
    return notes


# ---- figures ---------------------------------------------------------------------------------------------

Drawn = dict[str, tuple[Figure, str]]


def draw_all(f: Finding) -> Drawn:
    """All figures that apply, in the order of the page."""
    figures: Drawn = {}
    tracked = [c for c in f.search.training if not c.any_view.curve]
    curves = [c for c in f.search.conditions if c.any_view.curve]
    if tracked:
        figures["angles"] = (
            angles(f, tracked[:4]),
            "Amplitude of the segments' angle and how far it lags behind the head, along the body: seen (black), "
            "predicted, and one standard deviation between packings (shaded).",
        )
        figures["innovations"] = (
            innovations(f, tracked),
            "Seen less predicted, in standard deviations between packings, before and after: each dot is one "
            "number (mean and harmonics of the angles, stroke of the head, drift, distance of disks).",
        )
    if curves:
        figures["speed"] = (
            speeds(f, curves),
            "Speed of the swimmer, head first, against frequency: measured with its standard error, and simulated "
            "with the error of the mean over packings; open symbols were held out.",
        )
    if any(not t.reason for t in f.search.trials):
        figures["candidates"] = (
            candidates(f),
            "Suspects: how much each explains (fall of the misfit, adjustables refitted) and, in brackets, the share "
            "of its signature that recalibration cannot imitate.",
        )
    if f.search.nulls is not None:
        figures["nulls"] = (
            nulls(f),
            "The same search on simulated recordings of the recalibrated physics in other packings, and on this one.",
        )
    if any(v is not None for v in f.held.values()):
        figures["held_out"] = (
            held_out(f),
            "Error of the predicted motion over one cycle, all disks, on what was fitted and on what was held out.",
        )
    return figures


def _polar(c: Condition, numbers: np.ndarray, test: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Amplitude [rad] and lag behind the head [cycles] of the segments' first harmonic."""
    view = c.test if test and c.test is not None else c.any_view
    names = view.numbers()
    cos = np.array([v for v, n in zip(numbers, names, strict=True) if n.kind == "cos" and n.harmonic == 1])
    sin = np.array([v for v, n in zip(numbers, names, strict=True) if n.kind == "sin" and n.harmonic == 1])
    amplitude = float(c.scene.laws_named("bending")[0].values["amplitude"])
    # a sin(turn - lag) = a (sin cos - cos sin)
    lag = np.unwrap(np.arctan2(-cos, sin) if amplitude >= 0 else np.arctan2(cos, -sin))
    return np.hypot(cos, sin), lag / (2 * math.pi)


@styled
def angles(f: Finding, conditions: list[Condition]) -> Figure:
    s = f.search
    figure, axes = panels(2 * len(conditions), columns=2, height=2.1, top=0.35)
    for k, c in enumerate(conditions):
        segments = np.arange(len(c.any_view.masses) - 1)
        rows = s.means.residuals[c.name]
        for which, colour in (("naive", NAIVE), ("recalibrated", RECALIBRATED), ("revised", REVISED)):
            found = prediction(f, s.means, c, which)
            if found is None or (which == "recalibrated" and not s.adjust) or (which == "revised" and not f.found):
                continue
            mean = found[0]
            cloud = [_polar(c, mean + row) for row in rows]
            for axis, here, every in zip(axes[2 * k :][:2], _polar(c, mean), zip(*cloud, strict=True), strict=True):
                wide = np.std(np.array(every) - here, axis=0)
                axis.plot(segments, here, color=colour)
                if which != "recalibrated":
                    axis.fill_between(segments, here - wide, here + wide, color=colour, alpha=0.18, lw=0)
        for axis, here in zip(axes[2 * k : 2 * k + 2], _polar(c, c.seen), strict=True):
            axis.plot(segments, here, "o", color=SEEN, ms=4)
            axis.set_xlabel("segment, from the head")
        axes[2 * k].set_ylabel("amplitude [rad]")
        axes[2 * k + 1].set_ylabel("lag [cycles]")
        axes[2 * k].set_title(shortened(f"{c.name}, {c.frequency:g} Hz"))
    handles = [Line2D([], [], color=SEEN, marker="o", ls="", label="seen"), Line2D([], [], color=NAIVE, label="naive")]
    if s.adjust:
        handles.append(Line2D([], [], color=RECALIBRATED, label="recalibrated"))
    if f.found:
        handles.append(Line2D([], [], color=REVISED, label="revised"))
    legend_above(figure, handles)
    return figure


@styled
def innovations(f: Finding, conditions: list[Condition]) -> Figure:
    s = f.search
    figure, axes = panels(len(conditions), columns=1, height=2.0, top=0.35)
    for axis, c in zip(axes, conditions, strict=True):
        names = c.numbers
        for which, colour in (("naive", NAIVE), ("recalibrated", RECALIBRATED), ("revised", REVISED)):
            found = prediction(f, s.means, c, which)
            if found is None or (which == "recalibrated" and not s.adjust) or (which == "revised" and not f.found):
                continue
            v = spread_of(s.means, c, found[1], c.error)
            axis.plot(np.arange(len(names)), (c.seen - found[0]) / np.sqrt(np.diag(v)), "o", color=colour, ms=3)
        axis.axhspan(-2, 2, color=FLOOR, alpha=0.15, lw=0)
        kinds = [(n.kind, n.harmonic) for n in names]
        starts = [k for k in range(len(names)) if k == 0 or kinds[k] != kinds[k - 1]]
        said = {"mean": "mean", "cos": "cos", "sin": "sin", "head_cos": "head", "drift": "drift", "length": "d"}
        ticks = [k for k in starts if names[k].kind in said]
        axis.set_xticks(ticks)
        axis.set_xticklabels(
            [said[names[k].kind] + (f" {names[k].harmonic}" if names[k].kind in ("cos", "sin") else "") for k in ticks],
            rotation=30, ha="left", va="top", rotation_mode="anchor",
        )  # fmt: skip
        for k in starts:
            axis.axvline(k - 0.5, color=MUTED, lw=0.4)
        axis.set_ylabel("seen - predicted\n[spreads]")
        axis.set_title(shortened(f"{c.name}, {c.frequency:g} Hz"))
    handles = [Line2D([], [], color=NAIVE, marker="o", ls="", label="naive")]
    if s.adjust:
        handles.append(Line2D([], [], color=RECALIBRATED, marker="o", ls="", label="recalibrated"))
    if f.found:
        handles.append(Line2D([], [], color=REVISED, marker="o", ls="", label="revised"))
    legend_above(figure, handles)
    return figure


@styled
def speeds(f: Finding, conditions: list[Condition]) -> Figure:
    s = f.search
    layers = sorted({c.layers for c in conditions}, key=lambda v: -1.0 if v is None else v)
    figure, axes = panels(len(layers), columns=2, height=2.6, top=0.35, sharey=True)
    for axis, layer in zip(axes, layers, strict=True):
        members = sorted((c for c in conditions if c.layers == layer), key=lambda c: c.frequency)
        x = [c.frequency for c in members]
        for which, colour in (("naive", NAIVE), ("recalibrated", RECALIBRATED), ("revised", REVISED)):
            if (which == "recalibrated" and not s.adjust) or (which == "revised" and not f.found):
                continue
            points = []
            for c in members:
                means = s.means if c.view is not None else s.test
                found = prediction(f, means, c, which)
                if found is not None:
                    wide = math.sqrt(float(means.covariance[c.name][0, 0]) * found[1])
                    points.append((c.frequency, float(found[0][0]), wide))
            if points:
                p = np.array(points)
                axis.errorbar(p[:, 0], 1e3 * p[:, 1], 1e3 * p[:, 2], color=colour, capsize=2)
        for c in members:
            held = c.view is None
            seen, error = (c.seen_test, c.error_test) if held else (c.seen, c.error)
            axis.errorbar(
                c.frequency, 1e3 * seen[0], 1e3 * math.sqrt(error[0, 0]), fmt="o", color=SEEN, ms=4,
                mfc="white" if held else SEEN,
            )  # fmt: skip
        axis.set_xlabel("frequency [Hz]")
        axis.set_ylabel("speed [mm/s]")
        if layer is not None:
            axis.set_title(f"{layer:g} layers")
        if len(set(x)) == 1:
            axis.set_xlim(x[0] - 1, x[0] + 1)
    handles = [Line2D([], [], color=SEEN, marker="o", ls="", label="measured")]
    handles.append(Line2D([], [], color=NAIVE, label="naive"))
    if s.adjust:
        handles.append(Line2D([], [], color=RECALIBRATED, label="recalibrated"))
    if f.found:
        handles.append(Line2D([], [], color=REVISED, label="revised"))
    legend_above(figure, handles)
    return figure


@styled
def candidates(f: Finding) -> Figure:
    trials = sorted((t for t in f.search.trials if not t.reason), key=lambda t: -t.gain)[:16]
    figure = Figure(figsize=(6.8, 0.6 + 0.24 * len(trials)), layout="constrained")
    axis = figure.subplots()
    chosen = {t.suspect.label for t in f.found}
    y = np.arange(len(trials))
    colours = [REVISED if t.suspect.label in chosen else MUTED for t in trials]
    axis.barh(y, [max(t.gain, 0.0) for t in trials], color=colours)
    axis.set_yticks(y)
    axis.set_yticklabels([f"{shortened(t.suspect.label, 34)} ({t.surviving:.2f})" for t in trials])
    axis.invert_yaxis()
    if f.search.nulls is not None:
        axis.axvline(float(np.quantile(f.search.nulls.best, 1 - ALARM)), color=SEEN, lw=0.8, ls="--")
    axis.set_xlabel("fall of the misfit (chi2); dashed: 99 % of the nulls stay below")
    return figure


@styled
def nulls(f: Finding) -> Figure:
    found = f.search.nulls
    assert found is not None
    figure = Figure(figsize=(6.8, 2.2), layout="constrained")
    axes = figure.subplots(1, 2)
    top = max((t.gain for t in f.search.trials if not t.reason), default=0.0)
    for axis, sample, here, label in (
        (axes[0], found.chi2, f.search.naive.chi2, "misfit (chi2) of the naive scene"),
        (axes[1], found.best, top, "gain of the best suspect (chi2)"),
    ):
        axis.hist(sample, bins=30, color=MUTED)
        axis.axvline(here, color=NAIVE, lw=1.6)
        if here > 20 * np.median(sample) + 1:
            axis.set_xscale("symlog", linthresh=max(float(np.quantile(sample, 0.99)), 1.0))
        axis.set_xlabel(label)
        axis.set_ylabel("nulls")
    return figure


@styled
def held_out(f: Finding) -> Figure:
    figure = Figure(figsize=(6.8, 2.0), layout="constrained")
    axis = figure.subplots()
    names = ["naive", "recalibrated", "revised", "noise_floor"]
    colours = [NAIVE, RECALIBRATED, REVISED, FLOOR]
    for offset, part, alpha in ((-0.2, f.train, 0.5), (0.2, f.held, 1.0)):
        for k, (name, colour) in enumerate(zip(names, colours, strict=True)):
            value = part.get(name)
            if value is not None:
                axis.bar(k + offset, 1e3 * value, 0.38, color=colour, alpha=alpha)
    axis.set_xticks(range(4))
    axis.set_xticklabels([n.replace("_", " ") for n in names])
    axis.set_ylabel("error [mm rms]")
    axis.set_title("left: fitted, right: held out")
    return figure
