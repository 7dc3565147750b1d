"""All beds of a diagnosis together: predictions of their windows, whitened innovations, the noise of replicates."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence

import numpy as np

from ...errors import InputError
from ..criteria import current
from ..hypothesis import Failed, Hypothesis
from ..kept import Store
from .signatures import Noise, ensemble_noise, replicate_noise
from .windows import POOL, BedCase, BedPredictor, Job, predict_all
from .work import Work

Prediction = list[np.ndarray]  # of each bed (W, m, D) [m], NaN in windows that were not asked for
Windows = Sequence[np.ndarray]  # of each bed the windows that are looked at


class WindowLikelihood:
    """Predicts, and compares with what was seen. ``members`` of each window, ``replicates`` of each recording."""

    def __init__(
        self, beds: Sequence[BedCase], replicates: int, members: int | None = None, store: Store | None = None,
        cut: bool = True, work: Work | None = None,
    ) -> None:  # fmt: skip
        self.work = work or Work()
        self.beds = list(beds)
        self.members = members or current().windows.plan.members
        self.replicates = replicates
        self.store = store
        self.predictors = [BedPredictor(b, members=self.members, store=store, cut=cut) for b in beds]
        self.seen = [p.seen() for p in self.predictors]
        self.noises: list[Noise] = []
        self.paces: list[np.ndarray] = []  # of each bed (N, 2) of its replicates, see BedPredictor.pace
        self.replicate_scene: tuple[Hypothesis, np.ndarray] | None = None  # what the replicates were made of
        # of (bed, replicate): its predictor, and what its windows show of the scene that it was made of
        self._films: dict[tuple[int, int], tuple[BedPredictor, np.ndarray]] = {}

    def with_replicates(self, replicates: int) -> WindowLikelihood:
        """The same predictions, to be judged by that many replicates of another scene."""
        other = copy.copy(self)
        other.replicates, other.noises, other.paces = replicates, [], []
        other.replicate_scene, other._films = None, {}
        return other

    @property
    def training(self) -> list[np.ndarray]:
        return [np.flatnonzero(b.training) for b in self.beds]

    @property
    def held(self) -> list[np.ndarray]:
        return [np.flatnonzero(~b.training) for b in self.beds]

    @property
    def every(self) -> list[np.ndarray]:
        return [np.arange(len(b.starts)) for b in self.beds]

    @property
    def runs(self) -> int:
        return sum(p.runs for p in self.predictors)

    def predict(
        self,
        wanted: Sequence[tuple[Hypothesis, np.ndarray]],
        windows: Windows | None = None,
        members: int | None = None,
        first: int = 0,
    ) -> list[Prediction | None]:
        """What the members, from number ``first`` on, show under each hypothesis; None where a run failed."""
        jobs, owner = [], []
        for k, (hypothesis, values) in enumerate(wanted):
            for b, predictor in enumerate(self.predictors):
                chosen = None if windows is None else [int(w) for w in windows[b]]
                if chosen is not None and not chosen:
                    continue
                jobs.append(Job(predictor, hypothesis, np.asarray(values, dtype=float), chosen, members, first))
                owner.append((k, b))
                looked = len(self.beds[b].starts) if chosen is None else len(chosen)
                self.work.seconds += looked * (members or self.members) * predictor.member_cost
        found = dict(zip(owner, predict_all(jobs), strict=True))
        result: list[Prediction | None] = []
        for k in range(len(wanted)):
            rows: Prediction | None = []
            for b, bed in enumerate(self.beds):
                full = np.full((len(bed.starts), members or self.members, bed.size), np.nan)
                if (k, b) in found:
                    mine = found[k, b]
                    if mine is None:
                        rows = None
                        break
                    full[slice(None) if windows is None else windows[b]] = mine
                assert rows is not None
                rows.append(full)
            result.append(rows)
        return result

    def weigh(self, hypothesis: Hypothesis, values: np.ndarray) -> Prediction | None:
        """Grains count from now on by how well they are predicted; what all windows show, None where a run failed."""
        found = predict_all([Job(p, hypothesis, values, weigh=True) for p in self.predictors])
        self.work.seconds += sum(len(p.bed.starts) * max(self.members, 2) * p.member_cost for p in self.predictors)
        self.seen = [p.seen() for p in self.predictors]
        shown = [f for f in found if f is not None]
        return shown if len(shown) == len(found) else None

    def predict_surely(
        self,
        wanted: Sequence[tuple[Hypothesis, np.ndarray]],
        windows: Windows | None = None,
        members: int | None = None,
        first: int = 0,
    ) -> list[Prediction]:
        """As ``predict``. Raises Failed where a run failed."""
        found = [p for p in self.predict(wanted, windows, members, first) if p is not None]
        if len(found) < len(wanted):
            raise Failed("a window cannot be simulated")
        return found

    def innovations(self, predicted: Prediction, members: int | None = None) -> list[np.ndarray]:
        """Of each bed (W, D) [m]: seen less the mean of (the first) members, the estimator's bias taken off."""
        return [
            seen - p[:, :members].mean(axis=1) - noise.bias
            for seen, p, noise in zip(self.seen, predicted, self.noises, strict=True)
        ]

    def white(self, predicted: Prediction, windows: Windows, members: int | None = None) -> np.ndarray:
        """(n,) whitened innovations of the chosen windows of all beds."""
        parts = [
            noise.whiten(rows, chosen)
            for rows, noise, chosen in zip(self.innovations(predicted, members), self.noises, windows, strict=True)
        ]
        return np.concatenate([p.ravel() for p in parts])

    def change(self, after: Prediction, before: Prediction, windows: Windows) -> np.ndarray:
        """(n,) whitened change of the mean prediction, of the members that both have."""
        parts = []
        for seen, noise, a, b, chosen in zip(self.seen, self.noises, after, before, windows, strict=True):
            m = min(a.shape[1], b.shape[1])
            hidden = np.where(np.isfinite(seen), 0.0, np.nan)
            parts.append(noise.whiten((a[:, :m] - b[:, :m]).mean(axis=1) + hidden, chosen).ravel())
        return np.concatenate(parts)

    def columns(self, ends: Sequence[Prediction], spans: np.ndarray, windows: Windows) -> np.ndarray:
        """(n, p) whitened changes for one unit of each number; ``ends``, ``spans``: see ``both_sides``."""
        changes = [self.change(after, before, windows) for before, after in zip(ends[::2], ends[1::2], strict=True)]
        return np.column_stack([change / span for change, span in zip(changes, spans, strict=True)])

    # ---- noise --------------------------------------------------------------------------------

    def first_noise(self, predicted: Prediction, windows: Windows) -> None:
        """A first guess, from the members' own spread."""
        self.noises = [
            ensemble_noise(p, chosen, bed.film.sigma)
            for p, chosen, bed in zip(predicted, windows, self.beds, strict=True)
        ]

    def make_replicates(
        self, hypothesis: Hypothesis, values: np.ndarray, progress: Callable[[float], None] = lambda share: None
    ) -> None:
        """Noise and bias from replicates of the scene with these values. Raises Failed."""
        tasks = self._replicate_tasks()
        done = [0]
        self.replicate_scene, self._films = (hypothesis, values), {}
        for b, _ in tasks:
            p = self.predictors[b]
            self.work.seconds += p.film_cost + len(p.bed.starts) * max(self.members, 2) * p.member_cost

        def one(task: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
            b, k = task
            bed, predictor = self.beds[b], self.predictors[b]
            key = predictor.key("replicate", hypothesis, values, k, self.members) if self.store else ""
            shape = (len(bed.starts), bed.size)
            found = self.store.get(key, (shape[0] * shape[1] + 2,)) if self.store else None
            if found is None:
                own, shown = self._replicate(b, k)
                left = own.seen() - shown.mean(axis=1)
                found = np.concatenate([left.ravel(), own.pace()])
                predictor.runs += own.runs
                if self.store:
                    self.store.put(key, found)
            done[0] += 1
            progress(done[0] / len(tasks))
            return found[:-2].reshape(shape), found[-2:]

        found = list(POOL.map(one, tasks))
        self.noises = [
            replicate_noise(np.stack([f for (f, _), (b, _) in zip(found, tasks, strict=True) if b == number]))
            for number in range(len(self.beds))
        ]
        self.paces = [
            np.stack([pace for (_, pace), (b, _) in zip(found, tasks, strict=True) if b == number])
            for number in range(len(self.beds))
        ]

    def _replicate_tasks(self) -> list[tuple[int, int]]:
        return [(b, k) for b in range(len(self.beds)) for k in range(self.replicates)]

    def _replicate(self, b: int, k: int) -> tuple[BedPredictor, np.ndarray]:
        """The predictor of a replicate's windows, grains weighed like the film's, and what it shows. Raises Failed."""
        if (b, k) not in self._films:
            assert self.replicate_scene is not None
            own = self.predictors[b].of(self.predictors[b].replicate(*self.replicate_scene, k))
            look = own.weigh if self.predictors[b].weighed else own
            self._films[b, k] = own, look(*self.replicate_scene)
        return self._films[b, k]

    def cost_of_views(self, count: int, windows: Windows, members: int | None = None) -> float:
        """Seconds of a core [s] that ``replicate_views`` of so many scenes takes, about."""
        each = [len(windows[b]) * self.predictors[b].member_cost for b, _ in self._replicate_tasks()]
        return count * (members or self.members) * sum(each)

    def replicate_views(
        self, wanted: Sequence[tuple[Hypothesis, np.ndarray]], windows: Windows, members: int, first: int = 0
    ) -> np.ndarray:
        """(N, n, wanted) whitened mean predictions in the windows of each replicate, to be subtracted from one another.

        Of all replicates from their own starts: columns made of the film's starts share their errors with the film's
        innovations, these in the same way with those of the replicates. Raises Failed.
        """
        assert self.replicate_scene is not None
        scene = self.replicate_scene

        def one(task: tuple[int, int]) -> np.ndarray:
            b, k = task
            chosen, noise, bed = [int(w) for w in windows[b]], self.noises[b], self.beds[b]
            key = ""
            if self.store:
                parts = [self.predictors[b].key("view", h, v) for h, v in wanted]
                key = self.predictors[b].key("views", *scene, k, chosen, members, first, parts)
                kept = self.store.get(key, (len(chosen) * bed.size, len(wanted)))
                if kept is not None:
                    return kept
            own, _ = self._replicate(b, k)
            began = own.runs
            hidden = np.where(np.isfinite(noise.replicates[k]), 0.0, np.nan)
            views = []
            for h, v in wanted:
                full = np.full((len(bed.starts), bed.size), np.nan)
                full[chosen] = own(h, v, chosen, members, first).mean(axis=1)
                views.append(noise.whiten(full + hidden, chosen).ravel())
            self.predictors[b].runs += own.runs - began
            out = np.stack(views, axis=1)
            if self.store:
                self.store.put(key, out)
            return out

        tasks = [(b, k) for b, k in self._replicate_tasks() if len(windows[b])]
        self.work.seconds += self.cost_of_views(len(wanted), windows, members)
        found = dict(zip(tasks, POOL.map(one, tasks), strict=True))
        beds = [b for b in range(len(self.beds)) if len(windows[b])]
        return np.stack([np.concatenate([found[b, k] for b in beds]) for k in range(self.replicates)])


def both_sides(
    z: np.ndarray, steps: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[list[np.ndarray], np.ndarray]:
    """Each number of ``z`` a step lower and a step higher, within bounds: (2p numbers in turn), and the spans (p,)."""
    pairs = [(np.clip(z - h, low, high), np.clip(z + h, low, high)) for h in np.diag(steps)]
    spans = np.array([after[k] - before[k] for k, (before, after) in enumerate(pairs)])
    return [end for pair in pairs for end in pair], spans


def check_runs(found: Prediction | None, where: str) -> Prediction:
    """The prediction of the scene as given. Raises InputError where it cannot be run from the tracks."""
    if found is None:
        raise InputError("the naive scene cannot be run from the tracks", where=where)
    return found
