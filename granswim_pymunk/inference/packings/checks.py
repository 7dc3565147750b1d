"""After the verdict: the revised scene with its own contacts, places, held-out data, the next experiment."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ... import distributions as stats
from ...laws import has_role
from ..checks import TOOLS, of_the_apparatus
from ..criteria import current
from ..model import Proposal
from ..places import Place, Span
from ..significance import normal_score
from .amounts import amount_jobs, amount_label
from .candidates import packings_for
from .conclude import Finding, extra_of
from .local import near, scatter_of, wilder_there
from .refitting import anchored
from .response import Fit, Means, Point, add, fit, spread_of
from .runs import Job
from .state import NAIVE, Search, Trial, jobs_for, label_of, rounded
from .summaries import Condition, View

# ---- the revised scene with its own contacts ------------------------------------------------------


def confirm(f: Finding, rivals: Sequence[Trial]) -> None:
    """Runs of the revised scene as it is given to the user, in all conditions; the last fit is anchored there.

    Rivals, and names that were not accepted, are run in the recordings that are held out too, with softer contacts.
    """
    s = f.search
    extra = f.extra()
    label = label_of(s.adjust, f.values, extra)
    if label != NAIVE:
        s.runner.do(
            jobs_for(s.conditions, s.adjust, f.values, extra, s.sizes.final, False, label),
            lambda k, n: s.progress("revised scene in other packings", 0.82 + 0.1 * k / n),
        )
    only_test = [c for c in s.conditions if c.view is None]
    jobs = _to_the_end(s, f.revised, f.found)
    for fitted, laws in _by_fit(rivals):
        values = rounded(fitted.u[: len(s.adjust)])
        runs = packings_for((t.candidate for t in laws), s.sizes.leader)
        jobs += jobs_for(only_test, s.adjust, values, extra_of(s, laws, fitted), runs, True)
        jobs += _to_the_end(s, fitted, laws)
    s.runner.do(jobs, lambda k, n: s.progress("rivals, held-out recordings", 0.92))
    s.means.refresh()
    s.test.refresh()
    if not all((label, False) in s.means.mean[c.name] for c in s.training):
        s.notes.append(f"the revised scene could not be run with its own contacts: {s.runner.reason(label, False)}")
        return
    f.label, f.true = label, True
    if f.found or s.adjust:
        here = f.revised.u.copy()
        here[[k for k, name in enumerate(f.revised.model.camera) if name is None]] = np.concatenate(
            [f.values, *[values for _, values in extra]]
        )
        soft = f.revised
        model, named = soft.model, [t.candidate for t in f.found]
        points: set[Point] = {(label, True), (label, False)}
        if f.found:
            there, beside = near(s, replace(model, centre=here), named)
            model = replace(model, slopes=there.slopes)
            points |= beside
        model = anchored(s, model, here, label, soft=False)
        f.revised = fit(model, s.means, s.training)
        f.wilder = wilder_there(s, points)
        found = scatter_of(s, f.revised, points)
        if found is not None:
            f.revised = replace(f.revised, scatter=found[0], dof=min(f.revised.dof, found[1]))
        _softness_said(f, soft)


def _to_the_end(s: Search, fitted: Fit, laws: Sequence[Trial]) -> list[Job]:
    """Runs that screened a law, where its fit leans on them: they go on through the held-out part of a film."""
    jobs: list[Job] = []
    for c in s.conditions:
        if c.view is None or c.test is None:
            continue
        points = fitted.model.sums(c.name, fitted.u)
        for x in (t.candidate for t in laws):
            for row in x.design:
                label = amount_label(x, row)
                if (label, True) in points:
                    numbers = sorted(s.runner.tracks.get((c.name, label, True), {}))
                    jobs += amount_jobs(x, row, [c], numbers, part=False)
    return jobs


def _by_fit(laws: Sequence[Trial]) -> list[tuple[Fit, list[Trial]]]:
    """Laws with the fit that they share, those without one left out; one that is asked for twice is there once."""
    found: dict[int, tuple[Fit, list[Trial]]] = {}
    for t in {(t.label, id(t.fit)): t for t in laws}.values():
        if t.fit is not None:
            found.setdefault(id(t.fit), (t.fit, []))[1].append(t)
    return list(found.values())


def _softness_said(f: Finding, soft: Fit) -> None:
    """A note where the contacts as believed give other numbers than the softer ones of the search."""
    width = np.sqrt(np.maximum(np.diag(f.revised.covariance), 1e-300))
    apart = np.abs(f.revised.u - soft.u) / width
    if len(apart) and apart.max() > 2:
        k = int(np.argmax(apart))
        f.search.notes.append(
            f"{f.revised.model.free[k].name} is {f.revised.u[k]:.3g} with contacts as they are and {soft.u[k]:.3g} "
            f"with the softer ones of the search, {apart[k]:.1f} standard errors apart"
        )


# ---- where ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Places:
    """How places are told from the residuals (p,) of one recording: rows of a joint's bend, and of the drift."""

    bends: tuple[tuple[np.ndarray, tuple[tuple[str, int], ...]], ...]
    whole: np.ndarray


