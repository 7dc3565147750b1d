"""Cases of free, pinned, sprung, driven and colliding bodies: what is concealed, how strongly, and what is seen."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from ..errors import SimulationError
from ..recording import Recording
from ..scene import LawUse, Scene
from .beds import digits
from .candidates import APPARATUS, OUTSIDE, STRENGTH, Sizes, draw, scale_strength, typical
from .fitting import Sight, Strength, calibrate, canonical, left, look, with_adjusted
from .seal import generator
from .setups import DRAGS, Setup, draw_setup, pin_length
from .world import Effect, World

TRAINING = 0.6  # of the time: a diagnosis learns from no more, so strengths are those of this part
CALIBRATED = 0.8  # share of the cases whose adjustable numbers were fitted to the tracks beforehand
NOISE_KNOWN = 0.9
# standard errors at which effects are concealed
LADDER = (2.0, 3.0, 5.0, 8.0, 12.0, 20.0, 40.0, 80.0)
STRONGER = (12.0, 25.0, 50.0, 100.0)  # of what lies outside the library
WIDER = {"linear_drag": "ambient_flow"}  # a law and one that holds it as a special case: no rival, only richer
CATEGORIES = {
    "mechanism": 0.45,
    "pair": 0.05,
    "outside": 0.13,
    "null": 0.20,
    "decoy_camera": 0.09,
    "decoy_adjustable": 0.08,
}


@dataclass(frozen=True)
class Case:
    """A concealed case: the recordings that may be seen, and the truth that may not."""

    recordings: tuple[Recording, ...]
    truth: dict[str, Any]

    @property
    def recording(self) -> Recording:
        """The first, of most kinds the only one."""
        return self.recordings[0]


def _digits(value: Any, count: int = 6) -> Any:
    if isinstance(value, bool) or not isinstance(value, float | tuple):
        return value
    if isinstance(value, tuple):
        return tuple(_digits(v, count) for v in value)
    return digits(value, count)


def rounded(scene: Scene) -> Scene:
    """The scene with six digits in every number of every law, whatever it was made from."""
    laws = tuple(LawUse(u.law, {k: _digits(v) for k, v in u.values.items()}, u.bodies) for u in scene.laws)
    return replace(scene, laws=laws)


def _public(secret: bytes, seed: int) -> tuple[Setup, np.random.Generator]:
    """The apparatus of a seed, and the stream that the rest of what may be known is drawn from."""
    rng = generator(secret, "bodies", seed, "public")
    setup = draw_setup(rng)
    t = np.array([float(f"{x:.7f}") for x in setup.t])
    return replace(setup, scene=rounded(setup.scene), t=t, noise=_digits(setup.noise, 3)), rng


def strength_of(setup: Setup, scene: Scene, effects: list[Effect], start: np.ndarray) -> float:
    """Standard errors of the effects together, on the training part."""
    t0 = float(setup.t[0])
    values = look(setup, scene, effects, start, setup.t, t0)
    sight = Sight(setup.t, values, setup.noise).part(TRAINING)
    return left(setup, scene, sight, [], start)


def _strong(
    setup: Setup, scene: Scene, effect: Effect, start: np.ndarray, target: float
) -> tuple[Effect, float] | None:
    """The effect made as strong as ``target`` standard errors, and what it came to; None where it does not show."""
    best: tuple[Effect, float] | None = None
    for _ in range(7):
        try:
            sigma = strength_of(setup, scene, [effect], start)
        except SimulationError:
            effect = scale_strength(effect, 0.2, setup)
            continue
        if sigma < 0.05:
            return None
        if best is None or abs(math.log(sigma / target)) < abs(math.log(best[1] / target)):
            best = effect, sigma
        if abs(math.log(sigma / target)) < 0.12:
            break
        effect = scale_strength(effect, float(np.clip(target / sigma, 0.02, 20.0)), setup)
    return best if best is not None and 0.4 < best[1] / target < 2.5 else None


def plausible(effect: Effect, setup: Setup) -> bool:
    """Numbers that a physicist would not laugh at."""
    v = effect.values
    if effect.name == "contact_friction":
        return bool(v["mu"] < 1.0)
    if effect.name == "added_mass":
        return bool(-0.5 < v["beta"] < 1.0)
    if effect.name in ("camera_scale", "camera_tilt"):
        return bool(abs(v[STRENGTH[effect.name]]) < 0.1)
    if effect.name in ("actuator_lag", "actuator_delay", "time_offset"):
        return bool(abs(v[STRENGTH[effect.name]]) < 0.15)
    return True


def _draw_effects(
    category: str, setup: Setup, scene: Scene, start: np.ndarray, rng: np.random.Generator, wanted: str | None
) -> tuple[str, list[Effect], float]:
    """What is concealed and its standard errors; a null where nothing of the category shows in this apparatus."""
    if category in ("null", "decoy_adjustable"):
        return category, [], 0.0
    sizes = Sizes(setup)
    inside = [s for s in setup.candidates if s not in OUTSIDE]
    pool = {
        "mechanism": inside, "pair": inside, "outside": [s for s in setup.candidates if s in OUTSIDE],
        "decoy_camera": list(setup.cameras),
    }[category]  # fmt: skip
    if wanted is not None:
        pool = [s for s in pool if s == wanted]
    count = 2 if category == "pair" else 1
    for _ in range(12):
        if len(pool) < count:
            break
        names = [pool[int(k)] for k in rng.permutation(len(pool))[:count]]
        ladder = STRONGER if category in ("outside", "pair") else LADDER
        target = float(ladder[int(rng.integers(len(ladder)))]) * float(rng.uniform(0.9, 1.1))
        if category == "decoy_camera":
            target = max(target, 5.0)
        found = []
        for name in names:
            effect = draw(name, setup, sizes, rng, other=bool(rng.random() < 0.5))
            strong = _strong(setup, scene, effect, start, target)
            if strong is None or not plausible(strong[0], setup):
                break
            found.append(strong)
        if len(found) == count:
            effects = [e for e, _ in found]
            return category, effects, found[0][1] if count == 1 else strength_of(setup, scene, effects, start)
    return "null", [], 0.0


def rivals(setup: Setup, scene: Scene, effects: list[Effect], start: np.ndarray, sigma: float) -> Strength:
    """d' of every other candidate of the apparatus, refitted together with starts and adjustables."""
    t0 = float(setup.t[0])
    sight = Sight(setup.t, look(setup, scene, effects, start, setup.t, t0), setup.noise).part(TRAINING)
    sizes = Sizes(setup)
    truth = effects[0]
    own = 0.0
    if truth.other:
        own = left(setup, scene, sight, [canonical(truth)], start)
    if truth.name in OUTSIDE:
        own = 0.0
    found = {}
    # whatever a diagnosis may name instead, whether or not it is concealed in this apparatus
    everywhere = () if setup.scene.laws_named("drive") else (*DRAGS, "added_mass")
    for name in dict.fromkeys((*setup.candidates, *setup.cameras, *everywhere)):
        if name in (truth.name, WIDER.get(truth.name), *OUTSIDE):
            continue
        rival = typical(name, setup, sizes)
        if truth.bodies is not None and name in ("linear_drag", "quadratic_drag", "coulomb_substrate", "uniform_force"):
            rival = replace(rival, bodies=truth.bodies)
        if "p" in rival.values and "p" in truth.values:
            rival = replace(rival, values={**rival.values, "p": truth.values["p"]})
        # from a size like the truth's, and from a small one
        remains = math.inf
        for factor in (1.0, 0.1):
            try:
                own_size = strength_of(setup, scene, [rival], start)
                first = scale_strength(rival, factor * min(sigma / max(own_size, 1e-3), 10.0), setup)
                remains = min(remains, left(setup, scene, sight, [first], start, tries=15))
            except SimulationError:
                continue
            if remains < 0.1 * sigma:
                break
        found[name] = math.sqrt(max(min(remains, sigma) ** 2 - own**2, 0.0))
    return Strength(sigma, own, found)


