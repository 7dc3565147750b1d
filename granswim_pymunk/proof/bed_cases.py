"""Cases of swimmers in beds: filmed with their grains, filmed alone, or only their speeds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Protocol

import numpy as np

from ..errors import SimulationError
from ..recording import Recording
from ..recording.recording import CURVE
from ..scene import Scene
from .bed_candidates import Plan, acting, draw, rivals_of, typical
from .beds import BedSetup, digits, draw_bed, packed
from .candidates import OUTSIDE, camera_of, physics_of
from .cases import Case, plain, rounded
from .fitting import with_adjusted
from .packings import PackingSensitivity, looks, numbers, speed, tracks
from .seal import derived, generator
from .windows import Windows, WindowSensitivity, beyond, calibrated, film_of
from .world import Effect

CATEGORIES = {
    "mechanism": 0.44,
    "pair": 0.06,
    "outside": 0.12,
    "null": 0.18,
    "decoy_camera": 0.10,
    "decoy_adjustable": 0.10,
}
LADDER = (3.0, 5.0, 8.0, 12.0, 20.0, 40.0)  # standard errors
STRONGER = (10.0, 20.0, 40.0)  # of pairs and of what lies outside the library
CALIBRATED = 0.7  # share of the cases whose adjustable numbers were fitted to the tracks beforehand
SCALE, OFFSET = 0.01, 4e-3  # of a wrong picture; s, of a wrong clock
NEAR = 0.8  # of the standard errors of a truth: rivals that leave less are looked at again, at the amount that fits
CLEAR = 12.0  # standard errors, from which on few windows tell rivals apart
BENT = 1.5  # times its usual amount, beyond which a rival is not taken for linear
TWO_SIDED = ("added_mass", "uniform_force", "head_force", "restitution", "weak_joint", "resting_curvature",
             "nonlinear_bending")  # fmt: skip


class Sensitivity(Protocol):
    """What standard errors are computed with: windows through a seen bed, or packings of one that is not."""

    columns: dict[str, np.ndarray]

    def adjustable(self, few: bool = False) -> list[np.ndarray]: ...

    def change(self, effects: Sequence[Effect], few: bool = False) -> np.ndarray: ...


@dataclass(frozen=True)
class Draw:
    """What is concealed: plans and their amounts, faults of the camera, adjustable numbers moved."""

    category: str
    chosen: tuple[tuple[Plan, float], ...] = ()
    cameras: tuple[Effect, ...] = ()
    moved: dict[str, float] | None = None
    sigma: float | None = 0.0

    @property
    def effects(self) -> list[Effect]:
        return [*(plan.at(amount) for plan, amount in self.chosen), *self.cameras]


def _sigma(sensitivity: Sensitivity, effects: Sequence[Effect], few: bool = False) -> float:
    try:
        return beyond(sensitivity.change(effects, few), sensitivity.adjustable(few))[0]
    except SimulationError:
        return math.nan


def strong(sensitivity: Sensitivity, plan: Plan, target: float, rough: bool = False) -> tuple[float, float] | None:
    """The amount at which an effect comes to ``target`` standard errors, and what it came to; None where none does.

    rough : the first look is at few windows and members, to save time
    """
    amount = 1.0
    for n in range(4 if rough else 3):
        few = rough and n == 0
        found = _sigma(sensitivity, [plan.at(amount)], few)
        if not math.isfinite(found):
            amount *= 0.2
            continue
        if not few and 0.65 < found / target < 1.6:
            return amount, found
        if found < (0.3 if few else 1e-3):
            if not few:
                return None
            amount = min(5.0, plan.most)  # less than few can show
            continue
        amount = amount * float(np.clip(target / found, 0.02, 20.0))
        if amount > plan.most:
            return None
    return None


def concealed(
    setup: BedSetup, sensitivity: Sensitivity, rng: np.random.Generator, category: str, wanted: str | None
) -> Draw:
    """What is concealed in a bed; a null where nothing of the category reaches its strength."""
    if category == "decoy_adjustable" and setup.scene.adjustable:
        a = setup.scene.adjustable[int(rng.integers(len(setup.scene.adjustable)))]
        value = float(setup.scene.parameter(a.name))
        if a.parameter == "stiffness":
            return Draw(category, moved={a.name: value * float(rng.choice([0.8, 1.2]))})
        # worth five standard errors: from a small step of the same number
        size = beyond(sensitivity.columns[a.name], [c for n, c in sensitivity.columns.items() if n != a.name])[0]
        change = float(np.clip(5.0 / max(size, 1e-12), 0.05 * value, 0.6 * value))
        return Draw(category, moved={a.name: value + change * float(rng.choice([-1.0, 1.0]))})
    if category == "decoy_camera" and setup.cameras:
        name = wanted or str(rng.choice(setup.cameras))
        sign = float(rng.choice([-1.0, 1.0]))
        values = {"s": sign * SCALE} if name == "camera_scale" else {"offset": OFFSET}
        # a late clock is an early drive; what a wrong scale does to contacts is not computed
        late = [typical("actuator_delay", setup).at(OFFSET / 1.5e-3)]
        sigma = _sigma(sensitivity, late) if name == "time_offset" else None
        return Draw(category, cameras=(Effect(name, values),), sigma=sigma)
    pool = {"mechanism": setup.candidates, "pair": setup.candidates, "outside": setup.outside}.get(category, ())
    if wanted is not None:
        pool = tuple(n for n in pool if n == wanted)
    count = 2 if category == "pair" else 1
    for _ in range(8):
        if len(pool) < count:
            break
        names = [pool[int(i)] for i in rng.permutation(len(pool))[:count]]
        ladder = LADDER if category == "mechanism" else STRONGER
        target = float(ladder[int(rng.integers(len(ladder)))]) * float(rng.uniform(0.9, 1.1))
        found: list[tuple[Plan, float]] = []
        sigma = 0.0
        for name in names:
            plan = draw(name, setup, rng, other=bool(rng.random() < 0.5))
            reached = strong(sensitivity, plan, target, rough=not setup.small)
            if reached is None:
                break
            found.append((plan, reached[0]))
            sigma = reached[1]
        if len(found) == count:
            if count == 2:
                sigma = _sigma(sensitivity, [plan.at(amount) for plan, amount in found])
                if not math.isfinite(sigma):
                    continue
            return Draw(category, tuple(found), sigma=sigma)
    return Draw("null")


def rivals(setup: BedSetup, sensitivity: Sensitivity, plan: Plan, amount: float) -> tuple[float, dict[str, float]]:
    """d' that the truth's own canonical form leaves, and d' of every other mechanism beyond that, all refitted.

    Linear in the amounts, about those that come nearest to the truth where that is near; drags and their like only
    push one way.
    """
    sigma = _sigma(sensitivity, [plan.at(amount)])
    # half of the windows and fewer members are off by some two standard errors, which is much beside a weak effect
    few = not sigma < CLEAR
    truth, known = sensitivity.change([plan.at(amount)], few), sensitivity.adjustable(few)
    sigma = beyond(truth, known)[0]

    def fitted(plans: Sequence[Plan], sizes: Sequence[float], one_sided: bool) -> tuple[float, np.ndarray]:
        columns = [sensitivity.change([p.at(size)], few) / size for p, size in zip(plans, sizes, strict=True)]
        left, amounts = beyond(truth, [*columns, *known])
        if one_sided and amounts[0] < 0:
            left, others = beyond(truth, [*columns[1:], *known])
            amounts = np.concatenate([[0.0], others])
        return min(left, sigma), amounts[: len(plans)]

    def remains(plans: Sequence[Plan], one_sided: bool) -> float:
        shown = [p.shown for p in plans]
        left, amounts = fitted(plans, shown, one_sided)
        sizes = [float(np.clip(abs(a), 0.5 * s, p.most)) for a, s, p in zip(amounts, shown, plans, strict=True)]
        # a change that bends with its amount is another one than that of a usual amount
        if left < NEAR * sigma and max(size / s for size, s in zip(sizes, shown, strict=True)) > BENT:
            try:
                left = min(left, fitted(plans, sizes, one_sided)[0])
            except SimulationError:
                pass
        return left

    own = 0.0
    if plan.name not in OUTSIDE and plan.other:
        own = remains([replace(plan, other={})], False)
    found: dict[str, float] = {}
    for name, plans in rivals_of(setup):
        if name == plan.name:
            continue
        if plan.bodies is not None and name in ("linear_drag", "quadratic_drag", "coulomb_substrate", "uniform_force"):
            plans = tuple(replace(p, bodies=plan.bodies) for p in plans)
        try:
            left = remains(plans, name not in TWO_SIDED)
        except SimulationError:
            continue
        found[name] = min(math.sqrt(max(left**2 - own**2, 0.0)), found.get(name, math.inf))
    if "actuator_delay" in found and "time_offset" in setup.cameras:
        found["time_offset"] = found["actuator_delay"]
    if plan.name == "actuator_delay" and "time_offset" in setup.cameras:
        found["time_offset"] = 0.0
    return own, found


def first_guess(setup: BedSetup, rng: np.random.Generator) -> dict[str, float]:
    """First guesses of the adjustable numbers, a few per cent off."""
    result = {}
    for a in setup.scene.adjustable:
        value = float(setup.scene.parameter(a.name))
        off_by = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.02, 0.08))
        result[a.name] = float(np.clip(value * (1 + off_by), a.low, a.high))
    return result


def _believed(scene: Scene, adjusted: dict[str, float]) -> Scene:
    return rounded(with_adjusted(scene, {name: digits(value) for name, value in adjusted.items()}))


def _category(rng: np.random.Generator, setup: BedSetup, effect: str | None) -> tuple[str, str | None]:
    category = str(rng.choice(list(CATEGORIES), p=list(CATEGORIES.values())))
    if effect in CATEGORIES:
        return str(effect), None
    if effect == "none":
        return "null", None
    if effect is not None:
        kind = "outside" if effect in setup.outside else "decoy_camera" if effect in setup.cameras else "mechanism"
        return kind, effect
    return category, None


def shown(setup: BedSetup, xy: np.ndarray, effects: Sequence[Effect], rng: np.random.Generator) -> np.ndarray:
    """(T, n, 2) as filmed: the camera's faults, noise, lost sightings, eight decimals."""
    period = setup.scene.periodic_x
    if period:
        # a camera sees the box: every body begins in it
        xy = xy - np.stack([period * np.floor(xy[0, :, 0] / period), np.zeros(xy.shape[1])], axis=-1)
    seen = camera_of(effects).see(xy) + rng.normal(size=xy.shape) * setup.noise
    lost = rng.random(xy.shape[:2]) < setup.lost
    lost[:6] = False
    seen[lost] = np.nan
    return np.round(seen, 8)