def _places_of(c: Condition) -> _Places:
    names = c.numbers
    unit = np.eye(len(names))
    if c.any_view.curve:
        return _Places((), unit)
    at = {(n.kind, n.place, n.harmonic): k for k, n in enumerate(names)}
    bends = []
    for j in range(len(c.any_view.masses) - 1):
        rows, kinds = [], []
        for (kind, place, h), k in at.items():
            if place == j and kind in ("mean", "cos", "sin"):
                rows.append(unit[k] - (unit[at[kind, j - 1, h]] if j else 0.0))
                kinds.append((kind, h))
        bends.append((np.array(rows), tuple(kinds)))
    return _Places(tuple(bends), unit[[k for k, n in enumerate(names) if n.kind == "drift"]])


def _tails(s: Search, base: Fit, left: Mapping[str, np.ndarray]) -> np.ndarray:
    """(joints + 1, k) log tail probabilities of residuals (p, k), the whole swimmer last: tails of F."""
    places = {c.name: _places_of(c) for c in s.training}
    joints = max(len(p.bends) for p in places.values())
    out = []
    for j in [*range(joints), None]:
        total: np.ndarray | float = 0.0
        n = nu = 0
        for name, p in places.items():
            rows = p.whole if j is None else p.bends[j][0] if j < len(p.bends) else np.zeros((0, 0))
            if not len(rows):
                continue
            d = rows @ left[name]
            total = total + np.sum(d * np.linalg.solve(rows @ base.left[name][1] @ rows.T, d), axis=0)
            n += len(rows)
            nu += s.means.dof[name]
        nu = max(nu, n + 3)
        out.append(stats.f.logsf(np.asarray(total) * (nu - n + 1) / (nu * max(n, 1)), max(n, 1), nu - n + 1))
    return np.array(out)


def locate(f: Finding, verdict: str) -> dict[int | None, Place]:
    """Joints at which the bend differs, by the innovations before the missing law was added, best first.

    None: the swimmer as a whole (its drift, or the mean speed).
    """
    s = f.search
    base = s.naive if verdict == "recalibrate" else s.base
    here = _tails(s, base, {name: r[:, None] for name, (r, _) in base.left.items()})[:, 0]
    drawn = _null_numbers(s, base is s.base)
    most = np.sort(_tails(s, base, drawn).min(axis=0)) if drawn else np.zeros(0)
    joints = len(here) - 1
    found: dict[int | None, float] = {}  # joint to p
    for j, tail in sorted(enumerate(here), key=lambda item: item[1]):
        p = float((1 + np.searchsorted(most, tail, side="right")) / (len(most) + 1)) if len(most) else 1.0
        if len(most) and tail < most[0]:
            # beyond all nulls: the tail of F, all places counted
            p = min(p, float(np.exp(max(tail + math.log(len(here)), -690.0))))
        if p < current().verdict.alarm:
            found[j if j < joints else None] = p
    if not found:
        # nothing stands out by itself: the swimmer as a whole
        found[None] = max(s.p_recalibration if verdict == "recalibrate" else s.p_search, current().rounding.nothing)
    return {joint: _place(f, base, joint, p) for joint, p in found.items()}


