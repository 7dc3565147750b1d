"""What the diagnosis of a bed hands over: verdict, scenes that run, answers in plain words, figures."""

from __future__ import annotations

import html
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...inference.judge import explained_dict
from ...recording import Recording
from ...report.bed_figures import bed_figures, map_on_frame
from ...report.words import bodies, listed, plainly
from ...scene import Scene, Time
from ..hypothesis import NO_CAMERA, Failed, Hypothesis, Term
from ..outcome import Outcome, Table, empty_verdict, mechanism_entry, mismatch_entry
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
) -> Outcome:
    """Explain recordings of a swimmer and its grains, both seen, by what their scene lacks.

    ``minutes``: the budget, ten where not given;  ``seed``: of draws, twins and nulls.
    Raises InputError for recordings that cannot be used.
    """
    return outcome_of(diagnose_windows(training, held, minutes=minutes, seed=seed, progress=progress))


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
    """What was withdrawn or not accepted comes first, then what does worse or as well."""
    withdrawn = [
        {"name": t.mechanism, "gain_heldout": d.withdrawn_gain, "indistinguishable": False, "withdrawn": True}
        for t in d.withdrawn
    ]
    near = [
        {"name": t.mechanism, "gain_heldout": d.rival_gains.get(t.term.label), "indistinguishable": False,
         "share": share}
        for t, share in d.closest
    ]  # fmt: skip
    first = {r["name"] for r in (*withdrawn, *near)}
    others = [
        {"name": t.mechanism, "gain_heldout": d.rival_gains.get(t.term.label), "indistinguishable": same}
        for t, same in d.rivals if t.mechanism not in first
    ]  # fmt: skip
    return [*withdrawn, *near, *others]


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


def revised_scene(d: BedDiagnosis, number: int) -> tuple[Scene, Mapping[str, Any]]:
    """The scene of a recording with what was found, from a state estimated at its third frame; and its camera."""
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
        adjustable=(),
        title=f"{bed.recording.title or bed.name}, revised",
    )
    return scene, {k: x for k, x in camera.items() if x != NO_CAMERA[k]}


# ---- words -----------------------------------------------------------------------------------


def _number(value: float, digits: int = 3) -> str:
    return f"{value:.{digits}g}"


def _values_in_words(trial: BedTrial) -> str:
    parts = []
    for name, (value, low, high, unit) in parameters_of(trial).items():
        if isinstance(value, str) or low is None or isinstance(value, list):
            shown = (
                value
                if isinstance(value, str)
                else ", ".join(map(_number, value))
                if isinstance(value, list)
                else _number(value)
            )
            parts.append(f"{name} = {shown}" + (f" {unit}" if unit not in ("1", "") else ""))
        else:
            unit = "" if unit in ("1", "") else f" {unit}"
            parts.append(f"{name} = {_number(value)}{unit} (95 %: {_number(low)} to {_number(high)})")
    return "; ".join(parts)


def headline_of(d: BedDiagnosis) -> str:
    if d.verdict == "no_mismatch":
        return "Nothing is missing that these windows could show"
    if d.verdict == "recalibrate":
        return "The physics is right; " + " and ".join(_moved(d)) + " was off"
    if d.withdrawn:
        names = " and ".join(map(_law_in_words, d.withdrawn))
        return f"Withdrawn: held-out windows are predicted worse with {names} than without"
    if d.verdict == "unmodelled" or d.found is None:
        text = "Something is missing that no law with a name explains"
        if d.closest:
            nearest, share = d.closest[0]
            text += f"; what comes closest, {_law_in_words(nearest)}, explains {_percent(share)} of it"
        return text
    what = " and ".join(map(_law_in_words, d.laws))
    text = f"the apparatus was off: {what}" if d.verdict == "measurement" else f"the scene lacks {what}"
    return text[0].upper() + text[1:] if d.complete else f"The best approximation so far: {text}"


def _percent(share: float) -> str:
    return f"{100 * max(share, 0.0):.0f} %"


