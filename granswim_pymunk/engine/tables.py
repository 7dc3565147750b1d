"""From the laws of a scene to the tables by which compiled code, and the Python mode, apply them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..errors import InputError
from ..laws import Law
from ..scene import Body, LawUse, Scene
from .callbacks import ALONE, CHAINS, HALF_STEP, KIND_ORDER, SCALARS, TOGETHER, USE_COLUMNS, Addresses
from .links import Links, links_of, no_links
from .order import Order
from .state import Bodies, LawTable


@dataclass(frozen=True)
class Joints:
    """Hinges, rods, and the joints that laws act in.

    links : what holds the joined bodies;  apart : joined pairs of inner rows, i < j
    joints : (q, 3) kind (0 a pin, 1 a hinge), inner rows i and j, -1 the world;  at : (q, 2) anchor of a pin [m]
    of_law : the joints that law k of the scene makes
    """

    links: Links
    apart: list[tuple[int, int]]
    joints: np.ndarray
    at: np.ndarray
    of_law: dict[int, list[int]]


@dataclass(frozen=True)
class Uses:
    """The laws that act, in the order in which they do.

    scheme : how dampings see the velocity (``callbacks.HALF_STEP`` ...);  damped : ids of uses taken twice in a step
    eased : constant drags are taken into the mass that the kick divides by
    """

    items: list[LawUse]
    scheme: int
    damped: frozenset[int]
    eased: bool

    def of(self, before: Sequence[LawUse], laws: Sequence[LawUse]) -> Uses | None:
        """The same where the laws ``before`` have other numbers; None where a scene runs others than it lists."""
        place = {id(item): k for k, item in enumerate(before)}
        if len(place) < len(before) or not all(id(item) in place for item in self.items):
            return None
        items = [laws[place[id(item)]] for item in self.items]
        damped = (id(new) for new, old in zip(items, self.items, strict=True) if id(old) in self.damped)
        return Uses(items, self.scheme, frozenset(damped), self.eased)

    @property
    def has_pairs(self) -> bool:
        """Whether a law acts between pairs of bodies."""
        return any(item.law.kind == "pair" for item in self.items)

    def reach(self, scene: Scene) -> float:
        """How far beyond the radii the farthest law of pairs acts [m]."""
        far = [float(scene.resolved(item)[item.law.reach]) for item in self.items if item.law.reach]
        return max([0.0, *far])


def joints_of(scene: Scene, order: Order, bodies: Bodies) -> Joints:
    """The joints of a scene. Joined bodies get the group -1; what rounding leaves open at the start is closed."""
    links = links_of(scene, order.inner) if order.joined else no_links()
    bodies.group[order.joined_at : order.joined_at + len(order.joined)] = -1
    pairs = set()
    for item in scene.links:
        rows = sorted(int(order.inner[scene.ids.index(name)]) for name in item.bodies or ())
        if len(rows) == 2 and rows[0] >= 0:
            pairs.add((rows[0], rows[1]))
            bodies.group[rows] = -1
    close_links(scene, links, bodies)
    joints: list[tuple[int, int, int]] = []
    of_law: dict[int, list[int]] = {}
    for k, names in scene.joints_of.items():
        item = scene.laws[k]
        rows = [int(order.inner[scene.ids.index(name)]) if scene.body(name).mobile else -1 for name in names]
        first = len(joints)
        if item.name == "pin":
            joints += [(0, -1, row) for row in rows]
        else:
            joints.append((1, -1, rows[0]) if len(rows) == 1 else (1, rows[0], rows[1]))
        of_law[k] = list(range(first, len(joints)))
    return Joints(
        links, sorted(pairs), np.array(joints, dtype=np.int64).reshape(-1, 3), anchors_of(scene), of_law
    )


def anchors_of(scene: Scene) -> np.ndarray:
    """(q, 2) where each joint of a scene hangs [m], known of pins alone."""
    places: list[tuple[float, float]] = []
    for k, names in scene.joints_of.items():
        item = scene.laws[k]
        places += [item.values["anchor"]] * len(names) if item.name == "pin" else [(0.0, 0.0)]
    return np.array(places, dtype=float).reshape(-1, 2)


def close_links(scene: Scene, links: Links, bodies: Bodies) -> None:
    """Close what rounding leaves open at the start. Raises InputError where it is more than that."""
    if not len(links.rows):
        return
    q = np.column_stack([bodies.initial[links.rows, :2], bodies.turned[links.rows, 0]])
    closed, worst = links.closed(q)
    if not worst <= 1e-3 * links.size or not np.isfinite(closed).all():
        names = ", ".join(sorted({name for item in scene.links for name in item.bodies or ()}))
        raise InputError(
            f"the bodies ({names}) do not start where hinges and rods hold them: a gap of {worst:.3g} m",
            where="initial",
        )
    bodies.initial[links.rows, :2] = closed[:, :2]
    bodies.turned[links.rows, 0] = closed[:, 2]


def uses_of(scene: Scene, order: Order) -> Uses:
    """The laws that act on bodies with forces, sorted; a pin that is held with hinges and rods is not among them."""
    joined = {scene.bodies[i].id for i in order.joined}
    impulses = any(item.law.kind == "impulse" for item in scene.laws)
    items = [
        item for item in scene.acting
        if item.law.kind in KIND_ORDER and not (item.name == "pin" and joined & set(item.bodies or ()))
        # beside impulses it is one, too: Chipmunk's own friction of the shapes
        and not (impulses and item.name == "contact_friction")
    ]  # fmt: skip
    exact = scene.time.scheme == "exact"
    # a constant drag is a heavier body to the kick, which costs nothing; constraints and impacts want the true mass
    eased = exact and not impulses and not joined and not any(_holds(item.law) for item in items)
    damped = [item for item in items if exact and item.law.damping and not (eased and item.law.linear)]
    late = frozenset(id(item) for item in damped)
    items.sort(key=lambda item: (_place(item, id(item) in late), _constraint_order(item.name)))
    return Uses(items, TOGETHER if damped and joined else _scheme(items, damped), late, eased)


@dataclass(frozen=True)
class Acting:
    """The bodies that a use acts on: sorted inner ``rows``, and r_0 [m], their mean radius."""

    rows: np.ndarray
    mean_radius: float


def acting_of(scene: Scene, order: Order, bodies: Bodies, uses: Uses) -> list[Acting]:
    """Of each use the bodies that it acts on; no number of a law changes that."""
    found = []
    for item in uses.items:
        rows = order.inner[scene.rows(item)]
        rows = np.sort(rows[rows >= 0])
        found.append(Acting(rows, _mean_radius(scene, order, bodies, item, rows)))
    return found


def law_numbers(
    scene: Scene, order: Order, bodies: Bodies, uses: Uses, acting: Sequence[Acting], dt: float
) -> tuple[np.ndarray, list[int]]:
    """Of each use r_0 and its parameters, one use behind the other, and where the parameters of each begin.

    ``bodies.ease`` and ``bodies.kick_mass`` are set to what constant drags make of them.
    """
    rate = np.zeros(order.n)  # kg/s, sum of the constant drags
    share = np.ones(order.n)  # of the force that accelerates, where something is carried along
    numbers, begins = list[float](), list[int]()
    for item, on in zip(uses.items, acting, strict=True):
        numbers.append(on.mean_radius)
        begins.append(len(numbers))
        numbers += item.law.encode(scene.resolved(item))
        if uses.eased and item.law.linear:
            acted = [scene.bodies[i] for i in order.rows_of[on.rows]]
            answers = _linear_answers(scene, item, on.mean_radius, dt, acted)
            if item.law.kind == "body":
                rate[on.rows] += answers
            else:
                share[on.rows] *= 1.0 + answers
    bodies.ease[:] = bodies.mass / (bodies.mass + 0.5 * dt * rate * share)
    bodies.kick_mass[:] = bodies.inverse_mass * bodies.ease * share  # while constraints have not taken their share yet
    return np.array(numbers or [0.0], dtype=float), begins


@dataclass
class _Filling:
    """The tables while one use after the other is put into them."""

    rows: list[int] = field(default_factory=list)
    runs: list[np.ndarray] = field(default_factory=list)
    table: list[list[int]] = field(default_factory=list)
    joint_of: list[int] = field(default_factory=list)


def law_table(
    scene: Scene, order: Order, bodies: Bodies, uses: Uses, acting: Sequence[Acting], joints: Joints,
    compiled: Callable[[Law], Addresses], dt: float, averaged: bool,
) -> LawTable:  # fmt: skip
    """The tables of the laws; ``bodies`` as ``law_numbers`` says.

    compiled : where the functions of a law are;  dt [s];  averaged : contacts count by the share of a step they last
    """
    n, blocks = order.n, order.blocks
    filling = _Filling()
    run_starts = np.zeros((len(uses.items), len(blocks)), dtype=np.int64)
    mask = np.zeros((len(uses.items), n), dtype=np.uint8)
    n_runs = 0
    parameters, begins = law_numbers(scene, order, bodies, uses, acting, dt)
    for u, (item, on) in enumerate(zip(uses.items, acting, strict=True)):
        own_runs = _runs(on.rows, blocks)
        run_starts[u] = n_runs + np.searchsorted(own_runs[:, 0], blocks)
        filling.runs.append(own_runs)
        n_runs += len(own_runs)
        kind = compiled(item.law), id(item) in uses.damped
        _fill(filling, scene, order, joints, item, on.rows, begins[u], kind)
        mask[u, on.rows] = 1
        if item.law.kind == "chain":
            for first, last in order.spans:  # a law acts on whole swimmers: on those of which it names a disk
                mask[u, first:last] = mask[u, first:last].any()
    input_t, input_v, input_at = commands_of(scene, order)
    return LawTable(
        uses=np.array(filling.table, dtype=np.int64).reshape(-1, len(USE_COLUMNS)),
        parameters=parameters,
        rows=np.array(filling.rows or [0], dtype=np.int64),
        runs=np.concatenate([np.zeros((0, 2), dtype=np.int64), *filling.runs]),
        run_starts=run_starts, mask=mask, blocks=blocks, chains=order.spans, joints=joints.joints, joint_at=joints.at,
        joint_of=np.array(filling.joint_of, dtype=np.int64), input_t=input_t, input_v=input_v, input_at=input_at,
        scalars=_scalars(scene, order, averaged, uses.scheme, joints.links.size),
    )  # fmt: skip


def _fill(
    to: _Filling, scene: Scene, order: Order, joints: Joints, item: LawUse, rows: np.ndarray, begins: int,
    kind: tuple[Addresses, bool],
) -> None:  # fmt: skip
    """Add one use: its line of the table, its bodies ``rows`` or joints, and where its parameters begin."""
    acts = _joints_under(scene, order, joints, item) if item.law.kind == "joint" else []
    first, count = (len(to.joint_of), len(acts)) if item.law.kind == "joint" else (len(to.rows), len(rows))
    where, damped = kind
    code = 1 + KIND_ORDER[item.law.kind]
    masked = int(len(rows) < order.n)  # laws of pairs ask it, others have rows
    to.table.append([code, begins, first, first + count, masked, int(damped), *where])
    to.joint_of += acts
    to.rows += rows.tolist()


def _mean_radius(scene: Scene, order: Order, bodies: Bodies, item: LawUse, chosen: np.ndarray) -> float:
    """r_0 [m]: mean radius of the bodies that a law acts on, of the whole scene where a part of it is simulated."""
    if order.n == len(scene.bodies):
        return float(bodies.radius[chosen].mean()) if len(chosen) else 1.0
    return float(np.mean([scene.bodies[i].radius for i in scene.rows(item)] or [1.0]))


def commands_of(scene: Scene, order: Order) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times [s] and values of all commands, and (n, 2) each body's part of them. Raises InputError where one lacks."""
    commands = scene.commands
    times: list[float] = []
    series: list[float] = []
    at = np.zeros((order.n, 2), dtype=np.int64)
    for name, (t, value) in commands.items():
        if name in scene.ids and order.inner[scene.ids.index(name)] >= 0:
            at[order.inner[scene.ids.index(name)]] = len(times), len(times) + len(t)
            times += t
            series += value
    for item in scene.laws_named("drive"):
        for name in item.bodies or ():
            if name not in commands:
                raise InputError(f"no command for body {name} in input.csv", where="law drive")
    return np.array(times or [0.0]), np.array(series or [0.0]), at