def _place(f: Finding, base: Fit, joint: int | None, p: float) -> Place:
    ids = ids_of(f)
    frequencies = [c.frequency for c in f.search.training]
    views = [c.view for c in f.search.training if c.view is not None]
    t = float(min(v.t[v.keep][0] for v in views)), float(max(v.t[v.keep][-1] for v in views))
    return Place(
        ids if joint is None else [ids[joint]], normal_score(p), p, _region(joint, len(ids) - 1), t=t,
        phase=None if joint is None else _phase(f, base, joint), frequency=(min(frequencies), max(frequencies)),
    )  # fmt: skip


def ids_of(f: Finding) -> list[str]:
    """Of the swimmer's disks, from head to tail."""
    scene = f.search.conditions[0].scene
    return [scene.bodies[k].id for k in scene.chains[0]]


def _region(joint: int | None, joints: int) -> str:
    if joint is None:
        return "swimmer"
    return "head" if joint == 0 else "tail" if joint >= joints - 2 else "middle"


def rest_of(f: Finding) -> tuple[int | None, Span]:
    """The joint at which what the last fit leaves is largest, by tails of F, and the part of the cycle."""
    tails = _tails(f.search, f.revised, {name: r[:, None] for name, (r, _) in f.revised.left.items()})[:, 0]
    j = int(np.argmin(tails))
    return (j, _phase(f, f.revised, j)) if j < len(tails) - 1 else (None, None)


def _null_numbers(s: Search, refitted: bool) -> dict[str, np.ndarray]:
    """For each recording the residuals (p, replicates) of the nulls; ``refitted``: after recalibration."""
    if s.nulls is None:
        return {}
    out, at, rows = {}, 0, s.nulls.refitted if refitted else s.nulls.drawn
    for c in s.training:
        factor = np.linalg.cholesky(s.base.left[c.name][1])
        out[c.name] = factor @ rows[:, at : at + len(factor)].T
        at += len(factor)
    return out


def _phase(f: Finding, base: Fit, joint: int) -> tuple[float, float] | None:
    """Where in the cycle a joint's bend differs most, in the recording that shows it best."""
    best: tuple[float, tuple[float, float]] | None = None
    theta = np.linspace(0, 2 * math.pi, 72, endpoint=False)
    for c in f.search.training:
        p = _places_of(c)
        if joint >= len(p.bends):
            continue
        rows, kinds = p.bends[joint]
        r, v = base.left[c.name]
        basis = np.array([
            np.ones_like(theta) if kind == "mean" else np.cos(h * theta) if kind == "cos" else np.sin(h * theta)
            for kind, h in kinds
        ])  # fmt: skip
        wide = np.sqrt(np.maximum(np.einsum("ik,ij,jk->k", basis, rows @ v @ rows.T, basis), 1e-300))
        z = np.abs((rows @ r) @ basis) / wide
        if best is None or z.max() > best[0]:
            best = float(z.max()), _arc(z)
    return best[1] if best is not None else None


def _arc(z: np.ndarray) -> tuple[float, float]:
    """The part of the cycle (0..1) around the maximum in which z stays above half of it."""
    n = len(z)
    top = int(np.argmax(z))
    high = z > current().packings.arc * z[top]
    if high.all():
        return 0.0, 1.0
    first = last = top
    while high[(first - 1) % n]:
        first -= 1
    while high[(last + 1) % n]:
        last += 1
    return (first % n) / n, ((last + 1) % n) / n


# ---- held-out data ------------------------------------------------------------------------------------


def outcome_of(gain: float, apart: float) -> str:
    """Whether held-out data are predicted better: "holds", "fails" or "undecided".

    Half the fall of chi2 varies between packings by the distance ``apart`` of the two predictions, in spreads.
    """
    criteria = current().packings
    return "holds" if gain > criteria.side * apart else "fails" if gain < -criteria.side * apart else "undecided"