def _standing(d: BedDiagnosis) -> list[tuple[str, str]]:
    """How much is explained, whether anything is left, and what held-out windows say."""
    answers: list[tuple[str, str]] = []
    told = None if d.judged is None else explained_dict(d.judged)
    if told is not None:
        text = (
            f"{_percent(told['share'])} ({_percent(told['low'])} to {_percent(told['high'])}) of what the scene "
            "misses in windows, each predicted without what it told itself"
        )
        if told["best_free_form"] is not None and d.verdict != "unmodelled":
            text += f"; the best force without a name {_percent(told['best_free_form'])}"
        answers.append(("How much is explained?", text + "."))
    left = d.remains
    if left is not None:
        text = (
            f"More than in twins: the swimmer's disks end {1e6 * left.rms:.0f} µm rms from where they are predicted, "
            f"and all that is compared is {left.times_floor:.2g} times as far off as in twins, "
            f"most at {html.unescape(listed(bodies(left.bodies), 3))}"
        )
        like = "" if left.looks_like.startswith("nothing") else f"; it looks like {left.looks_like}"
        answers.append(("What is left?", text + like + "."))
    elif d.laws and d.complete:
        answers.append(("What is left?", "No more than twins of the revised scene leave."))
    if d.heldout == "undecided" and d.laws:
        answers.append(("Does it hold?", "Held-out windows do not decide whether it predicts better."))
    return answers


def _law_in_words(trial: BedTrial) -> str:
    joint = trial.term.choices.get("joint")
    if joint is not None and trial.mechanism == "weak_joint":
        return f"{'a weak' if float(trial.values[0]) < 1 else 'a stiff'} joint (joint {joint})"
    return plainly(trial.mechanism)


def _moved(d: BedDiagnosis) -> list[str]:
    names = [f.name for t in d.adjustables for f in t.free]
    spread = np.sqrt(np.maximum(np.diag(d.value_covariance), 1e-300))
    far = [n for n, v, v0, s in zip(names, d.values, d.naive_values, spread, strict=True) if abs(v - v0) > 3 * s]
    return far or names


def answers_of(d: BedDiagnosis) -> list[tuple[str, str]]:
    answers: list[tuple[str, str]] = []
    names = [f.name for t in d.adjustables for f in t.free]
    if d.found is not None and d.verdict != "unmodelled":
        laws = [f"{plainly(t.mechanism).capitalize()}: {_values_in_words(t)}." for t in d.laws]
        answers.append(("What is wrong?", " ".join(laws)))
    elif d.verdict == "recalibrate":
        changes = [
            f"{n} is {_number(v)}, not {_number(v0)}"
            for n, v, v0 in zip(names, d.values, d.naive_values, strict=True)
            if n in _moved(d)
        ]
        answers.append(("What is wrong?", "; ".join(changes) + ". With that no law is missing."))
    elif d.strayed is not None:
        answers.append(("What is wrong?", d.strayed.text[:1].upper() + d.strayed.text[1:] + "."))
    elif d.verdict == "unmodelled":
        nearest = next((t for t in d.trials if t.gain is not None and t.mechanism != "unknown"), None)
        text = "The windows differ from what any law in the list gives."
        if d.withdrawn:
            asked = html.unescape(listed([plainly(t.mechanism) for t in d.withdrawn]))
            text = f"Training windows ask for {asked}, but held-out windows are predicted worse with it."
        if d.found is not None:
            text += f" What fits best has no name: {d.found.term.label}."
        if nearest is not None and not d.withdrawn:
            text += f" The nearest with a name is {plainly(nearest.mechanism)}."
        answers.append(("What is wrong?", text))
    else:
        answers.append(("What is wrong?", "Nothing that shows: the windows look like repeats of the simulation."))
    if d.verdict != "no_mismatch":
        answers.append(("Where?", _where(d)))
    answers += _standing(d)
    kinds = {"recalibrate": "naive"}
    before = d.held.get(kinds.get(d.verdict, "recalibrated"))
    after = d.held.get("revised")
    if before and after and before.rms and after.rms and d.verdict not in ("no_mismatch", "unmodelled"):
        answers.append(
            (
                "How much better?",
                f"In windows that were not used, the swimmer's disks are predicted to {1e6 * after.rms:.0f} µm "
                f"instead of {1e6 * before.rms:.0f} µm; perfect knowledge would leave {1e6 * d.floor[1]:.0f} µm.",
            )
        )
    sure = (
        f"The best law gains {d.score:.0f} in χ²; the same search where nothing is missing gains at most "
        f"{float(d.null.max()):.0f} in {len(d.null)} repeats (p = {_number(d.p, 2)})."
    )
    if d.strayed is not None:
        sure = f"That is {d.strayed.place.z:.0f} standard errors from what its twins show (p = {_number(d.p, 2)})."
    same = [plainly(t.mechanism) for t, equal in d.rivals if equal]
    if same:
        sure += f" On these data it cannot be told from {html.unescape(listed(same))}."
    elif d.rivals and d.found is not None:
        rival = d.rivals[0][0]
        best = max((t.gain or 0.0 for t in d.trials if t.mechanism == d.found.mechanism), default=0.0)
        apart = math.sqrt(max(best - (rival.gain or 0.0), 0.0))
        sure += f" The nearest rival is {plainly(rival.mechanism)}, d′ = {apart:.1f} behind."
    answers.append(("How sure?", sure))
    if d.proposal is not None:
        pair = html.unescape(listed([plainly(n) for n in d.proposal.separates]))
        answers.append(
            (
                "What to measure next?",
                f"{d.proposal.change.capitalize()}: it separates {pair} with d′ = {d.proposal.d_prime:.1f}.",
            )
        )
    elif d.verdict == "no_mismatch":
        answers.append(("What to measure next?", "Nothing is needed; a longer film would show weaker effects."))
    return answers


