"""The search: recalibrate, run all candidates, hold signatures against innovations, refit leaders by simulation."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np
from scipy import stats

from ...errors import InputError
from ...scene import Scene
from ..criteria import current
from ..hypothesis import NO_CAMERA, Term, adjustable_terms
from ..significance import rank
from .candidates import Candidate, candidates_of
from .response import Fit, Means, Model, Sum, add, fit
from .runs import Change, Job, Runner
from .summaries import Condition, Shim

NAIVE = "naive"

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Sizes:
    """How many packings are run of each kind, for every recording; see ``planned_sizes``."""

    true: int = 8  # of the naive scene with its own contacts
    soft: int = 20  # of the naive scene with softer ones: the spread needs them
    adjustable: int = 4
    screen: int = 1  # of every candidate
    more: int = 3  # beside those, of the candidates in question
    leader: int = 6  # at a leader's fitted amount
    final: int = 4  # of the revised scene with its own contacts
    leaders: int = 5
    duel: int = 12  # of the best two, where they are near each other
    spread: int = 0  # of the naive scene in all training films together, where ``soft`` are fewer

    def times(self, factor: float) -> Sizes:
        """More, or fewer, of everything."""
        least = {"true": 3, "soft": 3, "adjustable": 2, "leader": 2, "final": 2, "leaders": 3, "duel": 4, "screen": 1}
        return replace(self, **{
            f.name: max(round(getattr(self, f.name) * (min(factor, 1.2) if f.name == "leaders" else factor)),
                        least.get(f.name, 0))
            for f in fields(self) if f.name != "spread"
        })  # fmt: skip


@dataclass
class Trial:
    """A candidate after its fit. ``gain``: fall of the objective;  ``reason``: why it was not fitted, if so."""

    candidate: Candidate
    surviving: float
    gain: float
    fit: Fit | None = None
    refitted: int = 0
    reason: str = ""

    @property
    def mechanism(self) -> str:
        return self.candidate.name

    @property
    def label(self) -> str:
        return self.candidate.label

    @property
    def worth(self) -> float:
        return self.gain - 2 * self.candidate.size

    def values(self) -> np.ndarray:
        """(k,) the candidate's own numbers, those of the recalibration left out."""
        assert self.fit is not None
        return self.fit.u[-self.candidate.size :]


@dataclass
class Nulls:
    """What the search finds in simulated recordings of the recalibrated physics in other packings."""

    chi2: np.ndarray  # (r,) of the naive or recalibrated prediction
    recalibration: np.ndarray  # (r,) gain of the adjustables
    best: np.ndarray  # (r,) the best worth of all candidates
    left: np.ndarray  # (r,) chi2 after recalibration
    drawn: np.ndarray  # (r, n) whitened innovations


@dataclass
class Search:
    """Everything that the search knows."""

    conditions: list[Condition]
    runner: Runner
    sizes: Sizes
    rng: np.random.Generator
    progress: Progress
    means: Means
    test: Means
    adjust: tuple[Term, ...]
    theta: np.ndarray
    naive: Fit
    base: Fit
    trials: list[Trial] = field(default_factory=list)
    nulls: Nulls | None = None
    notes: list[str] = field(default_factory=list)
    p_recalibration: float = 1.0
    p_search: float = 1.0

    @property
    def training(self) -> list[Condition]:
        return [c for c in self.conditions if c.view is not None]

    @property
    def testing(self) -> list[Condition]:
        return [c for c in self.conditions if c.test is not None]


# ---- scenes ------------------------------------------------------------------------------------


def bears_on(term: Term, condition: Condition) -> bool:
    return not term.free or any(f.cases is None or condition.recording.name in f.cases for f in term.free)


def change_of(
    condition: Condition, adjust: Sequence[Term], theta: Sequence[float] | np.ndarray,
    extra: Sequence[tuple[Term, np.ndarray]] = (),
) -> Change:  # fmt: skip
    """The scene's change under values of the adjustables and of further terms."""

    def change(scene: Scene) -> Scene:
        for term, value in zip(adjust, theta, strict=True):
            if bears_on(term, condition):
                scene, _ = term.apply(scene, NO_CAMERA, [float(value)])
        for term, values in extra:
            if bears_on(term, condition):
                scene, _ = term.apply(scene, NO_CAMERA, values)
        return scene

    return change