def _truth(
    kind: str, seed: int, setup: BedSetup, drawn: Draw, scene: Scene, own: float, found: dict[str, float] | None,
    fitted: bool,
) -> dict[str, Any]:  # fmt: skip
    swimmer = setup.swimmer
    bodies: set[str] = set()
    for plan, amount in drawn.chosen:
        bodies |= set(acting(plan.at(amount), swimmer))
    return {
        "kind": kind, "seed": seed, "setup": f"{'small ' if setup.small else 'full '}{setup.name}",
        "category": drawn.category, "effects": [asdict(e) for e in drawn.effects], "bodies": sorted(bodies),
        "swimmer": list(swimmer), "sigma": drawn.sigma, "own": own, "rivals": found or {},
        "rivals_computed": found is not None, "moved": drawn.moved or {}, "masked": fitted,
        "true_parameters": {a.name: float(scene.parameter(a.name)) for a in scene.adjustable},
        "noise": setup.noise, "frames": len(setup.t), "recordings": len(setup.drives),
    }  # fmt: skip


def known_bed(kind: str, seed: int, secret: bytes, small: bool) -> tuple[BedSetup, Scene, bool, dict[str, float]]:
    """What may be known of a seen bed: setup, packed scene, whether its numbers will be fitted to the film, guesses.

    Streams: ``public``, ``packing``.
    """
    public = generator(secret, kind, seed, "public")
    setup = draw_bed(public, "bed", small)
    fitted = bool(public.random() < CALIBRATED) and bool(setup.scene.adjustable)
    guess = first_guess(setup, public)
    scene = replace(packed(setup.scene, drawn_number(secret, kind, seed, "packing")), bed=None)
    return setup, scene, fitted, guess


