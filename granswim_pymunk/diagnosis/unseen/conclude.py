"""From gains to a verdict: leaders refitted by simulation, rivals, what is left, where it shows, held-out errors."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from scipy import stats

from ...inference.significance import normal_score
from ..choose import ALARM, SAME
from .conditions import Condition
from .observe import View
from .response import Fit, Means, add, fit, spread_of
from .runs import Job
from .search import (
    NAIVE,
    Search,
    Trial,
    anchored,
    base_point,
    change_of,
    goodness,
    jobs_for,
    label_of,
    model_of,
    more_runs,
    recalibrate,
    refit,
    rounded,
    screen,
    try_all,
)
from .suspects import Suspect

# one and the same where only the drive depends on time (contract): what differs is the error of the runs
EQUIVALENT = {frozenset(("actuator_delay", "time_offset"))}
POOR = 0.1  # share of the misfit that a named law may leave where what it leaves is significant
LEFT_ALARM = 1e-4  # how improbable (chi2 tail) what is left has to be before it is called unmodelled


@dataclass(frozen=True)
class Spot:
    """A place along the body where prediction and recording differ: z and p corrected for all places looked at."""

    joint: int | None  # None: the swimmer as a whole (its drift, or the mean speed)
    z: float
    p: float
    phase: tuple[float, float] | None


@dataclass
class Finding:
    """What the search came to."""

    search: Search
    verdict: str
    found: list[Trial]
    revised: Fit
    label: str  # of the runs of the revised scene
    true: bool  # whether those have the scene's own contacts
    rivals: list[tuple[Trial, bool]]
    left: tuple[float, float]  # p-values of what the last fit leaves: rank among the nulls, chi2 tail
    spots: list[Spot] = field(default_factory=list)
    proposal: tuple[str, list[str], float] | None = None
    train: dict[str, float | None] = field(default_factory=dict)
    held: dict[str, float | None] = field(default_factory=dict)
    gain_held: float | None = None
    rival_gain: dict[str, float] = field(default_factory=dict)

    @property
    def values(self) -> np.ndarray:
        """Values of the adjustables in the revised scene."""
        return rounded(self.revised.u[: len(self.search.adjust)])

    def extra(self) -> list[tuple]:
        """(term, values) of the laws found, the apparatus left out."""
        at = len(self.search.adjust)
        result = []
        for t in self.found:
            if not t.suspect.apparatus:
                result.append((t.suspect.term, rounded(self.revised.u[at : at + t.suspect.size])))
            at += t.suspect.size
        return result

    def camera(self) -> dict[str, float]:
        return {
            name: float(self.revised.u[k]) for k, name in enumerate(self.revised.model.camera) if name is not None
        }

    def own(self, trial: Trial) -> tuple[np.ndarray, np.ndarray]:
        """A found law's numbers in the revised fit, and their covariance, widened where the fit is poor."""
        at = len(self.search.adjust)
        for t in self.found:
            if t is trial:
                break
            at += t.suspect.size
        n = trial.suspect.size
        f = self.revised
        wide = max(f.chi2 / max(f.count - len(f.u), 1), 1.0)
        student = float(stats.t.ppf(0.975, max(f.dof, 2))) / 1.96
        return f.u[at : at + n], f.covariance[at : at + n, at : at + n] * wide * student**2