def label_of(
    adjust: Sequence[Term], theta: Sequence[float] | np.ndarray, extra: Sequence[tuple[Term, np.ndarray]] = ()
) -> str:
    parts = [f"{t.label}={v:.9g}" for t, v in zip(adjust, theta, strict=True)]
    parts += [f"{t.label}({', '.join(f'{v:.9g}' for v in values)})" for t, values in extra]
    return "; ".join(parts) or NAIVE


def jobs_for(
    conditions: Sequence[Condition], adjust: Sequence[Term], theta: np.ndarray,
    extra: Sequence[tuple[Term, np.ndarray]], count: int, soft: bool, label: str | None = None,
) -> list[Job]:  # fmt: skip
    name = label or label_of(adjust, theta, extra)
    return [Job(c, name, change_of(c, adjust, theta, extra), k, soft) for k in range(count) for c in conditions]


# ---- the steps ---------------------------------------------------------------------------------


def begin(
    conditions: list[Condition], runner: Runner, sizes: Sizes, rng: np.random.Generator, progress: Progress
) -> Search:
    """Naive runs of all conditions, and how far off they are."""
    recordings = {c.recording.name: c.recording for c in conditions}
    adjust = adjustable_terms([Shim(r) for r in recordings.values()])  # type: ignore[misc]
    theta = np.array([t.free[0].first for t in adjust])
    means = Means(runner, [c for c in conditions if c.view is not None])
    test = Means(runner, [c for c in conditions if c.test is not None], test=True)
    training = [c for c in conditions if c.view is not None]
    only_test = [c for c in conditions if c.view is None]
    jobs = jobs_for(training, (), np.zeros(0), (), sizes.true, False, NAIVE)
    jobs += jobs_for(training, (), np.zeros(0), (), sizes.soft, True, NAIVE)
    for k in range(sizes.soft, -(-sizes.spread // len(training))):
        jobs += [Job(c, NAIVE, lambda scene: scene, k, True, part=True) for c in training]
    jobs += jobs_for(only_test, (), np.zeros(0), (), max(sizes.true // 2, 3), False, NAIVE)
    jobs += jobs_for(only_test, (), np.zeros(0), (), max(sizes.soft // 2, 3), True, NAIVE)
    runner.do(jobs, lambda k, n: progress("naive scene in other packings", 0.02 + 0.18 * k / n))
    for c in conditions:
        for soft in (False, True):
            if len(runner.tracks.get((c.name, NAIVE, soft), {})) < 2 or (c.name, NAIVE, soft) in runner.failures:
                why = runner.reason(NAIVE, soft)
                raise InputError(f"the naive scene could not be run: {why}", file=c.recording.folder, where=c.name)
    means.refresh()
    test.refresh()
    model = Model("naive", (), np.zeros(0), {c.name: {(NAIVE, False): 1.0} for c in conditions}, (), ())
    naive = fit(model, means, training)
    return Search(conditions, runner, sizes, rng, progress, means, test, adjust, theta, naive, naive)


def recalibrate(s: Search) -> None:
    """Gauss-Newton on simulated differences; the adjustables' slopes are taken once, the anchor follows."""
    if not s.adjust:
        return
    first = s.theta.copy()
    steps = []
    for k, term in enumerate(s.adjust):
        f = term.free[0]
        step = 0.15 * (f.high - f.low)
        steps.append(step if f.high - first[k] > first[k] - f.low else -step)
    jobs = []
    points = []
    for k, term in enumerate(s.adjust):
        theta = first.copy()
        theta[k] += steps[k]
        where = [c for c in s.conditions if bears_on(term, c)]
        jobs += jobs_for(where, s.adjust, theta, (), s.sizes.adjustable, True)
        points.append(label_of(s.adjust, theta))
    s.runner.do(jobs, lambda k, n: s.progress("recalibrating", 0.2 + 0.06 * k / n))
    s.means.refresh()
    s.test.refresh()
    slopes = []
    for k, term in enumerate(s.adjust):
        slope: dict[str, Sum] = {}
        for c in s.conditions:
            if bears_on(term, c) and (c.name, points[k], True) not in s.runner.failures:
                slope[c.name] = {(points[k], True): 1 / steps[k], (NAIVE, True): -1 / steps[k]}
        slopes.append(slope)
    free = tuple(
        replace(t.free[0], scale=abs(step), first=float(v)) for t, step, v in zip(s.adjust, steps, first, strict=True)
    )
    anchor: dict[str, Sum] = {c.name: {(NAIVE, False): 1.0} for c in s.conditions}
    model = Model("recalibrated", free, first, anchor, tuple(slopes), (None,) * len(free))
    s.base = fit(model, s.means, s.training)
    for _ in range(3):
        moved = np.abs(s.base.u - s.base.model.centre) / np.abs(steps)
        sigma = np.sqrt(np.diag(s.base.covariance)) / np.abs(steps)
        if not np.any((moved > 0.25) & (moved > 0.5 * sigma)):
            break
        theta = rounded(s.base.u)
        label = label_of(s.adjust, theta)
        s.runner.do(
            jobs_for(s.conditions, s.adjust, theta, (), s.sizes.soft, True),
            lambda k, n: s.progress("recalibrated scene in other packings", 0.26 + 0.04 * k / n),
        )
        s.means.refresh()
        s.test.refresh()
        if any((label, True) not in s.means.mean[c.name] for c in s.training):
            s.notes.append("recalibration stopped early: a recalibrated scene could not be run")
            break
        anchor = {
            c.name: add((1.0, {(NAIVE, False): 1.0}), (1.0, {(label, True): 1.0}), (-1.0, {(NAIVE, True): 1.0}))
            for c in s.conditions
        }
        s.base = fit(replace(model, centre=theta, anchor=anchor), s.means, s.training)
    s.theta = s.base.model.centre.copy()


def base_point(s: Search) -> str:
    """Label of the soft runs of the recalibrated scene."""
    if not s.adjust or np.allclose(s.theta, [t.free[0].first for t in s.adjust]):
        return NAIVE
    return label_of(s.adjust, s.theta)


def amount_label(x: Candidate, row: np.ndarray) -> str:
    """Label of the runs of a candidate in the naive scene, at one of the points of its design."""
    return label_of((), (), [(x.term, x.neutral + row)])


def amount_jobs(
    x: Candidate, row: np.ndarray, conditions: Sequence[Condition], packings: Sequence[int], part: bool = True
) -> list[Job]:
    """Runs of a candidate in the naive scene; ``part``: see ``Job``."""
    extra = [(x.term, x.neutral + row)]
    label = amount_label(x, row)
    return [
        Job(c, label, change_of(c, (), (), extra), k, True, part)
        for k in packings for c in conditions if bears_on(x.term, c)
    ]  # fmt: skip


# of a candidate's shift, in what two packings differ by: where it is r, its direction is known to a cosine of
# sqrt(1 - 1/r^2), 0.87 at the least
LEAST_SHOWN, MOST_SHOWN, WANTED = 2.0, 9.0, 4.0


@dataclass
class Amount:
    """The search for an amount of a candidate that shows, in units of its first one.

    tried : shift at each amount, infinite where the run did not survive it;  factor : what is tried next
    other : what is tried after the first, where that did not show or overturned everything
    """

    factor: float = 1.0
    other: float | None = None
    tried: dict[float, float] = field(default_factory=dict)
    settled: bool = False

    def add(self, size: float, at_bound: bool) -> None:
        """Take in the shift at ``factor``. Once one was too small and another too large, the next lies between."""
        self.tried[self.factor] = size
        small = max((f for f, r in self.tried.items() if r < LEAST_SHOWN), default=None)
        large = min((f for f, r in self.tried.items() if r > MOST_SHOWN), default=None)
        self.settled = LEAST_SHOWN <= size <= MOST_SHOWN or (size < LEAST_SHOWN and at_bound)
        if self.other is not None:
            self.factor, self.other = self.other, None
        elif small is not None and large is not None:
            self.factor = self._rounded(math.sqrt(small * large))
        elif size < LEAST_SHOWN:
            self.factor *= 6.0
        else:
            self.factor = self._rounded(self.factor * (WANTED / size if math.isfinite(size) else 0.2))

    def _rounded(self, factor: float) -> float:
        """To a power of two, where that was not tried: other recordings of the same bed then share these runs."""
        near = 2.0 ** round(math.log2(factor))
        return factor if near in self.tried else near

    @property
    def best(self) -> float | None:
        """The amount whose shift is nearest to what is wanted, None where no run survived."""
        alive = {f: max(r, 1e-6) for f, r in self.tried.items() if math.isfinite(r)}
        return min(alive, key=lambda f: abs(math.log(alive[f] / WANTED)), default=None)


def scaled_candidates(s: Search) -> list[Candidate]:
    """All candidates at amounts that show in the first recording and do not overturn everything there."""
    every = candidates_of(s.training)
    adjustable = {t.label for t in s.adjust}
    every = [x for x in every if not any(f.name in adjustable for f in x.term.free)]
    physical = [x for x in every if not x.apparatus]
    probe = s.training[0]
    chance = math.sqrt(2.0 * len(probe.numbers))
    covariance = s.means.covariance[probe.name]
    amounts = {x.label: Amount(other=x.other) for x in physical}
    for attempt in range(current().packings.probes):
        trying = [(x, x.scaled(amounts[x.label].factor)) for x in physical if not amounts[x.label].settled]
        if not trying:
            break
        jobs = [j for _, scaled in trying for j in amount_jobs(scaled, scaled.design[0], [probe], [0])]
        begun = 0.26 + 0.015 * attempt
        s.runner.do(jobs, lambda k, n, at=begun: s.progress("trying the candidates", at + 0.015 * k / n))  # type: ignore[misc]
        s.means.refresh()
        for x, scaled in trying:
            found = s.means.mean[probe.name].get((amount_label(scaled, scaled.design[0]), True))
            size = math.inf
            if found is not None:
                shift = found[0] - s.means.mean[probe.name][NAIVE, True][0]
                size = math.sqrt(float(shift @ np.linalg.solve(covariance, shift))) / chance
            bigger = x.scaled(2 * amounts[x.label].factor)
            amounts[x.label].add(size, np.allclose(bigger.design, scaled.design))
    settled = {label: a.best for label, a in amounts.items() if a.best is not None}
    for x in physical:
        if x.label not in settled:
            why = s.runner.reason(amount_label(x, x.design[0])) or "no amount that was tried could be run"
            s.trials.append(Trial(x, 0.0, 0.0, None, 0, why))
    result = [x for x in every if x.apparatus]
    return result + [x.scaled(settled[x.label]) for x in physical if x.label in settled]


def try_all(s: Search) -> list[Candidate]:
    """Runs of every candidate in the naive scene: what it changes there is its signature."""
    result = scaled_candidates(s)
    jobs = [
        j for x in result if not x.apparatus for row in x.design
        for j in amount_jobs(x, row, s.training, range(s.sizes.screen))
    ]  # fmt: skip
    s.runner.do(jobs, lambda k, n: s.progress("signatures of the candidates", 0.34 + 0.26 * k / n))
    s.means.refresh()
    return result


def model_of(s: Search, candidates: Sequence[Candidate]) -> Model | None:
    """The recalibrated model with these candidates added, linear through their first points; None where not run."""
    base = s.base.model
    anchor = {c.name: base.sums(c.name, s.base.u) for c in s.training}
    model = Model(" + ".join(x.label for x in candidates), base.free, s.base.u.copy(), anchor, base.slopes, base.camera)
    for x in candidates:
        points = [amount_label(x, row) for row in x.design]
        if any((p, True) not in s.means.mean[c.name] for p in points for c in s.training if bears_on(x.term, c)):
            return None
        model = extended(s, model, x, model.centre)
    return model


def extended(s: Search, model: Model, x: Candidate, u: np.ndarray) -> Model:
    """A model with one more candidate, absent at its centre; ``u``: the values of the others there.

    Slopes are those of the naive scene: differences of soft runs, so that softness drops out.
    """
    free, slopes, camera = list(model.free), list(model.slopes), list(model.camera)
    if x.apparatus:
        free.append(x.term.free[0])
        slopes.append({})
        camera.append(x.term.free[0].name.removeprefix("camera."))
    else:
        inverse = np.linalg.inv(x.design)
        points = [amount_label(x, row) for row in x.design]
        for k, f in enumerate(x.term.free):
            # du_k: sum over the points of inverse[k, i] (mean_i - naive)
            slopes.append({
                c.name: add(*[
                    (float(inverse[k, i]), {(p, True): 1.0, (NAIVE, True): -1.0}) for i, p in enumerate(points)
                ])
                for c in s.training if bears_on(x.term, c)
            })  # fmt: skip
            free.append(replace(f, scale=float(np.abs(x.design[:, k]).max())))
            camera.append(None)
    centre = np.concatenate([u, x.neutral])
    anchor = {c.name: model.sums(c.name, u) for c in s.training}
    return Model(f"{model.name} + {x.label}", tuple(free), centre, anchor, tuple(slopes), tuple(camera))


@dataclass
class Bank:
    """Whitened signatures around the recalibrated fit."""

    factors: dict[str, np.ndarray]
    left: np.ndarray
    adjust: np.ndarray  # orthonormal basis of the adjustables
    columns: dict[str, np.ndarray]  # of each candidate, adjustables projected out
    directions: dict[str, np.ndarray]  # orthonormal
    signs: dict[str, tuple[float, float]]  # of single numbers: on which side of neutral there is room
    surviving: dict[str, float]
    visible: dict[str, float]


def bank_of(s: Search, candidates: Sequence[Candidate]) -> Bank:
    factors, left = {}, []
    for c in s.training:
        r, v = s.base.left[c.name]
        factors[c.name] = np.linalg.cholesky(v)
        left.append(np.linalg.solve(factors[c.name], r))
    r = np.concatenate(left)
    adjust = np.zeros((len(r), 0))
    if s.base.model.free:
        adjust = _basis(columns_of(s, s.base.model, s.base.u, factors))
    bank = Bank(factors, r, adjust, {}, {}, {}, {}, {})
    n = len(s.base.u)
    for x in candidates:
        model = model_of(s, [x])
        if model is None:
            continue
        a = columns_of(s, model, model.centre, factors)[:, n:]
        after = a - adjust @ (adjust.T @ a)
        scale = np.array([f.scale for f in model.free[n:]])
        before, behind = float(np.linalg.norm(a * scale)), float(np.linalg.norm(after * scale))
        bank.columns[x.label] = after
        bank.directions[x.label] = _basis(after * scale)
        bank.surviving[x.label] = behind / before if before > 0 else 0.0
        # how long a signature of nothing would be: the noise of the means that it is made of
        noise = 0.0
        for c in s.training:
            for k in range(n, len(model.free)):
                total = model.slopes[k].get(c.name, {})
                variance = sum(q * q / s.means.mean[c.name][p][1] for p, q in total.items())
                solved = np.linalg.solve(factors[c.name], s.means.covariance[c.name])
                size = float(np.trace(np.linalg.solve(factors[c.name], solved.T)))
                noise += variance * size * model.free[k].scale ** 2
        bank.visible[x.label] = before / math.sqrt(noise) if noise > 0 else math.inf
        f = x.term.free[0]
        bank.signs[x.label] = (f.low - f.neutral, f.high - f.neutral)
    return bank


def gains(bank: Bank, candidate: Candidate, r: np.ndarray) -> np.ndarray:
    """(k,) fall in chi2 for innovations r (n, k), adjustables refitted; none on the side that a bound forbids."""
    left = r - bank.adjust @ (bank.adjust.T @ r)
    directions = bank.directions[candidate.label]
    if not directions.shape[1]:
        return np.zeros(r.shape[1])
    found: np.ndarray = np.sum((directions.T @ left) ** 2, axis=0)
    if candidate.size == 1:
        amount = bank.columns[candidate.label][:, 0] @ left
        low, high = bank.signs[candidate.label]
        found = np.where(((amount > 0) & (high <= 0)) | ((amount < 0) & (low >= 0)), 0.0, found)
    return found


def _basis(a: np.ndarray) -> np.ndarray:
    u, w, _ = np.linalg.svd(a, full_matrices=False)
    return u[:, w > 1e-8 * max(w[0], 1e-300)] if len(w) else u


def columns_of(s: Search, model: Model, u: np.ndarray, factors: Mapping[str, np.ndarray]) -> np.ndarray:
    """(n, k) whitened derivatives of the prediction by the model's numbers."""
    blocks = []
    for c in s.training:
        base, _ = model.predict(s.means, c, u)
        columns = []
        for k, f in enumerate(model.free):
            step = 0.05 * f.scale * (-1.0 if u[k] + 0.05 * f.scale > f.high else 1.0)
            moved = u.copy()
            moved[k] += step
            columns.append((model.predict(s.means, c, moved)[0] - base) / step)
        blocks.append(np.linalg.solve(factors[c.name], np.array(columns).T))
    return np.concatenate(blocks)


def draw_nulls(s: Search, bank: Bank, candidates: Sequence[Candidate]) -> Nulls:
    """Runs seen as if they were the recording: what two packings do, mixed in a random proportion, and tracking noise.

    Mixing a cos + b sin of two runs' deviations keeps their covariance, and makes more replicates than there are
    runs. Where there are several recordings each gets its own.
    """
    replicates = current().packings.replicates
    drawn = []
    for c in s.training:
        residuals = s.means.residuals[c.name]
        _, variance = s.base.model.predict(s.means, c, s.base.u)
        own = (0.0 if c.averaged else 1.0) + variance
        # a recording took no part in the estimate of the spread by which it is weighed; these runs did
        own *= s.means.inflation[c.name]
        first, second = s.rng.integers(len(residuals), size=(2, replicates))
        turn = s.rng.uniform(0.0, 2 * math.pi, (replicates, 1))
        chosen = (residuals[first] * np.cos(turn) + residuals[second] * np.sin(turn)) * math.sqrt(own)
        if np.any(np.diag(c.error) > 0):
            values, vectors = np.linalg.eigh(c.error)
            chosen = chosen + (s.rng.normal(size=chosen.shape) * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
        drawn.append(np.linalg.solve(bank.factors[c.name], chosen.T))
    r = np.concatenate(drawn)
    alive = [x for x in candidates if counts(bank, x)]
    best = np.zeros(replicates)
    for x in alive:
        best = np.maximum(best, gains(bank, x, r) - 2 * (x.size - 1))
    along = np.sum((bank.adjust.T @ r) ** 2, axis=0) if bank.adjust.shape[1] else np.zeros(replicates)
    whole = np.sum(r**2, axis=0)
    return Nulls(whole, along, best, whole - along, r.T)


def counts(bank: Bank, x: Candidate) -> bool:
    criteria = current().packings
    there = x.label in bank.directions and bank.surviving[x.label] > criteria.survives
    return there and bank.visible[x.label] > criteria.visible


def screen(s: Search, candidates: Sequence[Candidate]) -> Bank:
    """First-order gains of all candidates, and the nulls of that search."""
    # the spread is better known now than before the candidates were run
    s.naive = fit(s.naive.model, s.means, s.training)
    s.base = fit(s.base.model, s.means, s.training) if s.adjust else s.naive
    bank = bank_of(s, candidates)
    s.trials = [t for t in s.trials if t.reason and not t.fit and t.candidate.label not in bank.directions]
    for x in candidates:
        if x.label not in bank.directions:
            s.trials.append(Trial(x, 0.0, 0.0, None, 0, "not run everywhere"))
            continue
        reason = ""
        if bank.surviving[x.label] <= current().packings.survives:
            reason = "recalibration imitates it"
        elif bank.visible[x.label] <= current().packings.visible:
            reason = "no amount of it shows in these recordings"
        gain = 0.0 if reason else float(gains(bank, x, bank.left[:, None])[0])
        s.trials.append(Trial(x, bank.surviving[x.label], gain, None, 0, reason))
    s.nulls = draw_nulls(s, bank, candidates)
    apart = np.concatenate([np.linalg.solve(bank.factors[c.name], s.naive.left[c.name][0]) for c in s.training])
    along = bank.adjust.T @ apart
    s.p_recalibration = rank(float(along @ along), s.nulls.recalibration) if s.adjust else 1.0
    top = max((t.gain - 2 * (t.candidate.size - 1) for t in s.trials if not t.reason), default=0.0)
    s.p_search = rank(top, s.nulls.best)
    s.trials.sort(key=lambda t: -t.worth)
    return bank


def more_runs(s: Search, chosen: Sequence[Candidate], share: float) -> None:
    """Sharper signatures of those that are still in question."""
    packings = range(s.sizes.screen, s.sizes.screen + s.sizes.more)
    jobs = [j for x in chosen for row in x.design for j in amount_jobs(x, row, s.training, packings)]
    s.runner.do(jobs, lambda k, n: s.progress("sharper signatures of the best", share + 0.04 * k / n))
    s.means.refresh()


def refit(
    s: Search, candidates: Sequence[Candidate], share: float, rounds: int = 2, count: int | None = None,
    start: Fit | None = None,
) -> tuple[Fit | None, int, str]:  # fmt: skip
    """Fit candidates by simulation: run at the fitted numbers, put the anchor there, fit again.

    The slope of a single number becomes the chord from its absence to where it was run, see ``run_at``. ``count`` runs
    a condition; ``start``: an earlier fit of the same candidates to go on from.
    """
    model = model_of(s, candidates) if start is None else start.model
    if model is None:
        return None, 0, "not run everywhere"
    found = fit(model, s.means, s.training, start=None if start is None else start.u)
    physical = [x for x in candidates if not x.apparatus]
    if not physical:
        return found, 1, ""
    n = len(s.base.u)
    done = 0
    for _ in range(rounds):
        extra = []
        at = n
        here = rounded(run_at(s, found, candidates))
        for x in candidates:
            if not x.apparatus:
                extra.append((x.term, here[at : at + x.size].copy()))
            at += x.size
        theta = here[:n].copy()
        label = label_of(s.adjust, theta, extra)
        s.runner.do(
            jobs_for(s.training, s.adjust, theta, extra, count or s.sizes.leader, True),
            lambda k, m: s.progress(f"refitting {candidates[-1].label}", share),
        )
        s.means.refresh()
        if any((label, True) not in s.means.mean[c.name] for c in s.training):
            return found, done, s.runner.reason(label)
        done += 1
        model = anchored(s, model, candidates, here, label)
        before = found.u
        found = fit(model, s.means, s.training)
        wide = np.sqrt(np.maximum(np.diag(found.covariance), 0.0))
        if arrived(np.abs(found.u - before), wide, before - _absent(s, candidates)):
            break
    return found, done, ""


def arrived(off: np.ndarray, wide: np.ndarray, away: np.ndarray) -> bool:
    """Whether numbers that are ``off`` by so much need no other run: little beside their errors, or what they are."""
    errors, share = current().packings.settled
    return bool(np.all(off <= np.maximum(errors * wide, share * np.abs(away))))


def run_at(s: Search, found: Fit, candidates: Sequence[Candidate]) -> np.ndarray:
    """Where candidates are run to be known near the fitted numbers.

    Of a single number r spreads strong, the mean of n runs at a times it gives the chord with an error of 1/(a sqrt(n))
    where at the number itself it is 1/sqrt(n): a weak law is run where it shows, as far as its first runs went.
    """
    (x, *more), u = candidates, found.u.copy()
    n = len(s.base.u)
    if more or x.apparatus or x.size != 1:
        return u
    absent = u.copy()
    absent[n] = x.neutral[0]
    size = []
    for c in s.training:
        change = found.model.predict(s.means, c, u)[0] - found.model.predict(s.means, c, absent)[0]
        size.append(float(change @ np.linalg.solve(s.means.covariance[c.name], change)) / (2.0 * len(change)))
    shift = math.sqrt(max(float(np.mean(size)), 1e-12))
    first = abs(float(x.design[0, 0]) / (u[n] - absent[n])) if u[n] != absent[n] else 1.0
    u[n] = absent[n] + (u[n] - absent[n]) * max(min(LEAST_SHOWN / shift, first), 1.0)
    return u


def rounded(u: np.ndarray) -> np.ndarray:
    """To four digits: a scene that is run again after an interruption is the same scene."""
    return np.array([float(f"{v:.4g}") for v in u])


def _absent(s: Search, candidates: Sequence[Candidate]) -> np.ndarray:
    return np.concatenate([np.zeros(len(s.base.u)), *[x.neutral for x in candidates]])


def stiffer(s: Search, model: Model, u: np.ndarray, label: str) -> float:
    """By what factor contacts as they are change the numbers more than softer ones say, at u, where ``label`` is run.

    Softness drops out of differences to first order only. The regression of the change seen with the scene's own
    contacts on that which the model tells, in units of the spread, the noise of the latter taken off; drawn towards 1
    by its own error (James & Stein 1961), so that a weak law leaves it there.
    """
    along = size = error = 0.0
    for c in s.training:
        told = add((1.0, model.sums(c.name, u)), (-1.0, {(NAIVE, False): 1.0}))
        (a, va), (b, vb) = (s.means.predict(c, p) for p in (told, {(label, False): 1.0, (NAIVE, False): -1.0}))
        factor = np.linalg.cholesky(s.means.covariance[c.name])
        a, b = np.linalg.solve(factor, a), np.linalg.solve(factor, b)
        along, size, error = along + float(a @ b), size + float(a @ a) - va * len(a), error + (va + vb) * float(a @ a)
    if size <= 0 or label == NAIVE:
        return 1.0
    off, wide = along / size - 1, error / size**2
    return 1 + off * max(1 - wide / off**2, 0.0) if off else 1.0


def anchored(
    s: Search, model: Model, candidates: Sequence[Candidate], u: np.ndarray, label: str, soft: bool = True
) -> Model:
    """The model with its anchor in runs at u; the chord replaces the slope of a single physical number.

    Runs with the contacts as they are (not ``soft``) are joined with what the model says there, each by its variance;
    changes by softer contacts are first put right by ``stiffer``.
    """
    n = len(s.base.u)
    anchor = {}
    slopes = list(model.slopes)
    physical = [k for k in range(n, len(u)) if model.camera[k] is None]
    more = 1.0 if soft else stiffer(s, model, u, label)
    for c in s.training:
        if soft:
            here = add((1.0, {(NAIVE, False): 1.0}), (1.0, {(label, True): 1.0}), (-1.0, {(NAIVE, True): 1.0}))
        else:
            known = add((more, model.sums(c.name, u)), (1 - more, {(NAIVE, False): 1.0}))
            here = {(label, False): 1.0}
            own, other = (s.means.predict(c, points)[1] for points in (here, known))
            here = add((other / (own + other), here), (own / (own + other), known)) if own + other > 0 else here
        anchor[c.name] = here
    if not soft:
        slopes = [{name: add((more, slope)) for name, slope in by_name.items()} for by_name in slopes]
    if len(physical) == 1 and soft:
        k = physical[0]
        amount = u[k] - model.free[k].neutral
        if abs(amount) > 0.1 * model.free[k].scale:
            # the chord from the recalibrated scene without the law to the one with it
            chord = {
                c.name: add((1 / amount, anchor[c.name]), (-1 / amount, s.base.model.sums(c.name, u[:n])))
                for c in s.training if c.name in model.slopes[k]
            }  # fmt: skip
            slopes[k] = chord
            free = list(model.free)
            free[k] = replace(free[k], scale=abs(amount))
            model = replace(model, free=tuple(free))
    return replace(model, centre=u.copy(), anchor=anchor, slopes=tuple(slopes))


def goodness(s: Search, found: Fit, free_numbers: int, wilder: float = 1.0) -> tuple[float, float]:
    """Two p-values of what a fit leaves: its rank among the nulls, and the tail of chi2.

    ``wilder``: mean square of packings under what was found, in units of the spread of all.
    """
    assert s.nulls is not None
    n, left = max(found.count - free_numbers, 1), found.chi2 / wilder
    scaled = np.sort(s.nulls.left) * n / max(found.count - len(s.base.u), 1)
    return rank(left, scaled), float(stats.chi2.sf(left, n))
