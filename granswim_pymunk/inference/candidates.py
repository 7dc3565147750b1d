"""Candidates for what was left out: laws from the registry, a changed contact, and the apparatus.

A candidate is made of a law's own declaration: its numeric choices are enumerated, the parameters with a
typical size are fitted, the rest keep their defaults.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..joints import arm_of
from ..laws import AUTOMATIC, Law, all_laws
from ..scene import LawUse, Scene, use
from ..scene.parts import STANDARD_GRAVITY
from .camera_terms import camera_terms
from .criteria import current
from .data import HOLDING, Case, driven, falls, layers_seen, sinks_evenly, with_gravity
from .driven_terms import driven_forms, driven_terms
from .hypothesis import Free, Term, set_numbers
from .mechanisms import RESTITUTION
from .swimmer_terms import swimmer_terms

# roles of laws that pull towards a vector, -c (v - u) or -k (r - a): linear in c and c u
ABOUT = ("medium", "tether")


def distinct_bodies(cases: Sequence[Case]) -> list[tuple[str, float, float]]:
    """Mobile bodies of all recordings: id, radius, mass; the same three are one body. A "ball" may be another."""
    every = [(b.id, b.radius, b.mass) for c in cases for b in c.recording.scene.bodies if b.mobile]
    return list(dict.fromkeys(every))


def names_of(cases: Sequence[Case]) -> list[str]:
    """Ids of the mobile bodies of all recordings, each once."""
    return list(dict.fromkeys(name for name, _, _ in distinct_bodies(cases)))


def weighed(cases: Sequence[Case]) -> bool:
    """Whether gravity moves a body that nothing holds, in any of the recordings."""
    return any(falls(case.recording.scene) for case in cases)


def lightest(error: float | None = None) -> float:
    """The lowest added mass, in units of the mass, of a body whose mass is known: as far as believed masses are off.

    error : standard deviation of a believed mass, relative, where it was stated
    """
    return -current().candidates.believed * (current().candidates.unstated if error is None else error)


def _lightest_of(cases: Sequence[Case]) -> float:
    """The same where masses are known: by what was stated of them, or as gravity acts on mass and inertia alike.

    -inf where nothing was stated and something else moves the bodies, to which mass is all that inertia is.
    """
    stated = [c.recording.mass_error for c in cases if c.recording.mass_error is not None]
    return lightest(max(stated)) if stated else lightest() if weighed(cases) else -math.inf


def _radius_power(choice: Mapping[str, Any]) -> float:
    return float(choice.get("p", 0.0))


def law_terms(law: Law, cases: Sequence[Case], *, each: bool) -> list[Term]:
    """Terms that add this law: one for each combination of its choices.

    ``each``: a strength for every distinct body instead of one for all, scaled by radius.
    """
    bodies = [b for b in names_of(cases) if any(b not in driven(c.recording.scene) for c in cases)]
    if not bodies:
        return []  # every motion is commanded: no force shows
    radii = np.array([radius for name, radius, _ in distinct_bodies(cases) if name in bodies])
    combinations = _combinations(law, alike=bool(np.ptp(radii) == 0) or each)
    terms = []
    # strengths first: what shapes a law follows them
    fitted = sorted((p for p in law.parameters if p.typical is not None), key=lambda p: p.name not in law.strength)
    given = constants(law, cases)
    about = places_about(cases) if any(p.within == "tracks" for p in fitted) else None
    steepest = 1.0 / max(extent_of(cases), 1e-9) if any(p.within == "lean" for p in fitted) else math.inf
    fastest = fastest_of(cases) if any(p.within == "speed" for p in fitted) else math.inf
    thin, wide = layers_seen(law, cases) if any(p.within == "sight" for p in fitted) else (0.0, math.inf)
    least = _lightest_of(cases)
    heavy = with_gravity(cases)
    for choice, stretch in itertools.product(combinations, _stretches(law)):
        r0 = float(radii.mean())
        free: list[Free] = []
        groups: list[tuple[str, tuple[int, ...]]] = []
        owners: list[Any] = [None]
        if each:
            owners = list(joints_by_body(cases)) if law.kind == "joint" else bodies
        for owner in owners:
            where = None if owner is None else frozenset(c.name for c in cases if owner in c.recording.scene.ids)
            for p in fitted:
                start = len(free)
                inner = p.name not in law.strength
                grown = r0 / current().candidates.radius if p.unit == "m" else 1.0
                typical = float(p.typical or 0.0) * grown * stretch if inner else 0.0
                scale = current().candidates.step * abs(typical) if inner else 1.0
                low, high = (-fastest, fastest) if p.within == "speed" else (p.low, p.high)
                if p.within == "weight":
                    # a mass that halves makes no more sense than one that doubles
                    low = max(low, least, 1.0 / (1.0 + p.high) - 1.0)
                elif p.within == "lean":
                    low, high = max(low, -steepest), min(high, steepest)
                elif p.within == "sight":
                    low, high = max(low, thin), min(high, wide)
                    # begun at one of its bounds it would not be known to have ended there
                    typical = typical if low < typical < high else min(2 * low, 0.5 * (low + high)) or 0.5 * high
                for axis, argument in enumerate(p.arguments):
                    if p.within == "tracks" and about is not None:
                        typical, far = about[0][axis], current().candidates.farthest * about[1]
                        scale, low, high = current().candidates.step * about[1], typical - far, typical + far
                    name = f"{law.name}.{argument}" + (f"[{owner}]" if owner else "")
                    ordinary = 0.0 if inner else p.ordinary
                    # gravity acts on mass and inertia alike: how heavy a body is does not show there
                    usual = 0.0 if inner or (p.within == "weight" and heavy) else p.usual
                    free.append(
                        Free(name, p.unit, low, high, typical, scale, where, typical, inner=inner, ordinary=ordinary,
                             usual=usual)
                    )  # fmt: skip
                groups.append((p.name, tuple(range(start, len(free)))))
        label = f"{law.mechanism} {law.form}".strip()
        label += "".join(f" {k}={v:g}" for k, v in choice.items() if len(combinations) > 1)
        terms.append(
            Term(
                mechanism=law.mechanism,
                label=label + (" (each body)" if each else ""),
                free=tuple(free),
                apply=_LawAdder(law, fitted, dict(choice), owners, r0, given),
                bodies=tuple(bodies),
                expression=law.expression,
                choices=dict(choice),
                law=law.name,
                suited=suited(law, cases),
                fixed={name: (value, law.parameter(name).unit) for name, value in given.items()},
                groups=tuple(groups),
            )
        )
    return terms


def _combinations(law: Law, *, alike: bool) -> list[dict[str, Any]]:
    """All values that the numeric choices of a law may have together; ``alike``: powers of radius and mass are none."""
    choices = [(p.name, p.choices) for p in law.parameters if p.choices and not isinstance(p.choices[0], str)]
    combinations = [
        dict(zip([n for n, _ in choices], values, strict=True))
        for values in itertools.product(*[c for _, c in choices])
    ]
    if not alike:
        return combinations
    powers = {p.name: p.choices[0] for p in law.parameters if p.choices and not p.always}
    return [c for c in combinations if all(v == powers.get(k, v) for k, v in c.items())]


def _stretches(law: Law) -> tuple[float, ...]:
    """From how many times its typical size a range or an exponent is looked for."""
    if law.role in (*ABOUT, "beat") or law.candidate == "flexible" or law.form_of:
        # its signature finds the flow, the point or the frequency itself; a form bends wherever it begins, or where the
        # other ends
        return (1.0,)
    shapes = [p for p in law.parameters if p.typical is not None and p.name not in law.strength and not p.within]
    if not shapes:
        return (1.0,)
    criteria = current().candidates
    return criteria.ranges if any(p.unit == "m" for p in shapes) else criteria.shapes


def constants(law: Law, cases: Sequence[Case]) -> dict[str, Any]:
    """Values of parameters that are not fitted but belong to the recordings.

    Sizes of forms without a name, from the training parts; of a joint's law the rate below which it is smooth.
    """
    if law.kind == "joint":
        return _smooth_below(law, cases)
    if law.candidate not in ("flexible", "beside"):
        return {}
    names = {p.name for p in law.parameters}
    result: dict[str, Any] = {}
    cases = [case for case in cases if not case.held_out]
    if "top" in names:
        result["top"] = current().candidates.top * fastest_of(cases)
    if "begin" in names:
        begin = min(float(c.t[c.training][0]) for c in cases)
        end = max(float(c.t[c.training][-1]) for c in cases)
        result["begin"], result["span"] = begin, max(end - begin, 1e-9)
    if "centre" in names:
        # of a place along a rail, or of one coordinate, the other one is where it is believed
        every = _places_of(cases)
        if len(every):
            result["centre"] = tuple(float(v) for v in every.mean(axis=0))
            result["size"] = float(max(np.ptp(every, axis=0).max() / 2, 1e-9))
    return {name: value for name, value in result.items() if name in names}


def _smooth_below(law: Law, cases: Sequence[Case]) -> dict[str, Any]:
    """Rates [rad/s] below which a law of joints is smooth, those at which the law it stands for becomes smooth [m/s].

    Where a body hangs from one joint both are then the same law, and the data cannot prefer either.
    """
    speeds = [
        float(p.default) for name in law.stands_for for p in all_laws()[name].parameters
        if p.unit == "m/s" and p.size == 1 and p.default is not None
    ]  # fmt: skip
    rates = [p.name for p in law.parameters if p.unit == "rad/s" and p.default is not None]
    arms = [
        arm_of(c.recording.scene, b) for c in cases for name in law.preferred_where
        for item in c.recording.scene.laws_named(name) for b in (item.bodies or ())[-1:]
    ]  # fmt: skip
    if not speeds or not arms or min(arms) <= 0:
        return {}
    return {name: speeds[0] / float(np.mean(arms)) for name in rates}


def fastest_of(cases: Sequence[Case]) -> float:
    """How fast bodies moved in the training parts, along one axis [m/s]; a hundredth of the steps may be faster."""
    fastest = 1e-12
    for case in cases:
        if case.held_out:
            continue
        dt, values = np.diff(case.t[case.training]), case.values[case.training]
        for k, channel in enumerate(case.channels):
            arm = arm_of(case.recording.scene, channel.body) if channel.kind == "angle" else 1.0
            step = np.abs(np.diff(values[:, k])) / dt * arm
            step = step[np.isfinite(step)]
            fastest = max(fastest, float(np.quantile(step, current().candidates.fastest)) if len(step) else 0.0)
    return fastest


def places_about(cases: Sequence[Case]) -> tuple[tuple[float, float], float] | None:
    """The middle (x, y) of all tracks in the training parts, and how far they went from it [m]; None where none did."""
    every = _places_of(cases)
    if len(every) < current().candidates.places:
        return None
    middle, extent = every.mean(axis=0), extent_of(cases)
    return ((float(middle[0]), float(middle[1])), extent) if extent > 0 else None


def extent_of(cases: Sequence[Case]) -> float:
    """How far tracks of the training parts went from the middle of all of them [m], 0 where none did."""
    every = _places_of(cases)
    away = every - every.mean(axis=0) if len(every) else every
    return float(np.hypot(*away.T).max(initial=0.0))


def _places_of(cases: Sequence[Case]) -> np.ndarray:
    """(k, 2) all places in the training parts; along a rail with the other coordinate where it is believed."""
    places = [c.recording.on_rails().xy[c.training].reshape(-1, 2) for c in cases if not c.held_out]
    every = np.concatenate(places) if places else np.zeros((0, 2))
    return every[np.isfinite(every).all(axis=1)]


class _LawAdder:
    """Adds a law to a scene with the values found; the mean radius is that of all recordings together."""

    def __init__(self, law, fitted, choice, owners, r0, fixed) -> None:
        self.law, self.fitted, self.choice, self.owners, self.r0, self.fixed = law, fitted, choice, owners, r0, fixed

    def __call__(self, scene: Scene, camera: Mapping[str, Any], values: Sequence[float] | np.ndarray):
        led = driven(scene)
        width = sum(p.size for p in self.fitted)
        for k, owner in enumerate(self.owners):
            if owner is not None and (owner not in scene.ids or owner in led):
                continue
            mine = list(values[k * width : (k + 1) * width])
            given: dict[str, Any] = dict(self.choice) | self.fixed
            at = 0
            for p in self.fitted:
                numbers = [float(v) for v in mine[at : at + p.size]]
                at += p.size
                given[p.name] = numbers[0] if p.size == 1 else tuple(numbers)
            bodies = None if owner is None else [owner]
            if owner is not None and self.law.kind == "joint":
                bodies = next((list(b) for b in scene.joints_of.values() if b[-1] == owner), None)
                if bodies is None:
                    continue
            if owner is None and led:
                bodies = [b.id for b in scene.bodies if b.mobile and b.id not in led]
            acting = [b.radius for b in scene.bodies if b.mobile and (bodies is None or b.id in bodies)]
            power = _radius_power(self.choice)
            if owner is None and power and acting:
                factor = (float(np.mean(acting)) / self.r0) ** power
                for name in self.law.strength:
                    given[name] = given[name] * factor
            scene = scene.with_laws(use(self.law, bodies=bodies, **given))
        return scene, camera


def _contact_terms(cases: Sequence[Case]) -> list[Term]:
    """Contacts that lose more, or less, than believed: all, and beside other bodies those with straight walls alone."""
    scene = cases[0].recording.scene
    adjustable = {a.name for a in scene.adjustable}
    terms = []
    for item in {i.name: i for i in reversed(scene.laws_as("contact"))}.values():
        everywhere, walls = item.law.loses, item.law.loses_at_walls
        acting = item.bodies or tuple(b.id for b in scene.bodies if b.mobile)
        asked: list[tuple[str, ...]] = [(everywhere,)]
        # a cushion is no ball; of one body alone the walls are all it meets, and no number of their own is needed
        apart = walls and (len(acting) > 1 or item.values[walls] is not AUTOMATIC)
        if apart and all(c.recording.scene.walls for c in cases):
            asked += [(walls,), (everywhere, walls)]
        for names in asked:
            if not adjustable & {f"{item.name}.{name}" for name in names}:
                label = RESTITUTION if names == (everywhere,) else f"{RESTITUTION} ({', '.join(names)})"
                terms.append(_loss_term(scene, item, names, label, acting))
    return terms


def _loss_term(scene: Scene, item: LawUse, names: Sequence[str], label: str, acting: tuple[str, ...]) -> Term:
    """Other numbers of a contact that say what it loses; those of walls are equal to that of bodies where not given."""
    criteria, free = current().candidates, []
    for name in names:
        lost, believed = item.law.parameter(name), float(scene.resolved(item)[name])
        scale = criteria.loss * max(believed, criteria.kept)
        follows = f"{item.name}.{item.law.loses}" if item.values[name] is AUTOMATIC else ""
        free.append(
            Free(
                f"{item.name}.{name}", lost.unit, 0.0, lost.high, believed, scale, None, believed, natural=True,
                follows=follows,
            )
        )  # fmt: skip
    return Term(
        RESTITUTION, label, tuple(free), set_numbers([f.name for f in free]), bodies=acting,
        expression=item.law.expression, groups=tuple((name, (k,)) for k, name in enumerate(names)),
    )  # fmt: skip


def joints_by_body(cases: Sequence[Case]) -> dict[str, tuple[str, ...]]:
    """Pins and hinges by the body that hangs from each, the ids that name the joint; empty where one bears two."""
    found: dict[str, tuple[str, ...]] = {}
    for case in cases:
        for bodies in case.recording.scene.joints_of.values():
            if not bodies or found.get(bodies[-1], bodies) != bodies:
                return {}
            found[bodies[-1]] = bodies
    return found


def _is_simple(law: Law) -> bool:
    """A law on single bodies whose fitted numbers are all strengths: it may have one strength for each body.

    More inertia, too: of several carts one may be heavier than it is believed to be. Not a field, which has a
    direction: a tilt or a stream is that of the place, not of the body.
    """
    fitted = [p for p in law.parameters if p.typical is not None]
    single = law.kind in ("body", "constraint") and all(p.size == 1 for p in fitted)
    return single and {p.name for p in fitted} == set(law.strength)


def _is_push(law: Law) -> bool:
    """A force that asks nothing of its body but the mass: one body may be pushed and the others not."""
    own = {a for p in law.parameters for a in p.arguments}
    return law.kind == "body" and set(law.arguments) <= {"mass"} | own


def _is_inertia(law: Law) -> bool:
    """A fixed share of the force, as by what a body carries: one may be loaded and the others not.

    Where nothing but impacts moves them, only masses over one another are told: a number for each says no more.
    """
    return law.kind == "constraint" and law.linear and _is_simple(law)


def suited(law: Law, cases: Sequence[Case]) -> bool:
    """Whether a law is declared for an apparatus that a recording has: joint drag for a pin."""
    return any(c.recording.scene.laws_named(name) for c in cases for name in law.preferred_where)


def has_its_joints(law: Law, cases: Sequence[Case]) -> bool:
    """Whether a law of joints has pins or hinges to act in: a rod turns freely at both ends. True of other laws."""
    return law.kind != "joint" or any(c.recording.scene.joints_of for c in cases)


def out_of_place(law: Law, cases: Sequence[Case]) -> bool:
    """Whether a law makes no sense for the apparatus: a richer form of one that another law stands for there.

    Where every body hangs from a pin or hinge, what a stream in still air would be is the drag of the joint. And what
    rubs by its weight on a substrate has none there: with one joint, where it is the friction of the joint in other
    numbers, it stays as its rival; with several it is another law, of an apparatus that is not this one. A stream whose
    drag is not linear has its place where bodies fly. Along a rail what blows across makes the drag anything from a
    square to a line, and nobody sees it; over a table a slow one is a drag and a slope. What flies has no substrate,
    and nothing else has lift. What sinks at an even speed is borne by a drag: whatever does not ask for speeds would be
    as large as its weight by chance.
    """
    asks = law.kind != "body" or (law.role != "place" and bool({"vx", "vy"} & set(law.arguments)))
    if not asks and all(sinks_evenly(c) for c in cases if not c.held_out):
        return True
    rubs, lifts = law.damping and "g" in law.arguments, law.role == "across" and law.candidate == "named"
    scenes = [c.recording.scene for c in cases]
    if rubs and all(_flies(s, hung=bool(s.laws_as("bar"))) for s in scenes):
        return True
    if lifts and not all(map(_flies, scenes)):
        return True
    # what goes round a pin, or along a rail, takes up a force across its motion, of which rounding alone shows
    kept = [name for name, other in all_laws().items() if other.role in ("pendulum", "guide")]
    if law.role == "across" and all(_holds_all(s, kept) for s in scenes):
        return True
    held: set[str] = set()
    for other in all_laws().values():
        if suited(other, cases) and all(_holds_all(c.recording.scene, other.preferred_where) for c in cases):
            held |= set(other.stands_for)
    rails = [name for name, other in all_laws().items() if other.role == "guide"]
    across = law.role == "medium" and not law.linear
    if across and (not with_gravity(cases) or all(_holds_all(c.recording.scene, rails) for c in cases)):
        return True
    by_weight = rubs and len(joints_by_body(cases)) > 1
    richer = {*law.nests, *all_laws().get(law.mechanism, law).nests}
    return bool(held & richer) or (by_weight and law.name in held)


def _flies(scene: Scene, hung: bool = False) -> bool:
    """Whether bodies fall in the picture's plane, or hang from rods, with nothing in it that could bear their weight.

    What a command moves is not asked: a load that hangs from a trolley has no substrate, whatever the trolley has.
    hung : whether what hangs from a pin or hinge does, too
    """
    steep = math.hypot(*scene.gravity) > current().apparatus.steep * STANDARD_GRAVITY
    borne = ("guide", "tether") if hung else ("pendulum", "pivot", "guide", "tether")
    held = {b for item in scene.laws_as(*borne) for b in item.bodies or scene.ids}
    led = driven(scene)
    return steep and not scene.walls and not any(b.mobile and b.id in held and b.id not in led for b in scene.bodies)


def may_hold(law: Law, cases: Sequence[Case]) -> bool:
    """Whether a brake can show that it holds: where it is declared to, and no hinge or rod is.

    Where bodies hang from pins, friction is that of the pin. True of other laws.
    """
    if law.role != "brake":
        return True
    scenes = [c.recording.scene for c in cases]
    hung = any(s.joints_of for s in scenes) and not law.refines
    return suited(law, cases) and not hung and not any(s.links for s in scenes)


def in_contact_alone(term: Term) -> bool:
    """Whether all that a term changes acts only while bodies touch."""
    laws = [all_laws().get(f.name.partition(".")[0]) for f in term.free]
    return bool(laws) and all(
        law is not None and (law.kind == "impulse" or (law.kind == "pair" and not law.reach)) for law in laws
    )


def is_damping(term: Term) -> bool:
    """Whether a term is a drag or friction of one strength."""
    law = all_laws().get(term.law)
    return law is not None and law.damping and len(term.free) == 1


def _holds_all(scene: Scene, names: Sequence[str]) -> bool:
    """Whether every mobile body is in one of the laws of these names."""
    bodies = {b for name in names for item in scene.laws_named(name) for b in item.bodies or scene.ids}
    return all(b.id in bodies for b in scene.bodies if b.mobile)


def named_terms(cases: Sequence[Case], *, each: bool = True) -> list[Term]:
    """All candidates that have a name, apparatus first."""
    terms = camera_terms(cases) + _contact_terms(cases) + driven_terms(cases, each=each)
    scenes = [c.recording.scene for c in cases]
    terms += swimmer_terms(scenes) if any(s.chains for s in scenes) else []
    several = len(names_of(cases)) > 1
    kinds = ("body", "pair", "joint", "constraint")
    for law in all_laws().values():
        if law.candidate != "named" or law.kind not in kinds or not has_its_joints(law, cases):
            continue
        if not applies(law, cases) or out_of_place(law, cases) or not may_hold(law, cases):
            continue
        terms += [_unlevel(t, law, cases) for t in law_terms(law, cases, each=False)]
        if several and each and (_is_simple(law) if law.kind != "joint" else len(joints_by_body(cases)) > 1):
            terms += law_terms(law, cases, each=True)
        if several and each and (_is_push(law) or _is_inertia(law)):
            terms += _on_one_body(law, cases)
    return terms


def beside_terms(cases: Sequence[Case]) -> list[Term]:
    """Candidates that have a name, and stand beside another law alone: the surface on which bodies slide is curved.

    Not where something holds a body to a place, whose strength it would be, nor of what flies or swims.
    """
    if not _slide(cases, "guide"):
        return []
    laws = [law for law in all_laws().values() if law.candidate == "beside" and applies(law, cases)]
    return [t for law in laws for t in law_terms(law, cases, each=False)]


def unseen_terms(cases: Sequence[Case], *roles: str) -> list[Term]:
    """Forces of what nobody sees, for all bodies alike: asked where nothing that is seen explains.

    roles : "source", from a place at which nothing is seen;  "beat", at one frequency
    """
    laws = [law for law in all_laws().values() if law.role in roles and applies(law, cases)]
    return [t for law in laws if not out_of_place(law, cases) for t in law_terms(law, cases, each=False)]


def _unlevel(term: Term, law: Law, cases: Sequence[Case]) -> Term:
    """The term, if it is what a table does that is not level, with the size up to which nobody notices that."""
    if law.role != "push" or with_gravity(cases):
        return term
    slope = current().apparatus.off_level * STANDARD_GRAVITY
    return replace(term, free=tuple(replace(f, unseen=slope) for f in term.free))


def _on_one_body(law: Law, cases: Sequence[Case]) -> list[Term]:
    """A push on a single body, or more inertia, for each of a few."""
    terms = []
    for together in law_terms(law, cases, each=True):
        names = owners(together)
        single = 1 < len(names) <= current().candidates.single
        alone = [(name, for_bodies(together, [name])) for name in names if single]
        terms += [replace(found[0], label=f"{law.mechanism} on {name}") for name, found in alone if found is not None]
    return terms


def applies(law: Law, cases: Sequence[Case]) -> bool:
    """Whether a law has anything to act on: a swimmer, a second body, the pin or springs whose numbers it needs."""
    scenes = [case.recording.scene for case in cases]
    if any(p.within == "tracks" for p in law.parameters) and not _may_be_tied(law, cases):
        return False
    return any(scene.admits(law) for scene in scenes if law.kind != "chain" or scene.chains)


def _may_be_tied(law: Law, cases: Sequence[Case]) -> bool:
    """Whether a body may be drawn to a place that the scene does not know: it is not held, nor flies nor swims.

    What hangs, slides along a rail or has a spring already moves about a place that is believed; a bed pushes back.
    Several bodies have no spring in common, but a magnet below the table.
    """
    if law.role == "tether" and len(names_of(cases)) > 1:
        return False
    return _slide(cases) and places_about(cases) is not None


def _slide(cases: Sequence[Case], *along: str) -> bool:
    """Whether bodies slide or roll, and none flies, swims or is held; laws with the roles ``along`` hold none."""
    scenes = [c.recording.scene for c in cases]
    held = any(s.laws_as(role) for s in scenes for role in HOLDING if role not in along)
    return not held and not any(s.chains or s.periodic_x or s.bed is not None or _flies(s) for s in scenes)


def flexible_terms(cases: Sequence[Case], *, each: bool = False) -> list[Term]:
    """The forms that name nothing: smooth force fields in speed and in place, answers of motors to their commands.

    ``each``: with numbers for every body.
    """
    terms = [] if each else driven_forms(cases)
    for law in all_laws().values():
        if law.candidate == "flexible" and law.series is None and not out_of_place(law, cases):
            terms += law_terms(law, cases, each=each)
    return terms


def asked_terms(cases: Sequence[Case], own: Sequence[str] = ()) -> list[Term]:
    """Forms without a name that are held beside a law, in numbers that no data have shaped: linear in each of them.

    Series to first order, shapes held at values that no law with a name has (``Parameter.asked``).
    own : bodies with a strength each; of one strength for all where empty
    """
    terms: list[Term] = []
    for term in flexible_terms(cases, each=bool(own)):
        law = all_laws()[term.law]
        if law.form_of:
            continue  # what it asks is asked in that law's numbers
        part = for_bodies(term, own) if own else (term, ())
        if part is None:
            continue
        term = part[0]
        names = [f.name.rpartition(".")[2].partition("[")[0] for f in term.free]
        asked = {name: p.asked for p in law.parameters for name in p.arguments if p.asked}
        kept = [k for k, name in enumerate(names) if name not in asked and (name in law.low_order or not law.low_order)]
        for values in itertools.product(*asked.values()):
            held = dict(zip(asked, values, strict=True))
            free = tuple(replace(f, neutral=held.get(n, f.neutral)) for f, n in zip(term.free, names, strict=True))
            whole = replace(term, free=free)
            terms.append(with_numbers(whole, kept) if len(kept) < len(free) else whole)
    return terms


def rescaled(term: Term, scales: Sequence[float], firsts: Sequence[float]) -> Term:
    """The term with other scales and first values of its numbers."""
    free = tuple(
        replace(f, scale=float(s), first=float(np.clip(v, f.low, f.high)))
        for f, s, v in zip(term.free, scales, firsts, strict=True)
    )
    return replace(term, free=free)


def scaled_like(term: Term, other: Term) -> Term:
    """The term with the scales that numbers of the same names have in another form of it."""
    scales = {f.name: f.scale for f in other.free}
    return replace(term, free=tuple(replace(f, scale=scales.get(f.name, f.scale)) for f in term.free))


class _Partly:
    """Applies a term with some of its numbers; the others stay where the law is absent."""

    def __init__(self, term: Term, kept: Sequence[int]) -> None:
        self.term = term
        self.kept = tuple(kept)

    def __call__(self, scene: Scene, camera: Mapping[str, Any], values: Sequence[float] | np.ndarray):
        full = [f.neutral for f in self.term.free]
        for k, value in zip(self.kept, values, strict=True):
            full[k] = float(value)
        return self.term.apply(scene, camera, full)


def with_numbers(term: Term, kept: Sequence[int]) -> Term:
    """The term with only some of its numbers free."""
    new = {k: n for n, k in enumerate(kept)}
    groups = tuple(
        (name, tuple(new.get(k, -1) for k in rows)) for name, rows in term.groups if any(k in new for k in rows)
    )
    return replace(term, free=tuple(term.free[k] for k in kept), apply=_Partly(term, kept), groups=groups)


class _Along:
    """Applies a term of which one number stands for the components of a vector, of that size along a direction."""

    def __init__(self, term: Term, rows: Sequence[int], direction: np.ndarray) -> None:
        self.term, self.rows, self.direction = term, tuple(rows), direction

    def __call__(self, scene: Scene, camera: Mapping[str, Any], values: Sequence[float] | np.ndarray):
        first, full = self.rows[0], list(values)
        full[first : first + 1] = [float(values[first]) * float(part) for part in self.direction]
        return self.term.apply(scene, camera, full)


def along_only(term: Term, rows: Sequence[int], direction: np.ndarray) -> Term:
    """The term with one number in place of the components of a vector: its size along a unit direction.

    For data that see no other part of it: of a push on a body on a rail, what points along the rail. Any component
    across would do, so that none of the vector's own is known; nought is the shortest.
    rows : of the components, one behind the other
    """
    first = rows[0]
    name = next(name for name, mine in term.groups if first in mine)
    law, bracket, owner = term.free[first].name.partition(".")[0], *term.free[first].name.partition("[")[1:]
    size = replace(term.free[first], name=f"{law}.{name}{bracket}{owner}")
    free = (*term.free[:first], size, *term.free[rows[-1] + 1 :])
    fewer = len(rows) - 1
    groups = tuple(
        (n, (first,) if first in mine else tuple(r - fewer if r > first else r for r in mine))
        for n, mine in term.groups
    )
    told = {**term.along, size.name: tuple(float(part) for part in direction)}
    return replace(term, free=free, apply=_Along(term, rows, direction), groups=groups, along=told)


def for_bodies(term: Term, bodies: Sequence[str]) -> tuple[Term, list[int]] | None:
    """A term that has a strength for each body, for some of them only, and which of its numbers those are."""
    numbers = [k for k, f in enumerate(term.free) if any(f.name.endswith(f"[{b}]") for b in bodies)]
    if not numbers:
        return None
    present = tuple(b for b in owners(term) if b in bodies)
    return replace(with_numbers(term, numbers), bodies=present), numbers


def owners(term: Term) -> list[str]:
    """Bodies that have a strength of their own in this term."""
    names = [f.name[f.name.index("[") + 1 : -1] for f in term.free if f.name.endswith("]")]
    return list(dict.fromkeys(names)) if term.mechanism not in ("adjustable",) else []