def _seen(setup: Setup, values: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Values (T, c) with noise, sightings that were lost, eight decimals."""
    columns = 1 if setup.angles else 2
    noisy = values + rng.normal(size=values.shape) * setup.noise
    share = rng.uniform(0.0, 0.05)
    lost = rng.random((len(values), values.shape[1] // columns)) < share
    lost[:5] = False
    noisy[np.repeat(lost, columns, axis=1)] = np.nan
    return np.round(noisy, 8)


def believed_scene(setup: Setup, values: np.ndarray, rng: np.random.Generator) -> Scene:
    """The scene as the experimenter has it: its adjustable numbers fitted to the tracks, or first guesses.

    Depends on the tracks and on what may be known, on nothing else.
    """
    scene = setup.scene
    fitted = rng.random() < CALIBRATED
    guess = {
        a.name: float(np.clip(
            scene.parameter(a.name) * (1 + rng.choice([-1, 1]) * rng.uniform(0.03, 0.12)),
            a.low, a.high)) for a in scene.adjustable
    }  # fmt: skip
    if fitted:
        guess = calibrate(setup, with_adjusted(scene, guess), Sight(setup.t, values, setup.noise))
    return rounded(with_adjusted(scene, {name: _digits(value) for name, value in guess.items()}))


def as_recording(setup: Setup, scene: Scene, values: np.ndarray, name: str, noise_known: bool) -> Recording:
    """A contract recording of values (T, c)."""
    bodies = tuple(b if b.role == "wall" else replace(b, initial=None) for b in scene.bodies)
    ids = tuple(b.id for b in bodies if b.mobile)
    shape = (len(setup.t), len(ids))
    xy, angle = np.full((*shape, 2), np.nan), None
    if setup.angles:
        angle = values.copy()
    else:
        xy = values.reshape(*shape, 2).copy()
    rate = float(f"{1 / np.median(np.diff(setup.t)):.6g}")
    noise = setup.noise if noise_known else None
    return Recording(
        name=name, scene=replace(scene, bodies=bodies), t=setup.t, ids=ids, xy=xy, angle=angle, title="concealed case",
        sampling=rate, position_noise=None if setup.angles else noise, angle_noise=noise if setup.angles else None,
    )  # fmt: skip


def bodies_case(seed: int, secret: bytes, effect: str | None = None) -> Case:
    """Draw a case of bodies from a seed. ``effect``: a name, or a category, instead of a drawn one.

    Streams: ``public`` (apparatus, film, first guesses), ``sealed`` (what is concealed), ``noise``.
    """
    setup, public = _public(secret, seed)
    sealed = generator(secret, "bodies", seed, "sealed")
    noise_known = bool(public.random() < NOISE_KNOWN)
    category = str(sealed.choice(list(CATEGORIES), p=list(CATEGORIES.values())))
    wanted = None
    if effect in CATEGORIES:
        category = effect
    elif effect is not None and effect != "none":
        wanted = effect
        category = "outside" if effect in OUTSIDE else "decoy_camera" if effect in APPARATUS else "mechanism"
    elif effect == "none":
        category = "null"
    scene, start = setup.scene, World(setup.scene, [], setup.dt).start()
    category, effects, sigma = _draw_effects(category, setup, scene, start, sealed, wanted)
    true_scene = scene
    moved = {}
    if category == "decoy_adjustable":
        for a in scene.adjustable:
            value = scene.parameter(a.name)
            moved[a.name] = float(np.clip(value * sealed.choice([0.8, 1.25]) ** sealed.uniform(0.3, 1), a.low, a.high))
        true_scene = with_adjusted(scene, moved)
        if scene.laws_named("pin"):  # the rod's end moves with its length
            start = _on_rod(setup, true_scene, start)
    clean = look(setup, true_scene, effects, start, setup.t, float(setup.t[0]))
    strength = rivals(setup, scene, effects, start, sigma) if len(effects) == 1 else Strength(sigma, 0.0, {})
    values = _seen(setup, clean, generator(secret, "bodies", seed, "noise"))
    belief = believed_scene(setup, values, public)
    mobile = list(setup.mobile)
    truth = {
        "kind": "bodies", "seed": seed, "setup": setup.name, "category": category,
        "effects": [asdict(e) for e in effects],
        "bodies": sorted({b for e in effects for b in (e.bodies or mobile)}) if effects else [],
        "sigma": sigma, "own": strength.own, "rivals": dict(strength.rivals), "moved": moved,
        "true_parameters": {a.name: float(true_scene.parameter(a.name)) for a in scene.adjustable},
        "noise": setup.noise, "frames": len(setup.t), "bodies_in_all": len(mobile),
        "pin_length": pin_length(setup),
        "radii": {b.id: b.radius for b in setup.scene.bodies if b.id in mobile},
    }  # fmt: skip
    return Case((as_recording(setup, belief, values, f"bodies-{seed}", noise_known),), plain(truth))


def _on_rod(setup: Setup, scene: Scene, start: np.ndarray) -> np.ndarray:
    world = World(scene, [], setup.dt)
    result = start.copy()
    for i in np.flatnonzero(world.geometry[:, 2] > 0):
        anchor, length = world.geometry[i, :2], world.geometry[i, 2]
        arm = start[i, :2] - anchor
        factor = length / math.hypot(*arm)
        result[i, :2] = anchor + factor * arm
        result[i, 2:] = factor * start[i, 2:]
    return result


def plain(value: Any) -> Any:
    """Plain numbers, lists and dictionaries, as JSON has them."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if isinstance(value, np.bool_ | bool):
        return bool(value)
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return value
