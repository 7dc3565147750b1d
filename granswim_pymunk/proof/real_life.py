"""Cases under real-life conditions: beside the effect, what laboratories add to bodies and films.

The apparatus is drawn from the public stream of a seed. Sealed are the largest effect (or none), a second one of 10 to
20 % of what it changes, masses and radii off by 1 to 3 %, a tilt, a scale, a slow part of the noise, the steps of
its pixels, outliers, bursts of lost frames, stamps that jitter, and what is stated of the noise. Strengths are ideal
standard errors (``ideal``), and the numbers that count are those in the masses, radii and scale that are believed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from ..errors import SimulationError
from ..recording import Recording
from .candidates import OUTSIDE, Sizes, draw, scale_strength
from .cases import Case, as_recording, believed_scene, plain, plausible, rounded
from .fitting import look
from .ideal import MASSES, RADII, SCALE, TILT, Errors, Response, Truth, has_gravity, slid, touching
from .seal import generator
from .setups import DRAGS, SETUPS, Setup, pin_length, pucks
from .world import Effect, World

MIX = {"table": 0.15, "meeting": 0.12, "pressing": 0.08, "pendulum": 0.15, "cart": 0.15, "motor": 0.10,
       "falling": 0.10, "pucks": 0.15}  # fmt: skip
NULL = 0.3  # share of the cases with nuisances alone
LADDER = (6.0, 12.0, 20.0, 35.0, 60.0, 100.0, 180.0, 320.0)  # ideal standard errors of the largest effect
MOST = 10.0  # times the usual size of an effect, beyond which it is absurd
STATED = {"right": 0.4, "double": 0.2, "half": 0.2, "missing": 0.2}
OFTEN = 0.5  # how often each of the other nuisances is there
SECOND = 0.45  # of the cases with an effect have another


@dataclass(frozen=True)
class Drawn:
    """The nuisances of a case: the error of the film, and what is stated of its noise."""

    errors: Errors
    stated: str


def draw_setup(rng: np.random.Generator) -> Setup:
    """One of the apparatuses, pucks that collide several times among them."""
    name = list(MIX)[int(rng.choice(len(MIX), p=list(MIX.values())))]
    return pucks(rng) if name == "pucks" else SETUPS[name](rng)


def draw_errors(rng: np.random.Generator, white: float, rate: float, frames: int) -> Drawn:
    """What the camera adds: each nuisance in about half of the cases, the statement of the noise always."""

    def often() -> bool:
        return bool(rng.random() < OFTEN)

    pixel = white * rng.uniform(0.5, 3.0) if often() else 0.0
    slow, length = (white * rng.uniform(0.3, 1.0), rng.uniform(3.0, 30.0)) if often() else (0.0, 10.0)
    jitter = 0.05 / rate if often() else 0.0
    bursts: tuple[int, ...] = ()
    if often():
        longest = max(min(12, frames // 12), 3)
        bursts = tuple(int(rng.integers(2, longest + 1)) for _ in range(int(rng.integers(1, 4))))
    errors = Errors(white, float(pixel), float(slow), float(length), float(jitter), 0.005 if often() else 0.0, bursts,
                    float(rng.uniform(0.0, 0.02)), often())  # fmt: skip
    return Drawn(errors, str(rng.choice(list(STATED), p=list(STATED.values()))))


def draw_truth(rng: np.random.Generator, setup: Setup) -> Truth:
    """Masses, radii, tilt and scale, without an effect."""

    def often() -> bool:
        return bool(rng.random() < OFTEN)

    mass: dict[str, float] = {}
    radius: dict[str, float] = {}
    if often():
        size = rng.uniform(0.01, 0.03)
        mass = {name: float(1 + size * rng.normal()) for name in setup.mobile}
    if often() and touching(setup):
        size = rng.uniform(0.01, 0.03)
        radius = {name: float(1 + size * np.clip(rng.normal(), -2, 2)) for name in setup.mobile}
    tilt: tuple[float, float] | float | None = None
    way, tilted = rng.uniform(0, 2 * math.pi), often()
    if tilted and has_gravity(setup):
        tilt = float(TILT * rng.choice([-1.0, 1.0]))
    elif tilted and slid(setup):
        tilt = (9.81 * TILT * math.cos(way), 9.81 * TILT * math.sin(way))
    scale = float(SCALE * rng.choice([-1.0, 1.0])) if often() and not setup.angles else 0.0
    return Truth(setup, mass=mass, radius=radius, scale=scale, tilt=tilt)


def reached(
    truth: Truth, errors: Errors, start: np.ndarray, target: float, measure: Callable[[Response], float], place: str
) -> tuple[Truth, float] | None:
    """The truth with its effect in ``place`` made so strong that ``measure`` is ``target``, and what it came to.

    None where that would be absurd, or does not show.
    """
    grown = 1.0
    for _ in range(6):
        try:
            sigma = measure(Response(truth, errors, start))
        except (SimulationError, np.linalg.LinAlgError):
            return None
        if not math.isfinite(sigma) or sigma < 1e-3:
            return None
        if abs(math.log(sigma / target)) < 0.12:
            return truth, sigma
        factor = float(np.clip(target / sigma, 0.05, 10.0))
        grown *= factor
        if grown > MOST:
            return None
        truth = truth.having(place, scale_strength(truth.effect(place), factor, truth.setup))
    return (truth, sigma) if 0.7 < sigma / target < 1.4 else None


def draw_effects(truth: Truth, errors: Errors, start: np.ndarray, rng: np.random.Generator, wanted: str | None):
    """The truth with its largest effect and perhaps a second one, and their standard errors; None where none shows."""
    setup = truth.setup
    pool = [s for s in setup.candidates if s not in OUTSIDE and s in (wanted or s)]
    sizes = Sizes(setup)
    for _ in range(12):
        if not pool:
            return None
        name = pool[int(rng.integers(len(pool)))]
        target = float(LADDER[int(rng.integers(len(LADDER)))]) * float(rng.uniform(0.9, 1.1))
        effect = draw(name, setup, sizes, rng, other=False)
        given = replace(truth, first=effect)
        found = reached(given, errors, start, target, lambda r: r.sigma("first"), "first")
        if found is None or not plausible(found[0].effect("first"), setup) or not same_kind(found[0], start):
            continue
        if rng.random() < SECOND:
            return _with_second(found, errors, start, rng, sizes) or (*found, 0.0)
        return *found, 0.0
    return None


def same_kind(truth: Truth, start: np.ndarray) -> bool:
    """Whether the bodies still move as such an apparatus lets them: finite, and not stopped half way."""
    setup = truth.setup
    try:
        seen = look(setup, truth.scene, truth.effects, start, setup.t, float(setup.t[0]))
    except SimulationError:
        return False
    late = seen[int(0.6 * len(seen)) :]
    return bool(np.all(np.ptp(late, axis=0).max() > 10 * setup.noise))


def _with_second(
    found: tuple[Truth, float], errors: Errors, start: np.ndarray, rng: np.random.Generator, sizes: Sizes
) -> tuple[Truth, float, float] | None:
    truth, sigma = found
    setup, first = truth.setup, truth.first
    assert first is not None
    # a push beside a tilt would be one and the same
    pool = [s for s in setup.candidates if s not in OUTSIDE and s != first.name
            and not (s == "uniform_force" and truth.tilt is not None)]  # fmt: skip
    for _ in range(4):
        if not pool:
            return None
        name = pool[int(rng.integers(len(pool)))]
        share = float(rng.uniform(0.1, 0.2))
        given = replace(truth, second=draw(name, setup, sizes, rng, other=False))
        # by what they change in the film: the first shows less beside the second, and may be another
        two = reached(given, errors, start, share, lambda r: r.shown("second") / max(r.shown("first"), 1e-9), "second")
        if two is not None and plausible(two[0].effect("second"), setup):
            response = Response(two[0], errors, start)
            now = response.sigma("first")
            if 0.5 * sigma < now < 2 * sigma:
                return two[0], now, response.sigma("second")
    return None


def filmed(
    setup: Setup, scene: Any, effects: Sequence[Effect], start: np.ndarray, errors: Errors, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Stamps (T,) and values (T, c) as the camera gives them: NaN where lost, eight decimals."""
    t = setup.t
    shift = errors.jitter * rng.normal(size=len(t))
    if errors.stamps:
        stamps, moments = np.round(t + shift, 7), t
    else:
        stamps, moments = t, np.maximum(t + shift, t[0])
    values = look(setup, scene, effects, start, moments, float(t[0]))
    return stamps, disturbed(values, errors, rng, 1 if setup.angles else 2)