def _scalars(scene: Scene, order: Order, averaged: bool, scheme: int, arm: float) -> np.ndarray:
    """``callbacks.SCALARS``"""
    grains = [b.mass for b in scene.bodies if b.role == "grain"]
    simulated = (scene.bodies[i] for i in order.rows_of)
    masses = grains or [b.mass for b in simulated if b.mobile] or [1.0]
    scalars = np.array(
        [scene.periodic_x or 0.0, *scene.gravity, scene.gravity_size, float(np.mean(masses)), float(averaged),
         float(scheme), arm]
    )  # fmt: skip
    assert len(scalars) == len(SCALARS)
    return scalars


def _joints_under(scene: Scene, order: Order, joints: Joints, item: LawUse) -> list[int]:
    """Joints that a law acts in: of those that it names bodies for, those that are simulated."""
    found = [j for k in scene.joints_under(item) for j in joints.of_law[k]]
    wanted = None if item.bodies is None else {int(order.inner[scene.ids.index(b)]) for b in item.bodies}
    table = joints.joints
    return [
        j for j in found
        if (table[j, 0] == 1 or wanted is None or table[j, 2] in wanted)
        and table[j, 2] >= (0 if table[j, 1] < 0 else -1)
    ]  # fmt: skip


def _linear_answers(scene: Scene, item: LawUse, mean_radius: float, dt: float, on: Sequence[Body]) -> np.ndarray:
    """What a linear law does to bodies, by the law itself: c [kg/s] of a force -c (v - u), or what is added to 1 N."""
    if not on:
        return np.zeros(0)
    law = item.law
    known: dict[str, Any] = {
        "r0": mean_radius, "g": scene.gravity_size, "gx": scene.gravity[0], "gy": scene.gravity[1],
        "dt": dt, "t": 0.0, "x": 0.0, "y": 0.0,
        "mean_mass": float(np.mean([b.mass for b in scene.bodies if b.mobile])),
    }  # fmt: skip
    names = [name for p in law.parameters for name in p.arguments]
    known |= dict(zip(names, law.encode(scene.resolved(item)), strict=True))
    arguments = law.arguments

    def force(body: Body, v: float) -> float:
        seen = {**known, "mass": body.mass, "radius": body.radius, "vx": v, "vy": 0.0, "fx": v, "fy": 0.0}
        return float(law.function(*(seen[a] for a in arguments))[0])

    if law.kind == "body":
        return np.array([force(b, 0.0) - force(b, 1.0) for b in on])
    return np.array([force(b, 1.0) for b in on])


