"""What an ideal analyst could tell of a film with everything that laboratories add, to first order about the truth.

The film is linearised: how it changes with the start of every body, with each adjustable number, with masses, radii,
scale and tilt, and with the numbers of the effects. White noise, quantised pixels, a slow part and jittering stamps
are its covariance. Masses, radii, scale and tilt are known as well as they were drawn (a prior); starts, adjustable
numbers and a second effect are free. The ideal standard errors of an effect are the length of its change, in units of
the noise, with all that taken off (Cramer & Rao).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

from ..errors import InputError, SimulationError
from ..scene import Body, Scene
from .candidates import APPARATUS, Sizes, numbers, scale_strength, stands_for, typical, with_numbers
from .fitting import Sight, Starts, look, solve, with_adjusted
from .setups import Setup
from .world import Effect, World

MASSES = RADII = 0.02  # relative, how well they are known: drawn between 1 and 3 %
SCALE = 0.005
TILT = 5e-4  # m/m, or rad of the picture where gravity is in it


class Priors(NamedTuple):
    """How well an apparatus is known, one standard deviation each: relative, but for the tilt; 0 is exact."""

    mass: float = 0.0
    radius: float = 0.0
    scale: float = 0.0
    tilt: float = 0.0


KNOWN, EXACT = Priors(MASSES, RADII, SCALE, TILT), Priors()
SLOW_FRAMES = 30.0  # correlation that passes for noise, with a size up to the white part's
TRAINING = 0.6  # of the time
FOLLOWED = 3.0  # times the noise, above which the believed scene does not follow a film


@dataclass(frozen=True)
class Errors:
    """How a film departs from what happened.

    white [m] (or rad);  pixel : step of the values, 0 none;  slow : size of a part correlated over ``frames``
    jitter : error of a stamp [s];  outliers : share of sightings that are far off;  bursts : frames lost in a row
    lost : share of sightings lost one by one;  stamps : whether the stamps are uneven, or the moments
    """

    white: float
    pixel: float = 0.0
    slow: float = 0.0
    frames: float = 10.0
    jitter: float = 0.0
    outliers: float = 0.0
    bursts: tuple[int, ...] = ()
    lost: float = 0.0
    stamps: bool = False

    @property
    def fast(self) -> float:
        """Standard deviation of the part that is new in every frame."""
        return math.hypot(self.white, self.pixel / math.sqrt(12.0))

    def covariance(self, t: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """(T, T) of one column of values that change by ``speed`` (T,) a second."""
        lag = np.abs(t[:, None] - t[None]) / float(np.median(np.diff(t)))
        result = self.slow**2 * np.exp(-lag / self.frames)
        return result + np.diag(self.fast**2 + (self.jitter * speed) ** 2)

    def allowed(self) -> Errors:
        """The same with the slow part that passes for noise in any recording."""
        if self.slow > 0.9 * self.fast and self.frames > 0.9 * SLOW_FRAMES:
            return self
        return replace(self, slow=math.hypot(self.slow, self.fast), frames=SLOW_FRAMES)


@dataclass(frozen=True)
class Truth:
    """What is true of a case without noise.

    setup : the apparatus as everybody knows it;  first : the largest effect, or None;  second : another, or None
    mass, radius : id -> true over believed, of mobile bodies;  scale : of the picture, less one
    tilt : of the table, acceleration [m/s^2], or of the picture [rad] in an apparatus with gravity
    """

    setup: Setup
    first: Effect | None = None
    second: Effect | None = None
    mass: Mapping[str, float] = field(default_factory=dict)
    radius: Mapping[str, float] = field(default_factory=dict)
    scale: float = 0.0
    tilt: tuple[float, float] | float | None = None

    @property
    def scene(self) -> Scene:
        """The scene as it is, with the true masses and radii."""

        def true(b: Body) -> Body:
            return replace(b, mass=b.mass * self.mass.get(b.id, 1.0), radius=b.radius * self.radius.get(b.id, 1.0))

        return replace(self.setup.scene, bodies=tuple(true(b) for b in self.setup.scene.bodies))

    def effect(self, place: str) -> Effect:
        """The effect in ``place``, which has to be there."""
        found = self.first if place == "first" else self.second
        assert found is not None
        return found

    def having(self, place: str, effect: Effect | None) -> Truth:
        """The same with another effect in ``place``."""
        return replace(self, first=effect) if place == "first" else replace(self, second=effect)

    @property
    def places(self) -> list[str]:
        """Of its effects: "first", "second"."""
        return [p for p, e in (("first", self.first), ("second", self.second)) if e is not None]

    @property
    def tilted(self) -> Effect | None:
        """The tilt as an effect."""
        if self.tilt is None:
            return None
        if isinstance(self.tilt, tuple):
            return Effect("uniform_force", {"a": self.tilt})
        return Effect("camera_tilt", {"angle": self.tilt})

    @property
    def effects(self) -> list[Effect]:
        """All that acts and all that is wrong with the picture."""
        scale = Effect("camera_scale", {"s": self.scale}) if self.scale else None
        return [e for e in (self.first, self.second, self.tilted, scale) if e is not None]


def has_gravity(setup: Setup) -> bool:
    return any(setup.scene.gravity)


def slid(setup: Setup) -> bool:
    """Whether a table that is not level would show."""
    return not has_gravity(setup) and not setup.scene.laws_named("drive")


def touching(setup: Setup) -> bool:
    return any(setup.scene.laws_named(name) for name in ("contact_elastic", "contact_linear"))


class Response:
    """How the film of a truth answers to small changes; columns are whitened vectors.

    errors : of the film;  start : (n, 4) of the run;  part : share of the time that is looked at
    Raises SimulationError where the truth itself does not stay finite.
    """

    def __init__(self, truth: Truth, errors: Errors, start: np.ndarray, part: float = TRAINING) -> None:
        self.truth, self.setup, self.errors, self.start = truth, truth.setup, errors, start
        t = self.setup.t
        self.t = t[t <= t[0] + part * (t[-1] - t[0])]
        self.base = self._look(truth, truth.effects, start)
        speed = np.gradient(self.base, self.t, axis=0)
        columns = range(self.base.shape[1])
        if errors.jitter:
            self.roots = [np.linalg.cholesky(errors.covariance(self.t, speed[:, c])) for c in columns]
        else:  # one and the same for all
            self.roots = [np.linalg.cholesky(errors.covariance(self.t, 0.0 * self.t))] * len(columns)
        self._kept: dict[str, np.ndarray] = {}

    def _look(self, truth: Truth, effects: Sequence[Effect], start: np.ndarray, scene: Scene | None = None):
        return look(self.setup, scene or truth.scene, effects, start, self.t, float(self.setup.t[0]))

    def white(self, change: np.ndarray) -> np.ndarray:
        """A change of the film (T, c) in units of its noise, as one vector."""
        parts = [solve_triangular(root, change[:, c], lower=True) for c, root in enumerate(self.roots)]
        return np.concatenate(parts)

    def _twice(self, of: Callable[[float], np.ndarray], step: float) -> np.ndarray:
        return self.white(of(step) - of(-step)) / (2 * step)

    def _columns(self, name: str, make: Callable[[], list[np.ndarray]]) -> np.ndarray:
        if name not in self._kept:
            found = make()
            size = sum(len(root) for root in self.roots)
            self._kept[name] = np.column_stack(found) if found else np.zeros((size, 0))
        return self._kept[name]

    # ---- what is free, and what is known within a prior -----------------------------------------

    def starts(self) -> np.ndarray:
        """By the start of every body (N, k)."""

        def make() -> list[np.ndarray]:
            starts = Starts(self.setup, self.truth.scene, self.t, self.setup.noise)
            world = World(self.truth.scene, [], self.setup.dt)
            z = starts.pack(self.start)

            def of(k: int) -> Callable[[float], np.ndarray]:
                def moved(step: float) -> np.ndarray:
                    other = z.copy()
                    other[k] += step
                    return self._look(self.truth, self.truth.effects, starts.unpack(other, world))

                return moved

            return [self._twice(of(k), 0.1 * float(starts.size[k])) for k in range(len(z))]

        return self._columns("starts", make)

    def adjustables(self) -> np.ndarray:
        def make() -> list[np.ndarray]:
            scene = self.truth.scene

            def of(name: str) -> Callable[[float], np.ndarray]:
                value = float(scene.parameter(name))

                def moved(step: float) -> np.ndarray:
                    # an effect that takes the place of this very number moves with it: then nothing is missing
                    effects = [
                        with_numbers(e, numbers(e) + step) if stands_for(e) == name else e for e in self.truth.effects
                    ]
                    return self._look(self.truth, effects, self.start, with_adjusted(scene, {name: value + step}))

                return moved

            return [self._twice(of(a.name), 1e-4 * (a.high - a.low)) for a in scene.adjustable]

        return self._columns("adjustables", make)

    def _body(self, what: str, size: float) -> list[np.ndarray]:
        def of(name: str) -> Callable[[float], np.ndarray]:
            def moved(step: float) -> np.ndarray:
                now = dict(getattr(self.truth, what))
                changed = {**now, name: now.get(name, 1.0) * (1 + step)}
                other = replace(self.truth, mass=changed) if what == "mass" else replace(self.truth, radius=changed)
                return self._look(other, other.effects, self.start)

            return moved

        return [self._twice(of(name), size) for name in self.setup.mobile]

    def masses(self) -> np.ndarray:
        """By the relative error of each mass (N, n)."""
        return self._columns("masses", lambda: self._body("mass", 1e-3))

    def radii(self) -> np.ndarray:
        """By the relative error of each radius (N, n); none where nothing touches."""
        return self._columns("radii", lambda: self._body("radius", 1e-4) if touching(self.setup) else [])

    def scale(self) -> np.ndarray:
        def of(step: float) -> np.ndarray:
            return self._look(self.truth, replace(self.truth, scale=self.truth.scale + step).effects, self.start)

        return self._columns("scale", lambda: [] if self.setup.angles else [self._twice(of, 1e-3)])

    def tilt(self) -> np.ndarray:
        """By a tilt of the table (two columns, m/s^2), or of the picture (rad); none where neither shows."""

        def make() -> list[np.ndarray]:
            if has_gravity(self.setup):
                angle = self.truth.tilt if isinstance(self.truth.tilt, float) else 0.0
                return [self._twice(lambda s: self._look(
                    self.truth, replace(self.truth, tilt=angle + s).effects, self.start), 1e-4)]  # fmt: skip
            if not slid(self.setup):
                return []
            a = self.truth.tilt if isinstance(self.truth.tilt, tuple) else (0.0, 0.0)
            return [
                self._twice(lambda s, x=x, y=y: self._look(  # type: ignore[misc]
                    self.truth, replace(self.truth, tilt=(a[0] + s * x, a[1] + s * y)).effects, self.start), 1e-3)
                for x, y in ((1.0, 0.0), (0.0, 1.0))
            ]  # fmt: skip

        return self._columns("tilt", make)

    # ---- effects --------------------------------------------------------------------------------

    def _with(self, place: str, effect: Effect) -> np.ndarray:
        other = self.truth.having(place, effect)
        return self._look(other, other.effects, self.start)

    def strength(self, place: str) -> np.ndarray:
        """(N, 1) by the relative strength of the effect in ``place``: all of it, to first order about the truth.

        Of an actuator the whole change is taken: nothing of it is chaotic, and a limit bends.
        """
        effect = self.truth.effect(place)

        def make() -> list[np.ndarray]:
            if effect.name.startswith("actuator_"):
                without = self.truth.having(place, None)
                return [self.white(self.base - self._look(without, without.effects, self.start))]
            return [self._twice(lambda s: self._with(place, scale_strength(effect, 1 + s, self.setup)), 0.02)]

        return self._columns(f"strength of {place}", make)

    def numbers(self, place: str) -> np.ndarray:
        """(N, k) by each fitted number of the effect in ``place``, in its own unit."""
        effect = self.truth.effect(place)

        def make() -> list[np.ndarray]:
            values = numbers(effect)

            def of(k: int) -> Callable[[float], np.ndarray]:
                def moved(step: float) -> np.ndarray:
                    other = values.copy()
                    other[k] += step
                    return self._with(place, with_numbers(effect, other))

                return moved

            scale = np.maximum(np.abs(values), 0.1 * np.abs(values).max())
            return [self._twice(of(k), 0.01 * float(scale[k])) for k in range(len(values))]

        return self._columns(f"numbers of {place}", make)

    def _beside(self, effect: Effect) -> np.ndarray:
        """What is seen with another effect beside the truth's; two faults of a picture add up."""
        mine = [e for e in self.truth.effects if e.name == effect.name and effect.name in APPARATUS]
        if mine:
            effect = with_numbers(effect, numbers(effect) + numbers(mine[0]))
        return self._look(self.truth, [e for e in self.truth.effects if e not in mine] + [effect], self.start)

    def rival(self, name: str, bodies: tuple[str, ...] | None = None, place: str = "first") -> np.ndarray:
        """(N, k) what a little of another effect changes beside the truth, for each of its forms.

        More inertia weakens every force; in place of an effect it has to do without the one it stands for.
        """

        def make() -> list[np.ndarray]:
            sizes = Sizes(self.setup)
            found = []
            if name == "added_mass":
                bare = self.truth.having(place, None)
                heavier = [*bare.effects, Effect("added_mass", {"beta": 0.02})]
                return [self.white(self._look(bare, heavier, self.start) - self._look(bare, bare.effects, self.start))]
            for effect in forms(typical(name, self.setup, sizes), sizes, len(self.setup.mobile)):
                one = replace(effect, bodies=bodies) if bodies is not None and name in SINGLE else effect
                if name == "actuator_saturation":  # it limits or it does not
                    found.append(self.white(self._beside(one) - self.base))
                else:
                    found.append(self._twice(lambda s, e=one: self._beside(  # type: ignore[misc]
                        scale_strength(e, s, self.setup)), 0.03))  # fmt: skip
            return found

        return self._columns(f"rival {name} {bodies} {place}", make)

    # ---- what is left ---------------------------------------------------------------------------

    def free(self) -> np.ndarray:
        return np.hstack([self.starts(), self.adjustables()])

    def known(self, by: Priors) -> np.ndarray:
        """Masses, radii, scale and tilt in units of how well they are known (N, k); none of what is exact."""
        tilt = by.tilt * (1.0 if has_gravity(self.setup) else 9.81)
        parts = ((by.mass, self.masses), (by.radius, self.radii), (by.scale, self.scale), (tilt, self.tilt))
        return np.hstack([self.free()[:, :0], *(error * columns() for error, columns in parts if error)])

    def _taken(self, by: Priors) -> np.ndarray:
        """Orthonormal columns of all that is fitted in any case; below them a row for each of the known numbers."""
        name = f"taken {by}"
        if name not in self._kept:
            columns, known = self.free(), self.known(by)
            below = np.zeros((known.shape[1], columns.shape[1]))
            self._kept[name] = _basis(np.block([[columns, known], [below, np.eye(known.shape[1])]]))
        return self._kept[name]

    def left(self, change: np.ndarray, free: Iterable[np.ndarray] = (), by: Priors = KNOWN) -> float:
        """Length of a change when starts, adjustables and ``free`` are fitted, and what is known moves in its prior."""
        taken = self._taken(by)
        columns = np.hstack([change.reshape(-1, 1), *free])
        columns = np.vstack([columns, np.zeros((len(taken) - len(columns), columns.shape[1]))])
        sizes = np.linalg.norm(columns, axis=0)
        columns -= taken @ (taken.T @ columns)
        # what is left of a column by rounding alone is nothing
        columns[:, np.linalg.norm(columns, axis=0) < 1e-9 * sizes] = 0.0
        target, others = columns[:, 0], _basis(columns[:, 1:])
        return float(np.linalg.norm(target - others @ (others.T @ target)))

    def sigma(self, place: str) -> float:
        """Ideal standard errors of the effect in ``place``; the other effect is free."""
        other = {"first": "second", "second": "first"}[place]
        beside = [self.strength(other)] if other in self.truth.places else []
        return self.left(self.strength(place), beside)

    def shown(self, place: str) -> float:
        """What the effect in ``place`` changes, in units of the noise; only starts and adjustables are fitted.

        A mass that is known to 2 % hides an added mass of 10 %: it would be said to be weak, and moves the film most.
        """
        return self.left(self.strength(place), by=EXACT)

    def rivals(self, place: str, names: Iterable[str]) -> dict[str, float]:
        """d' of each rival: the standard errors that are left when it is fitted in place of the effect."""
        effect = self.truth.effect(place)
        other = {"first": "second", "second": "first"}[place]
        beside = [self.strength(other)] if other in self.truth.places else []
        return {
            name: self.left(self.strength(place), [*beside, self.rival(name, effect.bodies, place)])
            for name in names
            if name != effect.name
        }

    # ---- completeness and numbers ---------------------------------------------------------------

    def components(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """What was drawn: name -> (its whole change (N,), the columns that naming it fits (N, k))."""
        found: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        for place in self.truth.places:
            found[place] = self.strength(place)[:, 0], self.numbers(place)
        if self.truth.tilt is not None:
            size = np.atleast_1d(np.asarray(self.truth.tilt, dtype=float))
            found["tilt"] = self.tilt() @ size, self.tilt()
        if self.truth.scale:
            found["scale"] = self.scale()[:, 0] * self.truth.scale, self.scale()
        for what, columns in (("mass", self.masses), ("radius", self.radii)):
            drawn = getattr(self.truth, what)
            if drawn and columns().shape[1]:
                off = np.array([drawn.get(name, 1.0) - 1.0 for name in self.setup.mobile])
                found[what] = columns() @ off, columns()
        return found

    def remains(self, mass_error: float | None = None, radius_error: float | None = None) -> dict[str, float]:
        """Standard errors of all that was drawn and not named, for every set of names: "first+scale" -> length.

        Masses and radii whose relative error is stated are fitted within it, as the contract asks of a diagnosis;
        others are taken for exact.
        """
        by = Priors(mass_error or 0.0, radius_error or 0.0)
        parts = self.components()
        result = {}
        for count in range(len(parts) + 1):
            for named in combinations(sorted(parts), count):
                rest = [change for name, (change, _) in parts.items() if name not in named]
                if rest:
                    fitted = [parts[name][1] for name in named]
                    result["+".join(named)] = self.left(np.sum(rest, axis=0), fitted, by)
                else:
                    result["+".join(named)] = 0.0
        return result

    def believed(self) -> dict[str, Effect]:
        """The effects with the numbers that fit the film best in the believed masses, radii and scale.

        A tilt is fitted beside them. Steps are those of the truth's own columns; where these lead nowhere, as impacts
        bend them, least squares begins anew. Empty where the believed scene cannot follow the film at all.
        """
        places = self.truth.places
        if not places:
            return {}
        return self._chords(places) or self._squares(places)

    def ideal(self) -> dict[str, Effect]:
        """The effects with the numbers that an ideal analyst finds in the film without noise, to first order.

        Who fits starts, adjustables and all effects as ``believed`` does, but masses, radii, scale and tilt within
        their priors, too. Where the film does not tell these they stay as they are believed, and the numbers are those
        of ``believed``; where it does, an analyst who held to them would fit what is known to be wrong.
        """
        places = self.truth.places
        own = [self.numbers(p) for p in places]
        known, columns = self.known(KNOWN), np.hstack([*own, self.free()])
        size = np.linalg.norm(columns, axis=0)
        size[size == 0] = 1.0
        # about the truth: the film is met where nothing moves, and the priors where what is known goes back to it
        rows = np.block([[columns / size, known], [np.zeros((known.shape[1], len(size))), np.eye(known.shape[1])]])
        off = np.concatenate([np.zeros(len(columns)), -self._off()])
        step = np.linalg.lstsq(rows, off, rcond=1e-9)[0][: len(size)] / size
        effects, k = {}, 0
        for p, mine in zip(places, own, strict=True):
            k, at = k + mine.shape[1], k
            effects[p] = with_numbers(self.truth.effect(p), numbers(self.truth.effect(p)) + step[at:k])
        return effects

    def _off(self) -> np.ndarray:
        """How far what is known is off, in standard deviations, in the order of ``known``."""
        truth, mobile = self.truth, self.setup.mobile
        tilt = TILT if has_gravity(self.setup) else 9.81 * TILT
        slope = np.zeros(self.tilt().shape[1])
        if truth.tilt is not None and len(slope):
            slope[:] = truth.tilt
        parts = [
            [(truth.mass.get(n, 1.0) - 1.0) / MASSES for n in mobile],
            [(truth.radius.get(n, 1.0) - 1.0) / RADII for n in mobile][: self.radii().shape[1]],
            [truth.scale / SCALE][: self.scale().shape[1]], slope / tilt,
        ]  # fmt: skip
        return np.concatenate([np.asarray(part, dtype=float) for part in parts])

    def _squares(self, places: Sequence[str]) -> dict[str, Effect]:
        effects = [self.truth.effect(p) for p in places]
        tilt = self.truth.tilted
        if tilt is not None and not any(e.name == tilt.name for e in effects):
            effects.append(tilt)
        scene = self.setup.scene
        sight = Sight(self.t, self.base, self.setup.noise)
        found = solve(self.setup, scene, sight, effects, self.start, evaluations=20)
        if not found.chi2 < FOLLOWED**2 * found.count:
            return {}
        return dict(zip(places, found.effects, strict=False))

    def _chords(self, places: Sequence[str]) -> dict[str, Effect]:
        own = {p: self.numbers(p) for p in places}
        merged = any(self.truth.effect(p).name == "uniform_force" for p in places)
        tilt = self.tilt() if self.truth.tilt is not None and not merged else np.zeros((len(self.starts()), 0))
        columns = np.hstack([*own.values(), tilt, self.free()])
        size = np.linalg.norm(columns, axis=0)
        size[size == 0] = 1.0
        inverse = np.linalg.pinv(columns / size, rcond=1e-9) / size[:, None]
        starts = Starts(self.setup, self.setup.scene, self.t, self.setup.noise)
        names = [a.name for a in self.setup.scene.adjustable]
        tilted = np.atleast_1d(np.asarray(self.truth.tilt, dtype=float)) if tilt.shape[1] else np.zeros(0)
        at = np.concatenate([
            *(numbers(self.truth.effect(p)) for p in places), tilted, starts.pack(self.start),
            [float(self.setup.scene.parameter(n)) for n in names],
        ])  # fmt: skip
        last = math.inf
        for _ in range(12):
            try:
                effects, change = self._believed_look(at, places, own, tilt.shape[1], names, starts)
            except (InputError, SimulationError):  # a number that no law takes
                return {}
            step = inverse @ self.white(self.base - change)
            length = float(np.linalg.norm(columns @ step))
            if not math.isfinite(length) or length > 2 * last:
                return {}
            at += step
            if length < 0.02:
                return dict(zip(places, effects, strict=True))
            last = length
        return {}

    def _believed_look(
        self, at: np.ndarray, places: Sequence[str], own: Mapping[str, np.ndarray], tilted: int, names: Sequence[str],
        starts: Starts,
    ) -> tuple[list[Effect], np.ndarray]:  # fmt: skip
        """The effects of a vector of numbers, and what is seen of them in the believed scene."""
        effects, k = [], 0
        for p in places:
            effects.append(with_numbers(self.truth.effect(p), at[k : k + own[p].shape[1]]))
            k += own[p].shape[1]
        beside: list[Effect] = []
        if tilted == 2:
            beside = [Effect("uniform_force", {"a": (float(at[k]), float(at[k + 1]))})]
        elif tilted == 1:
            beside = [Effect("camera_tilt", {"angle": float(at[k])})]
        k += tilted
        cut = len(at) - len(names)
        scene = with_adjusted(self.setup.scene, dict(zip(names, at[cut:], strict=True)))
        start = starts.unpack(at[k:cut], World(scene, [], self.setup.dt))
        return effects, self._look(self.truth, [*effects, *beside], start, scene)


def _basis(columns: np.ndarray) -> np.ndarray:
    """Orthonormal columns (N, r) that span those of (N, k), each taken at the same length."""
    size = np.linalg.norm(columns, axis=0)
    scaled = columns[:, size > 0] / size[size > 0]
    if not scaled.shape[1]:
        return np.zeros((len(columns), 0))
    u, s, _ = np.linalg.svd(scaled, full_matrices=False)
    return u[:, s > 1e-10 * s[0]]


SINGLE = ("linear_drag", "quadratic_drag", "coulomb_substrate", "uniform_force")


def forms(effect: Effect, sizes: Sizes, bodies: int) -> list[Effect]:
    """The forms of an effect that a fit may choose between, and the directions of its vectors."""
    name, values = effect.name, effect.values

    def of(**other: object) -> Effect:
        return replace(effect, values={**values, **other})

    if name in ("linear_drag", "quadratic_drag"):
        return [of(p=p) for p in range(1 if bodies == 1 else 2 if name == "linear_drag" else 3)]
    if name == "ambient_flow":
        return [of(u=u) for u in ((0.0, 0.0), (sizes.speed, 0.0), (0.0, sizes.speed))]
    if name in ("uniform_force", "tracking_bias"):
        key = "a" if name == "uniform_force" else "b"
        size = math.hypot(*values[key])
        return [of(**{key: (size, 0.0)}), of(**{key: (0.0, size)})]
    if name == "distance_force":
        return [of(n=n) for n in (1.5, 3.5)]
    if name in ("cohesion", "pair_lubrication"):
        return [of(range=factor * values["range"]) for factor in (1.0, 4.0)]
    return [effect]