def gain_of(f: Finding, predict: Callable[[Condition], tuple[np.ndarray, float] | None]) -> tuple[float, float] | None:
    """Half the fall of chi2 on held-out numbers, recalibrated less ``predict``, and its standard deviation.

    Both by one spread: then the fall is linear in what was seen, and varies by the distance of the predictions.
    """
    s = f.search
    total = square = 0.0
    for c in s.testing:
        one, other = prediction(f, s.test, c, "recalibrated"), predict(c)
        if one is None or other is None:
            return None
        factor = np.linalg.cholesky(spread_of(s.test, c, 0.5 * (one[1] + other[1]), c.error_test))
        a, b = (np.linalg.solve(factor, c.seen_test - mean) for mean, _ in (one, other))
        total += 0.5 * float(a @ a - b @ b)
        square += float((a - b) @ (a - b))
    return (total, math.sqrt(square)) if s.testing else None


def shifted(f: Finding, c: Condition) -> tuple[np.ndarray, float] | None:
    """Held-out numbers with the mean shift that the training part shows: a form without a name."""
    s = f.search
    found = prediction(f, s.test, c, "recalibrated")
    if found is None or any(o.any_view.curve != c.any_view.curve for o in s.training):
        return None
    shifts: dict[tuple, list[float]] = {}
    for o in s.training:
        for n, r in zip(o.numbers, s.base.left[o.name][0], strict=True):
            shifts.setdefault((n.kind, n.place, n.harmonic), []).append(float(r))
    names = s.test.view(c).numbers()
    shift = np.array([np.mean(shifts.get((n.kind, n.place, n.harmonic), [0.0])) for n in names])
    return found[0] + shift, found[1] + 1 / len(s.training)


def predicted_by(s: Search, laws: Sequence[Trial], fitted: Fit, c: Condition) -> tuple[np.ndarray, float] | None:
    """Held-out numbers predicted by laws fitted together, with softer contacts; None where that was not run."""
    camera = {n: float(fitted.u[k]) for k, n in enumerate(fitted.model.camera) if n is not None}
    if c.view is not None:
        # the later part of a film that was learnt from: its runs are those of the fit
        points = fitted.model.sums(c.name, fitted.u)
    else:
        label = label_of(s.adjust, rounded(fitted.u[: len(s.adjust)]), extra_of(s, laws, fitted))
        points = add((1.0, {(NAIVE, False): 1.0}), (1.0, {(label, True): 1.0}), (-1.0, {(NAIVE, True): 1.0}))
    try:
        mean, variance = s.test.predict(c, points)
    except KeyError:
        return None
    return s.test.view(c).filmed(mean, **camera) if camera else mean, variance


def prediction(f: Finding, means: Means, c: Condition, which: str) -> tuple[np.ndarray, float] | None:
    """Numbers predicted by "naive", "recalibrated" or "revised"; None where such a scene was not run there."""
    s = f.search
    try:
        if which == "naive":
            return means.predict(c, {(NAIVE, False): 1.0})
        if which == "recalibrated":
            if means is s.test and not f.found and f.true:
                return means.predict(c, {(f.label, False): 1.0})  # it is the revised scene, run as it is
            return s.base.model.predict(means, c, s.base.u)
        if means is s.means:
            return f.revised.model.predict(means, c, f.revised.u)
        if not f.true:
            return s.base.model.predict(means, c, s.base.u) if not f.found else None
        points = {(f.label, False): 1.0}
        if f.found and c.view is not None:
            # the later part of a film that was learnt from: its runs are those of the fit
            points = f.revised.model.sums(c.name, f.revised.u)
        mean, variance = means.predict(c, points)
        view = means.view(c)
        return view.filmed(mean, **f.camera()), variance
    except KeyError:
        return None