def disturbed(values: np.ndarray, errors: Errors, rng: np.random.Generator, columns: int) -> np.ndarray:
    """Values (T, c) with noise, a slow part, outliers, pixels and lost frames; ``columns`` of them are one sighting."""
    count, width = values.shape
    noisy = values + errors.white * rng.normal(size=values.shape)
    if errors.slow:
        keep = math.exp(-1.0 / errors.frames)
        drift = rng.normal(size=width)
        fresh = rng.normal(size=values.shape) * math.sqrt(1 - keep**2)
        for k in range(count):
            drift = keep * drift + fresh[k] if k else drift
            noisy[k] += errors.slow * drift
    sightings = width // columns
    far = rng.random((count, sightings)) < errors.outliers
    jump = rng.uniform(10.0, 60.0, (count, sightings, 1)) * errors.white
    way = rng.normal(size=(count, sightings, columns))
    way /= np.linalg.norm(way, axis=-1, keepdims=True)
    noisy += np.where(far[..., None], jump * way, 0.0).reshape(count, width)
    if errors.pixel:
        noisy = errors.pixel * np.round(noisy / errors.pixel)
    lost = rng.random((count, sightings)) < errors.lost
    for length in errors.bursts:
        begin = int(rng.integers(6, max(count - length - 6, 7)))
        lost[begin : begin + length, int(rng.integers(sightings)) if rng.random() < 0.5 else slice(None)] = True
    lost[:5] = False
    noisy[np.repeat(lost, columns, axis=1)] = np.nan
    return np.round(noisy, 8)