def search_and_conclude(s: Search, late: Callable[[float], bool]) -> Finding:
    """All steps after the naive runs."""
    recalibrate(s)
    suspects = try_all(s)
    screen(s, suspects)
    assert s.nulls is not None
    open_ = [t for t in s.trials if not t.reason and t.gain > 0]
    if s.p_search <= 0.2 and open_ and s.sizes.more and not late(0.55):
        best = open_[0].gain
        chosen = [t.suspect for t in open_ if t.gain > 0.3 * best and not t.suspect.apparatus][:8]
        more_runs(s, chosen, 0.6)
        screen(s, suspects)
        open_ = [t for t in s.trials if not t.reason and t.gain > 0]
    if s.p_search > ALARM:
        return _without(s)
    threshold = float(np.quantile(s.nulls.best, 1 - ALARM))
    best = open_[0].gain
    # signatures are not linear: everything that comes near is refitted once, the best of those to the end
    leaders = [t for t in open_ if t.gain > 0.4 * best or (t.suspect.apparatus and t.gain > 0.2 * best)]
    leaders = leaders[: 2 * s.sizes.leaders]
    for k, t in enumerate(leaders):
        if k >= 2 and late(0.7):
            break
        _again(s, t, 0.64 + 0.08 * k / len(leaders), 1, max(s.sizes.leader // 2, 2))
    leaders = sorted((t for t in leaders if t.fit is not None), key=lambda t: -t.worth)
    settled: set[str] = set()
    dueled: set[str] = set()
    while leaders and not late(0.75):
        # whoever comes near the best has to be known as well as the best
        near = [t for t in leaders if leaders[0].worth - t.worth < 0.2 * leaders[0].worth + SAME]
        rest = [t for t in near[: s.sizes.leaders] if t.suspect.label not in settled]
        if not rest:
            break
        _again(s, rest[0], 0.72 + 0.08 * min(len(settled) / s.sizes.leaders, 1.0), 2, s.sizes.leader)
        settled.add(rest[0].suspect.label)
        leaders.sort(key=lambda t: -t.worth)
    if not leaders or leaders[0].worth < max(threshold, 8.0):
        return _without(s)
    best_one = leaders[0]
    for t in [t for t in leaders[1:3] if best_one.worth - t.worth < SAME + 2 * _noise(s, best_one, t)]:
        # the error of the simulated means is what keeps these two together: more runs of both
        for one in (best_one, t):
            if one.suspect.label not in dueled and not late(0.78):
                _again(s, one, 0.8, 1, s.sizes.duel)
                dueled.add(one.suspect.label)
    leaders.sort(key=lambda t: -t.worth)
    if leaders[0].worth < max(threshold, 8.0):
        return _without(s)
    same = [t for t in leaders if _alike(s, leaders[0], t)]
    chosen_ = min(same, key=lambda t: (t.suspect.size, not t.suspect.apparatus, -t.gain))
    found_ = [chosen_]
    revised = chosen_.fit
    assert revised is not None
    left = goodness(s, revised, len(revised.u))
    if left[0] <= ALARM and left[1] < 1e-3 and not late(0.7):
        pair = _second(s, chosen_, suspects, threshold)
        if pair is not None:
            found_, revised = pair
            left = goodness(s, revised, len(revised.u))
    rivals = [
        (t, _alike(s, chosen_, t))
        for t in leaders
        if t.suspect.name not in {f.suspect.name for f in found_} and t.gain > 0.2 * chosen_.gain
    ]
    if all(c.any_view.curve for c in s.training):
        # a few speeds say one thing only: whatever explains it to first order is of the same class
        first_order = [t for t in open_ if t.fit is None and t.gain > 0.95 * best]
        rivals += [(t, True) for t in first_order if t.suspect.name != chosen_.suspect.name]
    rivals = _once(rivals)
    excess = (revised.chi2 - revised.count) / max(s.base.chi2 - s.base.count, 1e-9)
    verdict = "measurement" if all(t.suspect.apparatus for t in found_) else "missing_physics"
    if left[0] <= ALARM and left[1] < LEFT_ALARM and excess > POOR:
        name = chosen_.suspect.name
        s.notes.append(f"the best named law, {name}, leaves {100 * excess:.0f} % of the misfit, more than packings do")
        verdict = "unmodelled"
    extra = []
    at = len(s.adjust)
    for t in found_:
        if not t.suspect.apparatus:
            extra.append((t.suspect.term, rounded(revised.u[at : at + t.suspect.size])))
        at += t.suspect.size
    label = label_of(s.adjust, rounded(revised.u[: len(s.adjust)]), extra)
    return Finding(s, verdict, found_, revised, label, False, rivals, left)


def _noise(s: Search, a: Trial, b: Trial) -> float:
    """Standard deviation of the difference of two objectives that comes from the error of their simulated means."""
    if a is b or a.fit is None or b.fit is None:
        return 0.0

    def own(t: Trial) -> float:
        assert t.fit is not None
        shares = []
        for c in s.training:
            points = t.fit.model.anchor[c.name]
            found = s.means.mean[c.name]
            # what both share, the naive runs and those of the recalibrated scene, drops out of the difference
            apart = [p for p in points if p[0] not in (NAIVE, base_point(s))]
            shares.append(sum(points[p] ** 2 / found[p][1] for p in apart))
        return float(np.mean(shares))

    left = min(a.fit.chi2, b.fit.chi2)
    return 2.0 * math.sqrt(max(left * (own(a) + own(b)), 0.0))


def _alike(s: Search, best: Trial, other: Trial) -> bool:
    """Whether these data, and the runs that were done, cannot tell the other law from the best."""
    if frozenset((best.suspect.name, other.suspect.name)) in EQUIVALENT:
        return True
    return best.worth - other.worth < SAME + _noise(s, best, other)


def _once(rivals: list[tuple[Trial, bool]]) -> list[tuple[Trial, bool]]:
    """The best of each mechanism, in order."""
    best: dict[str, tuple[Trial, bool]] = {}
    for trial, same in rivals:
        best.setdefault(trial.suspect.name, (trial, same))
    return list(best.values())


def _without(s: Search) -> Finding:
    """The verdict where no suspect is needed, or none helps."""
    left = goodness(s, s.base, len(s.base.u))
    verdict = "recalibrate" if s.adjust and s.p_recalibration <= ALARM else "no_mismatch"
    if left[0] <= ALARM and left[1] < LEFT_ALARM:
        verdict = "unmodelled"
    elif verdict == "no_mismatch" and s.p_search <= ALARM:
        verdict = "unmodelled"
        s.notes.append("the recordings ask for a law more than other packings do, but none that was tried stands")
    return Finding(s, verdict, [], s.base, base_point(s), False, [], left)


def _again(s: Search, t: Trial, share: float, rounds: int, count: int) -> None:
    """Refit a trial by simulation, from where it stands."""
    found, done, reason = refit(s, [t.suspect], share, rounds, count, t.fit)
    t.refitted += done
    if found is not None and (done or t.fit is None):
        t.fit = found
    elif found is None:
        t.reason = reason
    _level(s)


def _level(s: Search) -> None:
    """Every run tells more of the spread: base and trials are fitted again with what is known of it now."""
    s.base = fit(s.base.model, s.means, s.training)
    for t in s.trials:
        if t.fit is not None:
            t.fit = fit(t.fit.model, s.means, s.training)
            t.gain = s.base.objective - t.fit.objective


def _second(s: Search, first: Trial, suspects: list[Suspect], threshold: float) -> tuple[list[Trial], Fit] | None:
    """A second law beside the first, where it gains more than the search gains in noise."""
    assert first.fit is not None
    scored = []
    for x in suspects:
        if x.name == first.suspect.name or any(t.suspect is x and t.reason for t in s.trials):
            continue
        model = model_of(s, [first.suspect, x])
        if model is None:
            continue
        both = fit(model, s.means, s.training, rounds=6)
        scored.append((first.fit.objective - both.objective - 2 * x.size, x))
    scored.sort(key=lambda item: -item[0])
    for gain, x in scored[:2]:
        if gain < threshold + 4:
            break
        found, done, why = refit(s, [first.suspect, x], 0.8, 2)
        if found is None or why:
            continue
        gain = first.fit.objective - found.objective
        if gain - 2 * x.size > threshold + 4:
            second = Trial(x, 0.0, gain, found, done)
            known = next((t for t in s.trials if t.suspect is x), None)
            if known is not None:
                second.surviving = known.surviving
            return [replace(first, fit=found), second], found
    return None


# ---- the revised scene with its own contacts ------------------------------------------------------


def confirm(f: Finding) -> None:
    """Runs of the revised scene as it is given to the user, in all conditions; the last fit is anchored there."""
    s = f.search
    extra = f.extra()
    label = label_of(s.adjust, f.values, extra)
    count = s.sizes.final
    if label != NAIVE:
        s.runner.do(
            jobs_for(s.conditions, s.adjust, f.values, extra, count, False, label),
            lambda k, n: s.progress("revised scene in other packings", 0.82 + 0.1 * k / n),
        )
        base = base_point(s)
        only_test = [c for c in s.conditions if c.view is None]
        jobs = [
            Job(c, base, change_of(c, s.adjust, s.theta), k, True) for k in range(s.sizes.leader) for c in only_test
        ]
        s.runner.do(jobs, lambda k, n: s.progress("recalibrated scene, held-out recordings", 0.92))
        s.means.refresh()
        s.test.refresh()
    if all((label, False) in s.means.mean[c.name] for c in s.training):
        f.label, f.true = label, True
        if f.found or s.adjust:
            here = f.revised.u.copy()
            here[[k for k, name in enumerate(f.revised.model.camera) if name is None]] = np.concatenate(
                [f.values, *[values for _, values in extra]]
            )
            model = anchored(s, f.revised.model, [t.suspect for t in f.found], here, label, soft=False)
            f.revised = fit(model, s.means, s.training)
    else:
        s.notes.append("the revised scene was not run with its own contacts: the time was up")


# ---- where ------------------------------------------------------------------------------------------


def locate(f: Finding) -> list[Spot]:
    """Joints at which the bend differs, by the innovations before the missing law was added."""
    s = f.search
    base = s.naive if f.verdict == "recalibrate" else s.base
    joints: dict[int, list[tuple[float, int, int]]] = {}
    curves: dict[int, tuple[float, tuple[float, float]]] = {}
    whole = 0.0
    whole_n = 0
    for c in s.training:
        r, v = base.left[c.name]
        names = c.numbers
        if c.any_view.curve:
            whole += float(r[0] ** 2 / v[0, 0])
            whole_n += 1
            continue
        drift = [k for k, n in enumerate(names) if n.kind == "drift"]
        whole += float(r[drift] @ np.linalg.solve(v[np.ix_(drift, drift)], r[drift]))
        whole_n += len(drift)
        segments = len(c.any_view.masses) - 1
        at = {(n.kind, n.place, n.harmonic): k for k, n in enumerate(names)}
        for j in range(segments):
            rows = []
            for (kind, place, h), k in at.items():
                if place == j and kind in ("mean", "cos", "sin"):
                    row = np.zeros(len(names))
                    row[k] = 1.0
                    if j:
                        row[at[kind, j - 1, h]] = -1.0
                    rows.append((kind, h, row))
            t = np.array([row for _, _, row in rows])
            d, w = t @ r, t @ v @ t.T
            chi2 = float(d @ np.linalg.solve(w, d))
            joints.setdefault(j, []).append((chi2, len(d), s.means.dof[c.name]))
            # where in the cycle: the difference of the bend over its spread
            theta = np.linspace(0, 2 * math.pi, 72, endpoint=False)
            basis = np.array(
                [
                    np.ones_like(theta) if kind == "mean" else np.cos(h * theta) if kind == "cos" else np.sin(h * theta)
                    for kind, h, _ in rows
                ]
            )
            z = np.abs(d @ basis) / np.sqrt(np.maximum(np.einsum("ik,ij,jk->k", basis, w, basis), 1e-300))
            if j not in curves or z.max() > curves[j][0]:
                curves[j] = (float(z.max()), _arc(z))
    spots = []
    looked = len(joints) + 1
    for j, parts in joints.items():
        chi2, n = sum(p[0] for p in parts), sum(p[1] for p in parts)
        nu = max(sum(p[2] for p in parts), n + 3)
        p = min(float(stats.f.sf(chi2 * (nu - n + 1) / (nu * n), n, nu - n + 1)) * looked, 1.0)
        if p < ALARM:
            spots.append(Spot(j, normal_score(p), max(p, 1e-300), curves[j][1]))
    nu = max(sum(s.means.dof[c.name] for c in s.training), whole_n + 3)
    p = min(float(stats.f.sf(whole * (nu - whole_n + 1) / (nu * whole_n), whole_n, nu - whole_n + 1)) * looked, 1.0)
    if p < ALARM:
        spots.append(Spot(None, normal_score(p), max(p, 1e-300), None))
    spots.sort(key=lambda spot: -spot.z)
    if not spots and f.verdict not in ("no_mismatch",):
        # nothing stands out by itself: the swimmer as a whole
        p = max(f.search.p_search if f.found else f.search.p_recalibration, 1e-300)
        spots.append(Spot(None, float(stats.norm.isf(min(p, 0.5))), p, None))
    return spots


def _arc(z: np.ndarray) -> tuple[float, float]:
    """The part of the cycle (0..1) around the maximum in which z stays above half of it."""
    n = len(z)
    top = int(np.argmax(z))
    high = z > 0.5 * z[top]
    if high.all():
        return 0.0, 1.0
    first = last = top
    while high[(first - 1) % n]:
        first -= 1
    while high[(last + 1) % n]:
        last += 1
    return (first % n) / n, ((last + 1) % n) / n


# ---- errors -------------------------------------------------------------------------------------------


def score(f: Finding) -> None:
    """Errors of naive, recalibrated and revised scene in metres, on what was fitted and on what was held out."""
    s = f.search
    f.train, _ = _errors(f, s.means, s.training)
    f.held, f.gain_held = _errors(f, s.test, s.testing)


def prediction(f: Finding, means: Means, c: Condition, which: str) -> tuple[np.ndarray, float] | None:
    """Numbers predicted by "naive", "recalibrated" or "revised"; None where such a scene was not run there."""
    s = f.search
    base = base_point(s)
    naive = {(NAIVE, False): 1.0}
    recalibrated = add((1.0, naive), (1.0, {(base, True): 1.0}), (-1.0, {(NAIVE, True): 1.0}))
    try:
        if which == "naive":
            return means.predict(c, naive)
        if which == "recalibrated":
            if means is s.means:
                return s.base.model.predict(means, c, s.base.u)
            if not f.found and f.true:
                return means.predict(c, {(f.label, False): 1.0})
            return means.predict(c, recalibrated)
        if means is s.means:
            return f.revised.model.predict(means, c, f.revised.u)
        if not f.found and not f.true:
            return means.predict(c, recalibrated)
        mean, variance = means.predict(c, {(f.label, False): 1.0} if f.true else recalibrated)
        view = means.view(c)
        return view.filmed(mean, **f.camera()), variance
    except KeyError:
        return None


def _errors(f: Finding, means: Means, conditions: list[Condition]) -> tuple[dict[str, float | None], float | None]:
    s = f.search
    tracked = [c for c in conditions if not c.any_view.curve]
    result: dict[str, float | None] = {}
    gain = None
    objectives: dict[str, float] = {}
    for which in ("naive", "recalibrated", "revised"):
        squares: list[float] = []
        total: float | None = 0.0
        for c in conditions:
            predicted = prediction(f, means, c, which)
            if predicted is None:
                total = None
                squares = []
                break
            seen = c.seen_test if means.test else c.seen
            error = c.error_test if means.test else c.error
            v = spread_of(means, c, predicted[1], error)
            r = seen - predicted[0]
            assert total is not None
            total += float(r @ np.linalg.solve(v, r)) + float(np.linalg.slogdet(v)[1])
            if c in tracked:
                squares.append(means.view(c).distance(seen, predicted[0]) ** 2)
        result[which] = float(np.sqrt(np.mean(squares))) if squares else None
        if total is not None and conditions:
            objectives[which] = total
    if "recalibrated" in objectives and "revised" in objectives:
        gain = 0.5 * (objectives["recalibrated"] - objectives["revised"])
    # what perfect physics leaves: one packing against the mean of the others, with tracking noise
    floors = []
    for c in tracked:
        view: View = means.view(c)
        runs = s.runner.values(c, f.label, False) if f.true else None
        if runs is None:
            runs = s.runner.values(c, NAIVE, False)
        if runs is None or len(runs) < 2:
            continue
        error = c.error_test if means.test else c.error
        y = np.array([view.observe(xy) for xy in runs])
        shaken = y + s.rng.multivariate_normal(np.zeros(y.shape[1]), error, size=len(y), method="eigh")
        for k in range(len(y)):
            floors.append(view.distance(shaken[k], np.delete(y, k, axis=0).mean(axis=0)) ** 2)
    result["noise_floor"] = float(np.sqrt(np.mean(floors))) if floors else None
    return result, gain


# ---- the next experiment --------------------------------------------------------------------------------


def propose(f: Finding) -> None:
    """Which one recording more separates the winner from its nearest rival, the rival refitted to all.

    d' is the square root of what the refitted rival keeps of chi2 in that recording (T-optimality: Atkinson &
    Fedorov 1975, Biometrika 62, 57); the candidates are repeats of what was recorded, and tracks where there
    were only speeds.
    """
    s = f.search
    if not f.found or not f.rivals or f.verdict == "unmodelled":
        return
    winner = f.found[0]
    rival = next((t for t, same in f.rivals if same), f.rivals[0][0])
    names = [winner.suspect.name, rival.suspect.name]
    pair = set(names)
    if rival.fit is None or winner.fit is None:
        return
    tools = {
        "time_offset": ("camera.time_offset", "film a flash that the motor triggers"),
        "camera_scale": ("camera.scale", "film a ruler in the same picture"),
        "camera_tilt": ("camera.tilt", "film a plumb line in the same picture"),
    }
    if pair & set(tools) and pair & {"actuator_delay", "actuator_lag", "camera_scale", "camera_tilt"}:
        tool = next(t for t in (winner, rival) if t.suspect.name in tools)
        name = tool.suspect.name
        change = abs(float(tool.values()[0]) - tool.suspect.neutral[0])
        case = s.training[0]
        view = case.any_view
        if name == "time_offset":
            resolution = 0.3 * float(np.median(np.diff(view.t)))
        else:
            noise = math.sqrt(max(float(case.error[-1, -1]), 1e-14))
            resolution = max(noise / 3e-3, 1e-4)
        f.proposal = (tools[name][1], names, change / resolution)
        return
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
    if best is not None:
        d, text = best
        if d < 2:
            many = math.ceil(4 / max(d, 0.1) ** 2)
            text += f"; about {many} of them make d' 2"
        f.proposal = (text, names, d)


def _tracked(c: Condition) -> Condition:
    """A curve's condition as if the swimmer had been filmed for as long."""
    view = replace(c.any_view, curve=False)
    p = len(view.numbers())
    # 20 micrometres on 250 frames and more: far below what packings do; angles to 1e-3 rad, places to 4e-6 m
    error = np.diag([1e-6 if n.unit == "rad" else 1.6e-11 if n.unit == "m" else 1e-8 for n in view.numbers()])
    return replace(c, view=view, seen=np.zeros(p), error=error, averaged=False)