def seen_bed_case(seed: int, secret: bytes, effect: str | None = None, *, small: bool = False) -> Case:
    """A swimmer in its bed, both filmed.

    Streams: ``public`` (apparatus, film, first guesses), ``packing``, ``sealed`` (what is concealed), ``noise``.
    """
    kind = "small-bed" if small else "bed"
    setup, scene, fitted, guess = known_bed(kind, seed, secret, small)
    sealed = generator(secret, kind, seed, "sealed")
    category, wanted = _category(sealed, setup, effect)
    # standard errors come from a film of the same bed without anything concealed
    nothing = film_of(setup, scene, ())
    plain_film = shown(setup, nothing, (), generator(secret, kind, seed, "other noise"))
    sensitivity = WindowSensitivity(Windows(setup, scene, setup.t, plain_film, whole=False))
    drawn = concealed(setup, sensitivity, sealed, category, wanted)
    true = with_adjusted(scene, drawn.moved or {})
    effects = drawn.effects
    if effects or drawn.moved:
        xy = film_of(setup, true, physics_of(effects), camera_of(effects).time_offset)
    else:
        xy = nothing
    seen = shown(setup, xy, effects, generator(secret, kind, seed, "noise"))
    single = len(drawn.chosen) == 1
    own, found = rivals(setup, sensitivity, *drawn.chosen[0]) if single else (0.0, _camera_rivals(drawn))
    belief = believed_bed(setup, scene, seen, guess, fitted)
    truth = _truth(kind, seed, setup, drawn, true, own, found, fitted)
    return Case((seen_recording(setup, belief, seen, f"{kind}-{seed}"),), plain(truth))