def stated_noise(drawn: Drawn) -> float | None:
    """What the recording says of its noise [m], three digits; None where it says nothing."""
    factor = {"right": 1.0, "double": 2.0, "half": 0.5, "missing": None}[drawn.stated]
    return None if factor is None else float(f"{factor * drawn.errors.fast:.3g}")


def stated_errors(rng: np.random.Generator, errors: Errors) -> dict[str, float | None]:
    """What the recording says of its masses, radii and stamps, each in about half of the cases.

    Masses and radii are said to be as uncertain as they usually are, whether or not these ones are off.
    """
    mass, radius, time = rng.random(3) < OFTEN
    return {
        "mass_error": MASSES if mass else None, "radius_error": RADII if radius else None,
        "time_noise": errors.jitter if time and errors.jitter else None,
    }  # fmt: skip


def with_statements(
    recording: Recording, noise: float | None, said: dict[str, float | None], angles: bool
) -> Recording:
    """The recording with what it says of its errors."""
    return replace(
        recording, title="real-life case", position_noise=None if angles else noise,
        angle_noise=noise if angles else None, mass_error=said["mass_error"], radius_error=said["radius_error"],
        time_noise=said["time_noise"],
    )  # fmt: skip


def real_bodies_case(seed: int, secret: bytes, effect: str | None = None) -> Case:
    """Bodies under real-life conditions. ``effect``: a mechanism, or "null", instead of a drawn one.

    Streams: ``public`` (apparatus, first guesses), ``sealed`` (what is concealed and added), ``noise``, ``statements``
    (what the recording says of its errors).
    """
    kind = "real-life"
    public = generator(secret, kind, seed, "public")
    drawn_setup = draw_setup(public)
    t = np.array([float(f"{x:.7f}") for x in drawn_setup.t])
    setup = replace(drawn_setup, scene=rounded(drawn_setup.scene), t=t, noise=float(f"{drawn_setup.noise:.3g}"))
    sealed = generator(secret, kind, seed, "sealed")
    rate = 1 / float(np.median(np.diff(t)))
    drawn = draw_errors(sealed, setup.noise, rate, len(t))
    truth = draw_truth(sealed, setup)
    start = World(setup.scene, [], setup.dt).start()
    null = bool(sealed.random() < NULL)
    found = None
    if effect not in ("null", "none") and (effect is not None or not null):
        found = draw_effects(truth, drawn.errors, start, sealed, effect)
    sigma = second = 0.0
    if found is not None:
        truth, sigma, second = found
    response = Response(truth, drawn.errors, start)
    noise = generator(secret, kind, seed, "noise")
    stamps, values = filmed(setup, truth.scene, truth.effects, start, drawn.errors, noise)
    belief = _believed(replace(setup, t=stamps), values, public)
    recording = as_recording(replace(setup, t=stamps), belief, values, f"{kind}-{seed}", True)
    said = stated_errors(generator(secret, kind, seed, "statements"), drawn.errors)
    recording = with_statements(recording, stated_noise(drawn), said, setup.angles)
    sealed_truth = {
        **told(kind, seed, setup.name, truth, response, sigma, second, said),
        "errors": asdict(drawn.errors), "stated": drawn.stated, "frames": len(t), "bodies_in_all": len(setup.mobile),
    }  # fmt: skip
    return Case((recording,), plain(sealed_truth))


