"""Swimmers in filmed beds under real-life conditions: what is drawn beside the effect, and what is sealed.

Standard errors are those of windows through a film of the same bed with the same sort of noise and nothing concealed;
the adjustable numbers, a tilt and the second effect are taken off. What a wrong scale and wrong radii do to contacts
is not computed.
"""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from ..errors import SimulationError
from ..scene import Scene
from .bed_candidates import Plan, acting, draw
from .bed_cases import believed_bed, known_bed, rivals, seen_recording, strong
from .beds import BedSetup, digits
from .candidates import camera_of
from .cases import Case, plain
from .ideal import SCALE, TILT, Errors
from .real_life import OFTEN, SECOND, disturbed, draw_errors, stated_errors, stated_noise, with_statements
from .seal import generator
from .windows import Windows, WindowSensitivity, beyond, film_of
from .world import Effect

NULL = 0.15  # share of the beds with nuisances alone
LADDER = (10.0, 15.0, 22.0, 35.0)  # ideal standard errors of the largest effect


def real_bed_case(seed: int, secret: bytes, effect: str | None = None, *, small: bool = False) -> Case:
    """A swimmer in its bed, both filmed, under real-life conditions. ``effect``: a mechanism or "null".

    Streams: ``public`` (apparatus, film, first guesses), ``packing``, ``sealed`` (what is concealed and added),
    ``noise``, ``other noise`` (of the film that standard errors come from), ``statements``.
    """
    kind = "real-life-small-bed" if small else "real-life-bed"
    setup, scene, fitted, guess = known_bed(kind, seed, secret, small)
    sealed = generator(secret, kind, seed, "sealed")
    rate = 1 / float(np.median(np.diff(setup.t)))
    drawn = draw_errors(sealed, setup.noise, rate, len(setup.t))
    errors = replace(drawn.errors, stamps=False)
    tilt, scale, mass, radius = draw_nuisances(sealed, scene)
    null = bool(sealed.random() < NULL)
    # states of windows come from films without the outliers that anybody would take out
    calm = replace(errors, outliers=0.0, bursts=(), lost=setup.lost)
    quiet = replace(setup, noise=digits(math.hypot(errors.fast, errors.slow), 3))
    other = generator(secret, kind, seed, "other noise")
    sensitivity = WindowSensitivity(Windows(quiet, scene, setup.t, shown(setup, scene, [], calm, other), whole=False))
    chosen: list[tuple[Plan, float]] = []
    if effect not in ("null", "none") and (effect is not None or not null):
        chosen = draw_effects(quiet, sensitivity, sealed, effect)
    sigmas = strengths(sensitivity, chosen, tilt)
    effects = [plan.at(amount) for plan, amount in chosen]
    beside = [Effect("uniform_force", {"a": tilt})] if tilt is not None else []
    camera = [Effect("camera_scale", {"s": scale})] if scale else []
    seen = shown(setup, scene, [*effects, *beside, *camera], errors, generator(secret, kind, seed, "noise"))
    believed = misjudged(scene, mass, radius)
    belief = believed_bed(quiet, believed, seen, guess, fitted)
    recording = seen_recording(setup, belief, seen, f"{kind}-{seed}")
    said = stated_errors(generator(secret, kind, seed, "statements"), errors)
    recording = with_statements(recording, stated_noise(drawn), said, False)
    # those of a weak second effect would take as long again
    found = rivals(quiet, sensitivity, *chosen[0])[1] if chosen else {}
    swimmer = setup.swimmer
    truth: dict[str, Any] = {
        "kind": kind, "seed": seed, "setup": f"{'small ' if small else 'full '}bed",
        "category": "mechanism" if effects else "null", "effects": [asdict(e) for e in effects],
        "sigma": sigmas[0], "second_sigma": sigmas[1], "believed": [asdict(e) for e in effects],
        "rivals": found, "second_rivals": {},
        "mass": mass, "radius": radius, "scale": scale, "tilt": tilt, "gravity": False,
        "left": remains(sensitivity, chosen, tilt) if not (scale or mass or radius) else {}, "pin_length": None,
        "bodies": sorted({b for e in effects for b in acting(e, swimmer)}), "swimmer": list(swimmer),
        "errors": asdict(errors), "stated": drawn.stated, "frames": len(setup.t), "masked": fitted,
    }  # fmt: skip
    return Case((recording,), plain(truth))


def draw_nuisances(
    rng: np.random.Generator, scene: Scene
) -> tuple[tuple[float, float] | None, float, dict[str, float], dict[str, float]]:
    """Tilt [m/s^2], scale less one, masses and radii (id -> true over believed), each in about half of the cases."""
    names = [b.id for b in scene.bodies if b.mobile]
    way, tilted = rng.uniform(0, 2 * math.pi), rng.random() < OFTEN
    tilt = (9.81 * TILT * math.cos(way), 9.81 * TILT * math.sin(way)) if tilted else None
    scale = float(SCALE * rng.choice([-1.0, 1.0])) if rng.random() < OFTEN else 0.0
    mass: dict[str, float] = {}
    radius: dict[str, float] = {}
    if rng.random() < OFTEN:
        size = rng.uniform(0.01, 0.03)
        mass = {name: float(1 + size * rng.normal()) for name in names}
    if rng.random() < OFTEN:
        size = rng.uniform(0.01, 0.03)
        radius = {name: float(1 + size * np.clip(rng.normal(), -2, 2)) for name in names}
    return tilt, scale, mass, radius