def _where(d: BedDiagnosis) -> str:
    acting = _where_it_acts(d)
    parts = []
    if d.strayed is not None:
        parts.append(f"The {d.strayed.place.region} as a whole.")
    if acting:
        entry = acting[0]
        region = entry["where"]["region"]
        names = bodies(entry["bodies"])
        parts.append(f"It acts at {region}" + (f" ({html.unescape(listed(names, 7))})" if names else "") + ".")
    elif d.found is not None and d.verdict == "missing_physics":
        parts.append("It acts on all bodies.")
    grains = [q for q in d.places if not q.bodies and q.phase is None and (q.region or "").startswith("grains")]
    single = [q for q in d.places if len(q.bodies) == 1 and q.phase is None]
    if grains and (not single or grains[0].z > single[0].z):
        parts.append(f"It shows most in {grains[0].region} (z = {grains[0].z:.1f} after all looks).")
    phases = [q for q in d.places if q.phase is not None]
    if single:
        names = [bodies(q.bodies)[0] for q in single[:3]]
        parts.append(
            f"The misfit is largest at {html.unescape(listed(names))} (z = {single[0].z:.1f} after all looks)."
        )
    if phases:
        q = phases[0]
        assert q.phase is not None
        parts.append(f"In the cycle it is largest between {q.phase[0]:.2f} and {q.phase[1]:.2f}.")
    return " ".join(parts) or "Nowhere in particular: no single place stands out."


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


def outcome_of(d: BedDiagnosis) -> Outcome:
    """Verdict, scenes, words, figures and tables of a finished diagnosis."""
    figures = {}
    found = body_map(d) if d.verdict != "no_mismatch" else None
    if found is not None:
        figures["map"] = (
            map_on_frame(d, *found),
            "The mismatch on a frame. Each body is coloured by how far it ended from its prediction, in expected "
            "spreads, in the training window with the largest misfit; about 1 is noise. Grains scatter because the "
            "bed is chaotic; what repeats over windows is judged in the figures below.",
        )
    for name, (draw, caption) in bed_figures(d).items():
        figures[name] = (draw(), caption)
    rows = [
        [
            t.term.label, f"{t.linear:.0f}", "–" if t.gain is None else f"{t.gain:.0f}",
            f"{t.signature.surviving:.2f}", ", ".join(_number(v) for v in t.values),
        ]
        for t in d.trials[:25]
    ]  # fmt: skip
    table = Table(
        "Candidates", ("law", "gain, first order", "gain, simulated", "surviving", "numbers"), rows, (1, 2, 3),
        "Gains are falls in χ² of the training windows after recalibration.",
    )  # fmt: skip
    return Outcome(
        verdict=verdict_of(d),
        revised={bed.name: revised_scene(d, k) for k, bed in enumerate(d.beds)},
        headline=headline_of(d),
        answers=answers_of(d),
        figures=figures,
        tables=[table] if rows else [],
        notes=list(d.notes),
        training=[b.name for b in d.beds if b.training.any()],
        held_out=[b.name for b in d.beds if not b.training.any()],
        seconds=d.seconds,
        runs=d.runs,
        seed=d.seed,
    )