def _place(item: LawUse, damped: bool) -> float:
    """Order of the kinds; in the exact scheme dampings come behind all they act against, but before constraints."""
    if damped:
        return KIND_ORDER["body"] + (0.4 if item.law.kind == "chain" else 0.5)
    return KIND_ORDER[item.law.kind]


def _scheme(uses: Sequence[LawUse], damped: Sequence[LawUse]) -> int:
    """How dampings see the velocity: as it is, body after body, or together where constraints or chains join them."""
    if not damped:
        return HALF_STEP
    if any(_holds(item.law) for item in uses):
        return TOGETHER
    return CHAINS if any(item.law.kind == "chain" for item in damped) else ALONE


def _holds(law: Law) -> bool:
    """Whether a law holds bodies back: a constraint that does more than take a share of the force."""
    return law.kind == "constraint" and not law.linear


def _constraint_order(name: str) -> int:
    # what changes the inertia comes first; a rail gives way to the drive along it; a pin comes before both. What rubs
    # along a rail sees what the rail leaves of the forces; what rubs in a pin is a force that moves more inertia, too
    return {"pin_stiction": -1, "pin": 1, "rail": 2, "dry_friction": 3, "drive": 4}.get(name, 0)


def _runs(rows: np.ndarray, blocks: np.ndarray) -> np.ndarray:
    """Sorted rows as half-open ranges (k, 2), none across the edge of a block: loops over bodies need no table."""
    if not len(rows):
        return np.zeros((0, 2), dtype=np.int64)
    ends = np.flatnonzero((np.diff(rows) > 1) | (np.diff(np.searchsorted(blocks, rows, side="right")) > 0))
    first = rows[np.concatenate([[0], ends + 1])]
    last = rows[np.concatenate([ends, [len(rows) - 1]])] + 1
    return np.column_stack([first, last])