def misjudged(scene: Scene, mass: dict[str, float], radius: dict[str, float]) -> Scene:
    """The packed scene with the masses and radii that are believed."""
    bodies = tuple(
        replace(b, mass=digits(b.mass / mass.get(b.id, 1.0), 7), radius=digits(b.radius / radius.get(b.id, 1.0), 7))
        if b.mobile
        else b
        for b in scene.bodies
    )
    return replace(scene, bodies=bodies)


def shown(
    setup: BedSetup, scene: Scene, effects: list[Effect], errors: Errors, rng: np.random.Generator
) -> np.ndarray:
    """(T, n, 2) a film of the bed as the camera gives it: NaN where lost, eight decimals."""
    moments = np.maximum(setup.t + errors.jitter * rng.normal(size=len(setup.t)), 0.0)
    xy = film_of(replace(setup, t=moments), scene, [e for e in effects if e.name != "camera_scale"])
    period = scene.periodic_x
    if period:
        # a camera sees the box: every body begins in it
        xy = xy - np.stack([period * np.floor(xy[0, :, 0] / period), np.zeros(xy.shape[1])], axis=-1)
    seen = camera_of(effects).see(xy)
    return disturbed(seen.reshape(len(seen), -1), errors, rng, 2).reshape(seen.shape)


def draw_effects(
    setup: BedSetup, sensitivity: WindowSensitivity, rng: np.random.Generator, wanted: str | None
) -> list[tuple[Plan, float]]:
    """The largest effect with its amount, and in some cases another of 10 to 20 % of its standard errors."""
    pool = tuple(n for n in setup.candidates if n in (wanted or n))
    for _ in range(8):
        if not pool:
            break
        plan = draw(pool[int(rng.integers(len(pool)))], setup, rng, other=False)
        target = float(LADDER[int(rng.integers(len(LADDER)))]) * float(rng.uniform(0.9, 1.1))
        reached = strong(sensitivity, plan, target, rough=not setup.small)
        if reached is None:
            continue
        first = (plan, reached[0])
        if rng.random() >= SECOND:
            return [first]
        others = [n for n in setup.candidates if n != plan.name]
        second = draw(others[int(rng.integers(len(others)))], setup, rng, other=False)
        share = float(rng.uniform(0.1, 0.2))
        two = strong(sensitivity, second, share * reached[1], rough=False)
        return [first] if two is None else [first, (second, two[0])]
    return []


def _changes(
    sensitivity: WindowSensitivity, chosen: list[tuple[Plan, float]], tilt: tuple[float, float] | None
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """What each effect changes, and the columns of a tilt where there is one. Raises SimulationError."""
    tilts = [sensitivity.change([Effect("uniform_force", {"a": a})]) for a in ((0.3, 0.0), (0.0, 0.3))] if tilt else []
    return [sensitivity.change([plan.at(amount)]) for plan, amount in chosen], tilts


def strengths(
    sensitivity: WindowSensitivity, chosen: list[tuple[Plan, float]], tilt: tuple[float, float] | None
) -> tuple[float, float]:
    """Standard errors of both effects, the other one, a tilt and the adjustable numbers taken off."""
    if not chosen:
        return 0.0, 0.0
    try:
        changes, tilts = _changes(sensitivity, chosen, tilt)
    except SimulationError:
        return math.nan, math.nan
    known = [*sensitivity.adjustable(), *tilts]
    result = [beyond(c, [*known, *(o for o in changes if o is not c)])[0] for c in changes]
    return result[0], result[1] if len(result) > 1 else 0.0


def remains(
    sensitivity: WindowSensitivity, chosen: list[tuple[Plan, float]], tilt: tuple[float, float] | None
) -> dict[str, float]:
    """Standard errors of what was drawn and is not named, for every set of names; empty where it cannot be told."""
    try:
        changes, tilts = _changes(sensitivity, chosen, tilt)
    except SimulationError:
        return {}
    parts: dict[str, tuple[np.ndarray, list[np.ndarray]]] = {
        name: (change, [change]) for name, change in zip(("first", "second"), changes, strict=False)
    }
    if tilt is not None:
        parts["tilt"] = tilt[0] / 0.3 * tilts[0] + tilt[1] / 0.3 * tilts[1], tilts
    result = {}
    for bits in range(2 ** len(parts)):
        named = [name for k, name in enumerate(sorted(parts)) if bits >> k & 1]
        rest = [parts[name][0] for name in parts if name not in named]
        fitted = [column for name in named for column in parts[name][1]]
        result["+".join(named)] = beyond(np.sum(rest, axis=0), [*sensitivity.adjustable(), *fitted])[0] if rest else 0.0
    return result