def errors_of(f: Finding, means: Means, conditions: list[Condition]) -> dict[str, float | None]:
    """Root mean square distance of the disks over a cycle [m], of each model, and of perfect physics."""
    s = f.search
    tracked = [c for c in conditions if not c.any_view.curve]
    result: dict[str, float | None] = {}
    for which in ("naive", "recalibrated", "revised"):
        squares: list[float] = []
        for c in tracked:
            predicted = prediction(f, means, c, which)
            if predicted is None:
                squares = []
                break
            seen = c.seen_test if means.test else c.seen
            squares.append(means.view(c).distance(seen, predicted[0]) ** 2)
        result[which] = float(np.sqrt(np.mean(squares))) if squares else None
    # what perfect physics leaves: one packing against the mean of the others, with tracking noise
    floors = []
    rng = np.random.default_rng(s.runner.seed)
    for c in tracked:
        view: View = means.view(c)
        runs = s.runner.values(c, f.label, False) if f.true else None
        if runs is None:
            runs = s.runner.values(c, NAIVE, False)
        if runs is None or len(runs) < 2:
            continue
        error = c.error_test if means.test else c.error
        y = np.array([view.observe(xy) for xy in runs])
        shaken = y + rng.multivariate_normal(np.zeros(y.shape[1]), error, size=len(y), method="eigh")
        for k in range(len(y)):
            floors.append(view.distance(shaken[k], np.delete(y, k, axis=0).mean(axis=0)) ** 2)
    result["noise_floor"] = float(np.sqrt(np.mean(floors))) if floors else None
    return result


# ---- the next experiment --------------------------------------------------------------------------------


def propose(s: Search, winner: Trial, rival: Trial) -> Proposal | None:
    """Which one recording more separates the winner from its nearest rival, the rival refitted to all.

    d' is the square root of what the refitted rival keeps of chi2 in that recording (T-optimality: Atkinson &
    Fedorov 1975, Biometrika 62, 57); the candidates are repeats of what was recorded, and tracks where there
    were only speeds.
    """
    names = (winner.mechanism, rival.mechanism)
    if rival.fit is None or winner.fit is None:
        return None
    measured = {t.mechanism: t for t in (winner, rival) if t.mechanism in TOOLS}
    if measured and (set(measured) != {"time_offset"} or any(has_role(n, "late") for n in names)):
        case = s.training[0]
        noise, read = math.sqrt(max(float(case.error[-1, -1]), 1e-14)), current().packings
        changes = {name: abs(float(t.values()[0]) - float(t.candidate.neutral[0])) for name, t in measured.items()}
        return of_the_apparatus(names, changes, case.any_view.t, lambda: max(noise / read.picture, read.read))
    best: tuple[float, str] | None = None
    for curve in (False, True):
        chosen = [c for c in s.training if c.any_view.curve == curve]
        if not chosen:
            continue
        conditions = [_tracked(c) if curve else c for c in chosen]
        means = Means(s.runner, conditions)
        means.refresh()
        try:
            truth = {c.name: winner.fit.model.predict(means, c, winner.fit.u)[0] for c in conditions}
            again = fit(rival.fit.model, means, conditions, truth)
        except (KeyError, np.linalg.LinAlgError):
            continue
        for c in conditions:
            r, v = again.left[c.name]
            d = math.sqrt(float(r @ np.linalg.solve(v, r)))
            what = "film the swimmer" if curve else "one more recording"
            layers = "" if c.layers is None or not curve else f" under {c.layers:g} layers"
            text = f"{what} at {c.frequency:g} Hz{layers} (frequency = {c.frequency:g} Hz)"
            if best is None or d > best[0]:
                best = (d, text)
    if best is None:
        return None
    d, text = best
    decides = current().verdict.decides
    if d < decides:
        many = math.ceil((decides / max(d, 0.1)) ** 2)
        text += f"; about {many} of them make d' {decides:g}"
    return Proposal(text, names, float(d))


def _tracked(c: Condition) -> Condition:
    """A curve's condition as if the swimmer had been filmed for as long."""
    view = replace(c.any_view, curve=False)
    p = len(view.numbers())
    # 20 micrometres on 250 frames and more: far below what packings do; angles to 1e-3 rad, places to 4e-6 m
    error = np.diag([1e-6 if n.unit == "rad" else 1.6e-11 if n.unit == "m" else 1e-8 for n in view.numbers()])
    return replace(c, view=view, seen=np.zeros(p), error=error, averaged=False)