def _camera_rivals(drawn: Draw) -> dict[str, float]:
    # the contract's own class: only the drive depends on time
    return {"actuator_delay": 0.0} if any(e.name == "time_offset" for e in drawn.cameras) else {}


def believed_bed(setup: BedSetup, scene: Scene, seen: np.ndarray, guess: dict[str, float], fitted: bool) -> Scene:
    """The scene as the experimenter has it: its adjustable numbers fitted to the film, or first guesses.

    Depends on the film and on what may be known, on nothing else.
    """
    return _believed(scene, calibrated(setup, scene, setup.t, seen, guess) if fitted else guess)


def seen_recording(setup: BedSetup, belief: Scene, seen: np.ndarray, name: str) -> Recording:
    bodies = tuple(replace(b, initial=None) if b.mobile else b for b in belief.bodies)
    mobile = np.array([b.mobile for b in bodies])
    return Recording(
        name=name, scene=replace(belief, bodies=bodies), t=setup.t,
        ids=tuple(b.id for b in bodies if b.mobile), xy=seen[:, mobile], title="concealed case",
        sampling=float(f"{1 / np.median(np.diff(setup.t)):.6g}"), position_noise=setup.noise,
    )  # fmt: skip


def drawn_number(secret: bytes, *parts: str | int) -> int:
    return int.from_bytes(derived(secret, *parts)[:6], "big")