def _believed(setup: Setup, values: np.ndarray, rng: np.random.Generator):
    """The experimenter's scene: adjustable numbers fitted to what is seen (single outliers left out), or guessed."""
    clean = values.copy()
    for c in range(values.shape[1]):
        column = values[:, c]
        rows = np.flatnonzero(np.isfinite(column))
        second = np.abs(np.diff(column[rows], 2))
        far = rows[1:-1][second > 12 * max(float(np.median(second)), 1e-12)]
        clean[far, c] = np.nan
    return believed_scene(setup, clean, rng)


def told(
    kind: str, seed: int, setup: str, truth: Truth, response: Response, sigma: float, second: float,
    said: Mapping[str, float | None],
) -> dict[str, Any]:
    """What is sealed of a case of bodies, but for the noise."""
    places = truth.places
    effects = [truth.effect(p) for p in places]
    believed, ideal = response.believed(), response.ideal()
    names = everywhere(truth.setup)
    rivals = {p: response.rivals(p, names) for p in places}
    allowed = Response(truth, response.errors.allowed(), response.start)
    return {
        "kind": kind, "seed": seed, "setup": setup, "category": "mechanism" if effects else "null",
        "effects": [asdict(e) for e in effects], "sigma": sigma, "second_sigma": second,
        "believed": [asdict(believed[p]) if p in believed else None for p in places],
        "ideal": [asdict(ideal[p]) for p in places],
        "radii": {b.id: b.radius for b in truth.setup.scene.bodies if b.id in truth.setup.mobile},
        "rivals": rivals.get("first", {}), "second_rivals": rivals.get("second", {}),
        "mass": dict(truth.mass), "radius": dict(truth.radius), "scale": truth.scale,
        "tilt": truth.tilt, "gravity": has_gravity(truth.setup),
        "left": allowed.remains(said["mass_error"], said["radius_error"]), "left_held": allowed.remains(),
        "pin_length": pin_length(truth.setup),
        "bodies": sorted({b for e in effects for b in (e.bodies or truth.setup.mobile)}),
    }  # fmt: skip


def everywhere(setup: Setup) -> tuple[str, ...]:
    """All that may be named in place of an effect of this apparatus."""
    beside = () if setup.scene.laws_named("drive") else (*DRAGS, "added_mass")
    cameras = () if setup.angles else ("camera_scale",)
    names = dict.fromkeys((*setup.candidates, *setup.cameras, *cameras, *beside))
    return tuple(n for n in names if n not in OUTSIDE)