def _packing_sensitivity(setup: BedSetup, secret: bytes, kind: str, seed: int) -> PackingSensitivity:
    """Packings of the experimenter's own: not those of the recordings."""
    every = range(len(setup.drives))
    if setup.small:
        drives, count = list(every), 4 if setup.name == "unseen" else 2
    else:
        drives, count = [1, len(setup.drives) - 2], 3
    seeds = [[drawn_number(secret, kind, seed, "other packing", d, n) for n in range(count)] for d in drives]
    return PackingSensitivity(setup, drives, seeds)


def swimmer_case(seed: int, secret: bytes, effect: str | None = None, *, small: bool = False) -> Case:
    """A swimmer in beds that are not seen: several films, each with a packing and a frequency of its own."""
    return _unseen(seed, secret, effect, "unseen", small)


def curve_case(seed: int, secret: bytes, effect: str | None = None, *, small: bool = False) -> Case:
    """Speeds of a swimmer at several frequencies, and under several layers."""
    return _unseen(seed, secret, effect, "curve", small)


def _unseen(seed: int, secret: bytes, effect: str | None, name: str, small: bool) -> Case:
    kind = f"small-{name}" if small else name
    public = generator(secret, kind, seed, "public")
    setup = draw_bed(public, name, small)
    fitted = bool(public.random() < CALIBRATED) and bool(setup.scene.adjustable)
    guess = first_guess(setup, public)
    sensitivity = _packing_sensitivity(setup, secret, kind, seed)
    sealed = generator(secret, kind, seed, "sealed")
    category, wanted = _category(sealed, setup, effect)
    drawn = concealed(setup, sensitivity, sealed, category, wanted)
    effects = drawn.effects
    physics, camera = physics_of(effects), camera_of(effects)
    noise = generator(secret, kind, seed, "noise")
    true = with_adjusted(setup.scene, drawn.moved or {})
    values: list[np.ndarray] = []  # of each drive what is seen
    speeds: list[tuple[float, float]] = []
    for d in range(len(setup.drives)):
        runs = []
        for n in range(setup.runs):
            scene = packed(setup.driven(true, d), drawn_number(secret, kind, seed, "packing", d, n))
            runs.append((scene, tracks(setup, scene, physics, looks(setup), setup.dt, camera.time_offset)))
        if name == "curve":
            found = [camera.scale * speed(scene, xy) for scene, xy in runs]
            sem = float(np.std(found, ddof=1)) / math.sqrt(len(found))
            speeds.append((digits(float(np.mean(found)), 5), digits(sem, 3)))
            values.append(np.array([np.mean(found)]))
        else:
            values.append(shown(setup, runs[0][1], effects, noise))
    own, found_rivals = 0.0, None
    if not drawn.chosen or len(drawn.chosen) > 1:
        found_rivals = _camera_rivals(drawn)
    elif small and name == "unseen":
        own, found_rivals = rivals(setup, sensitivity, *drawn.chosen[0])
    if fitted:
        seen = np.array([
            values[d] if name == "curve" else numbers(setup, setup.driven(setup.scene, d), values[d])
            for d in sensitivity.drives
        ])  # fmt: skip
        guess = sensitivity.calibrated(seen)
    belief = _believed(setup.scene, guess)
    title = "concealed case"
    truth = plain(_truth(kind, seed, setup, drawn, true, own, found_rivals, fitted))
    if name == "curve":
        curve = np.array([(f, layers, v, sem, setup.runs) for (f, layers), (v, sem) in
                          zip(setup.drives, speeds, strict=True)], dtype=CURVE)  # fmt: skip
        recording = Recording(f"{kind}-{seed}", belief, np.zeros(0), (), np.zeros((0, 0, 2)), title=title, curve=curve)
        return Case((recording,), truth)
    rate = float(f"{1 / np.median(np.diff(setup.t)):.6g}")
    return Case(
        tuple(
            Recording(
                f"film-{d + 1}", setup.driven(belief, d), setup.t, setup.swimmer, values[d], title=title,
                sampling=rate, position_noise=setup.noise,
            )
            for d in range(len(setup.drives))
        ),
        truth,
    )  # fmt: skip
