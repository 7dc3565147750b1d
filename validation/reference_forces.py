"""Force laws of the reference integrator, written anew from the formulas: no code of the engine's laws.

Only the names of the laws and the values of their parameters are read from the scene. SI throughout.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.spatial import cKDTree

from granswim_pymunk.errors import InputError
from granswim_pymunk.scene import LawUse, Scene

from . import reference_mechanisms as mechanisms

CONTACTS = ("contact_linear", "contact_hertz")
CHAIN_LAWS = ("union", "bending")
FIELDS = (
    "gravity", "uniform_force", "linear_drag", "quadratic_drag", "coulomb_substrate", "confinement", "spring",
    "curved_surface", "lift", "periodic_force",
)  # fmt: skip
# drags and friction of substrate and joints: in the exact scheme they see the velocity of the positions' time
DAMPED = (
    "linear_drag", "quadratic_drag", "coulomb_substrate", "confinement", "ambient_flow", "quadratic_flow",
    "wall_drag", "pin_friction", "joint_friction", "joint_drag", "lift",
)  # fmt: skip
CONSTRAINTS = ("pin", "rail", "drive")
BRAKES = ("dry_friction", "pin_stiction")
LINKS = ("hinge", "rod")
KNOWN = (
    *CONTACTS, "contact_elastic", *CHAIN_LAWS, *FIELDS, *CONSTRAINTS, *BRAKES, *LINKS, *mechanisms.FIELDS,
    *mechanisms.JOINTS, *mechanisms.PAIRS,
    *mechanisms.CHAIN_LAWS, *mechanisms.INERTIA,
)  # fmt: skip

Force = Callable[[float, np.ndarray, np.ndarray], np.ndarray]


class Pairs:
    """Pairs of bodies that can touch, from a k-d tree; rebuilt when something has moved far enough.

    Left out: two walls, and two disks of one swimmer. ``vector(xy, i, j)`` is r_j - r_i [m], by
    minimum image where x is periodic.
    """

    def __init__(self, scene: Scene) -> None:
        self.radius = np.array([body.radius for body in scene.bodies])
        self.mobile = np.array([body.mobile for body in scene.bodies])
        self.period = scene.periodic_x
        self.swimmer = np.full(len(scene.bodies), -1)
        for number, chain in enumerate(scene.chains):
            self.swimmer[list(chain)] = number
        self.skin = 0.3 * float(self.radius.min())
        self.gap = 0.0  # up to which some law acts before contact [m]
        self.i = self.j = np.empty(0, dtype=np.int64)
        self.built_at: np.ndarray | None = None

    def vector(self, xy: np.ndarray, i: np.ndarray, j: np.ndarray) -> np.ndarray:
        r = xy[j] - xy[i]
        if self.period is not None:
            r[:, 0] -= self.period * np.round(r[:, 0] / self.period)
        return r

    def update(self, xy: np.ndarray, farthest: float = 0.0) -> None:
        """Make the list valid at ``xy`` (n, 2) [m], also if everything moves ``farthest`` [m] more."""
        if self.built_at is not None:
            moved = math.sqrt(float(((xy - self.built_at) ** 2).sum(axis=1).max()))
            if 2 * (moved + farthest) < self.skin:
                return
        self.skin = max(self.skin, 4 * farthest)
        reach = 2 * float(self.radius.max()) + self.gap + self.skin
        points = xy.copy()
        box = None
        if self.period is not None:
            if self.period < 2 * reach:
                raise InputError(
                    f"is shorter than four radii and a skin ({2 * reach:g} m)", where="scene.periodic_x"
                )
            points[:, 0] %= self.period
            points[points[:, 0] >= self.period, 0] = 0.0
            points[:, 1] -= points[:, 1].min()
            box = [
                self.period,
                4 * (float(points[:, 1].max()) + reach),
            ]  # y is not periodic: keep its images far
        pairs = cKDTree(points, boxsize=box).query_pairs(reach, output_type="ndarray")
        i, j = pairs.min(axis=1), pairs.max(axis=1)
        keep = (self.mobile[i] | self.mobile[j]) & ~(
            (self.swimmer[i] >= 0) & (self.swimmer[i] == self.swimmer[j])
        )
        order = np.lexsort((j[keep], i[keep]))
        self.i, self.j = i[keep][order], j[keep][order]
        self.built_at = xy.copy()


class StraightWalls:
    """Segments that never move, as pairs of complex numbers; images of them where x is periodic."""

    def __init__(self, scene: Scene) -> None:
        self.period = scene.periodic_x
        count = len(scene.walls)
        begin, end = (np.array([complex(*getattr(w, name)) for w in scene.walls]) for name in ("begin", "end"))
        shifts = np.zeros((count, 1))
        if self.period is not None and count:
            # images that begin from three periods before the box to three behind it
            first = -np.floor(begin.real / self.period)
            shifts = self.period * (first[:, None] + np.arange(-3, 4))
        self.begin, self.end = begin[:, None] + shifts, end[:, None] + shifts
        self.radius = np.array([wall.radius for wall in scene.walls])

    def ways(self, xy: np.ndarray) -> np.ndarray:
        """(n, k, 2) [m] from n places to the nearest one on the middle line of each of the k walls."""
        z = xy[:, 0] % self.period + 1j * xy[:, 1] if self.period is not None else xy[:, 0] + 1j * xy[:, 1]
        along = self.end - self.begin
        from_begin = z[:, None, None] - self.begin
        share = (from_begin / along).real.clip(0.0, 1.0)
        way = share * along - from_begin
        nearest = np.abs(way).argmin(axis=2)
        way = np.take_along_axis(way, nearest[..., None], axis=2)[..., 0]
        return np.stack([way.real, way.imag], axis=-1)

    def gaps(self, xy: np.ndarray, radius: np.ndarray) -> np.ndarray:
        """(n,) [m] from disks to the nearest wall, infinite where there is none."""
        if not len(self.radius):
            return np.full(len(xy), math.inf)
        return (np.linalg.norm(self.ways(xy), axis=2) - radius[:, None] - self.radius).min(axis=1)

    def wait(self, xy: np.ndarray, v: np.ndarray, radius: float, most: float) -> list[float]:
        """For each wall, the time [s] until a disk that flies straight touches it; infinite where not within ``most``.

        Where it touches already: 0. The gap along the path falls and rises once: its lowest point is found, and the
        moment of contact before it by bisection.
        """
        speed = math.hypot(*v)
        times = []
        for k, reach in enumerate(self.radius + radius):

            def gap(t: float, k: int = k, reach: float = float(reach)) -> float:
                way = self.ways((xy + t * v)[None])[0, k]
                return math.hypot(*way) - reach

            now = gap(0.0)
            if now <= 0 or now > speed * most:
                times.append(0.0 if now <= 0 else math.inf)
                continue
            low, high = 0.0, most
            while high - low > 1e-12 * most and gap(high) > 0:
                left, right = low + (high - low) / 3, high - (high - low) / 3
                low, high = (low, right) if gap(left) < gap(right) else (left, high)
            if gap(high) > 0:
                times.append(math.inf)
                continue
            outside, inside = 0.0, high
            for _ in range(100):
                middle = 0.5 * (outside + inside)
                outside, inside = (middle, inside) if gap(middle) > 0 else (outside, middle)
            times.append(outside)
        return times


class Forces:
    """Sum of all forces on all bodies.

    ``__call__(t, xy, v)``: (n, 2) [N] for positions (n, 2) [m], velocities (n, 2) [m/s] at time t [s];
    the forces that a pin, rail or drive needs are not in it. Drags, friction and ``extra`` see the velocities
    ``middle`` where they are given.
    ``extra(t, xy, v)`` -> (n, 2) [N] may add physics that the scene does not know.
    Raises InputError naming a law that it does not have.
    """

    def __init__(self, scene: Scene, extra: Force | None = None) -> None:
        for item in scene.laws:
            if item.name not in KNOWN:
                raise InputError("the reference integrator does not have it", where=f"law {item.name}")
        self.scene = scene
        self.extra = extra
        self.mass = np.array([body.mass for body in scene.bodies])
        self.radius = np.array([body.radius for body in scene.bodies])
        self.mobile = np.array([body.mobile for body in scene.bodies])
        # a wall is immovable: infinitely heavy, so that the reduced mass is the mobile one's
        self.inverse_mass = np.where(self.mobile, 1 / self.mass, 0.0)
        self.pairs = Pairs(scene)
        self.walls = StraightWalls(scene)
        self.uses = [(item, scene.resolved(item), scene.rows(item)) for item in scene.acting]
        # whether a law acts on each body (n,)
        self.acts = {id(item): np.isin(np.arange(len(scene.bodies)), rows) for item, _, rows in self.uses}
        self.has_pairs = any(item.name in (*CONTACTS, *mechanisms.PAIRS) for item in scene.laws)
        self.pairs.gap = max((mechanisms.reach(item.name, values) for item, values, _ in self.uses), default=0.0)
        # whether anything looks at ``middle``
        self.damped = extra is not None or any(item.name in DAMPED for item, _, _ in self.uses)
        # what friction at the contacts turns: angular velocities go in, torques come out
        self.turns = any(item.name == "contact_friction" for item in scene.laws)
        self.spin = np.zeros(len(scene.bodies))
        self.torque = np.zeros(len(scene.bodies))
        # a carried medium: inertia of body i is inertia[i] times its own
        self.inertia = np.ones(len(scene.bodies))
        for item, values, rows in self.uses:
            if item.name in mechanisms.INERTIA:
                self.inertia[rows] *= 1 + values["beta"]

    def __call__(
        self, t: float, xy: np.ndarray, v: np.ndarray, middle: np.ndarray | None = None
    ) -> np.ndarray:
        half_step = v
        force = np.zeros_like(xy)
        self.torque[:] = 0.0
        if self.has_pairs:
            self.pairs.update(xy)
        for item, values, rows in self.uses:
            v = middle if middle is not None and item.name in DAMPED else half_step
            if item.name in CONTACTS:
                self._contacts(force, item, values, xy, v)
                self._on_walls(force, item, values, rows, xy, v)
            elif item.name in CHAIN_LAWS:
                for chain in self.scene.chains:
                    disks = [row for row in chain if row in rows] if item.bodies is not None else list(chain)
                    law = union if item.name == "union" else bending
                    force[disks] += law(t, self._unfold(xy[disks]), v[disks], self.mass[disks], **values)
            elif item.name in FIELDS:
                force[rows] += self._field(item, values, t, xy[rows], v[rows], rows)
            elif item.name in mechanisms.FIELDS:
                gaps = self.walls.gaps(xy[rows], self.radius[rows])
                force[rows] += mechanisms.field(item.name, values, xy[rows], v[rows], self.radius[rows], gaps)
            elif item.name in mechanisms.JOINTS:
                self._joints(force, item, values, xy, v)
            elif item.name == "contact_friction" and self.scene.laws_named("contact_elastic"):
                continue  # an impulse, of the collision
            elif item.name in mechanisms.PAIRS:
                self._pair(force, item, values, xy, v, float(self.radius[rows].mean()))
                if item.name not in mechanisms.REACH:
                    self._on_walls(force, item, values, rows, xy, v)
            elif item.name in mechanisms.CHAIN_LAWS:
                for disks in map(list, self.scene.chains):
                    force[disks] += mechanisms.chain(item.name, values, t, self._unfold(xy[disks]), v[disks])
        if self.extra is not None:
            force += self.extra(t, xy, half_step if middle is None else middle)
        force[~self.mobile] = 0.0
        return force

    def _joints(self, force: np.ndarray, item: LawUse, values: dict, xy: np.ndarray, v: np.ndarray) -> None:
        """A friction in pins, as a force across the rod, and in hinges, as torques."""
        row = {body.id: k for k, body in enumerate(self.scene.bodies)}
        named = None if item.bodies is None else set(item.bodies)
        for joint in self.scene.laws:
            bodies = joint.bodies or ()
            if joint.name == "pin":
                for name in bodies:
                    if named is None or name in named:
                        i = row[name]
                        r = xy[i] - np.array(joint.values["anchor"])
                        across = np.array([-r[1], r[0]]) / (r @ r)
                        force[i] += mechanisms.joint_torque(item.name, values, float(across @ v[i])) * across
            elif joint.name == "hinge" and (named is None or named == set(bodies)):
                rates = [self.spin[row[name]] for name in bodies]
                if len(rates) == 1:
                    self.torque[row[bodies[0]]] += mechanisms.joint_torque(item.name, values, rates[0])
                    continue
                torque = mechanisms.joint_torque(item.name, values, rates[1] - rates[0])
                self.torque[row[bodies[1]]] += torque
                self.torque[row[bodies[0]]] -= torque

    def _unfold(self, xy: np.ndarray) -> np.ndarray:
        """A chain's positions, each disk at its nearest image to the one before."""
        period = self.scene.periodic_x
        if period is None or len(xy) < 2:
            return xy
        step = np.diff(xy[:, 0])
        turns = np.cumsum(np.round(step / period))
        out = xy.copy()
        out[1:, 0] -= period * turns
        return out

    def touching(self, item: LawUse, xy: np.ndarray, margin: float = 0.0) -> tuple[np.ndarray, ...]:
        """i, j, unit vectors from i to j, and gap [m] of the pairs with a gap below ``margin`` [m]."""
        i, j = self.pairs.i, self.pairs.j
        acts = self.acts[id(item)]
        if not acts.all():
            both = acts[i] & acts[j]
            i, j = i[both], j[both]
        r = self.pairs.vector(xy, i, j)
        distance = np.hypot(r[:, 0], r[:, 1])
        gap = distance - self.radius[i] - self.radius[j]
        near = gap < margin
        return i[near], j[near], r[near] / distance[near, None], gap[near]

    def contact_forces(
        self, item: LawUse, values: dict, xy: np.ndarray, v: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """i, j, normal from i to j, gap [m], normal force on j [N] (above zero: repulsion)."""
        i, j, n, gap = self.touching(item, xy)
        reduced = 1 / (self.inverse_mass[i] + self.inverse_mass[j])
        approach = ((v[j] - v[i]) * n).sum(axis=1)
        if item.name == "contact_linear":
            elastic = -values["stiffness"] * gap
        else:
            elastic = values["stiffness"] * (-gap) ** 1.5
        return i, j, n, gap, elastic - values["damping"] * reduced * approach

    def _contacts(self, force: np.ndarray, item: LawUse, values: dict, xy: np.ndarray, v: np.ndarray) -> None:
        i, j, n, _, size = self.contact_forces(item, values, xy, v)
        for axis in (0, 1):
            push = size * n[:, axis]
            force[:, axis] += np.bincount(j, push, len(xy)) - np.bincount(i, push, len(xy))

    def _on_walls(
        self, force: np.ndarray, item: LawUse, values: dict, rows: np.ndarray, xy: np.ndarray, v: np.ndarray
    ) -> None:
        """Add what straight walls do to the bodies that touch them, by a law of contact."""
        if not len(self.walls.radius):
            return
        rows = rows[self.mobile[rows]]
        ways = self.walls.ways(xy[rows])
        distance = np.linalg.norm(ways, axis=2)
        for m, k in np.argwhere(distance < self.radius[rows][:, None] + self.walls.radius):
            i, r = rows[m], self.radius[rows[m]]
            gap = distance[m, k] - r - self.walls.radius[k]
            n = ways[m, k] / distance[m, k]
            across = np.array([-n[1], n[0]])
            approach, slip = float(-v[i] @ n), float(-v[i] @ across) - self.spin[i] * r
            if item.name in CONTACTS:
                power = 1.0 if item.name == "contact_linear" else 1.5
                push = values["stiffness"] * (-gap) ** power - values["damping"] * self.mass[i] * approach
                force[i] -= push * n
                continue
            single = (np.array([number]) for number in (gap, distance[m, k], approach, slip, self.mass[i]))
            gaps, touch, approaches, slips, masses = single
            _, sideways = mechanisms.pair(item.name, values, gaps, touch, approaches, slips, masses, r)
            force[i] -= sideways[0] * across
            self.torque[i] -= r * sideways[0]
            if item.name == "rolling_resistance":
                normal = mechanisms.pressed(values, gaps, approaches, masses)
                self.torque[i] += mechanisms.rolling(values, normal, np.array([r]), np.array([self.spin[i]]))[0]

    def _pair(
        self, force: np.ndarray, item: LawUse, values: dict, xy: np.ndarray, v: np.ndarray, mean_radius: float
    ) -> None:
        """Add a law of pairs to ``force`` and to the torques."""
        i, j, n, gap = self.touching(item, xy, mechanisms.reach(item.name, values))
        across = np.stack([-n[:, 1], n[:, 0]], axis=1)
        u = v[j] - v[i]
        # velocity of the surfaces where they meet: a body's own is v + spin x (radius along or against n)
        slip = (u * across).sum(axis=1) - self.spin[j] * self.radius[j] - self.spin[i] * self.radius[i]
        along, sideways = mechanisms.pair(
            item.name, values, gap, self.radius[i] + self.radius[j], (u * n).sum(axis=1), slip,
            1 / (self.inverse_mass[i] + self.inverse_mass[j]), mean_radius,
        )  # fmt: skip
        push = along[:, None] * n + sideways[:, None] * across
        np.add.at(force, j, push)
        np.subtract.at(force, i, push)
        np.subtract.at(self.torque, i, self.radius[i] * sideways)
        np.subtract.at(self.torque, j, self.radius[j] * sideways)
        if item.name == "rolling_resistance":
            reduced = 1 / (self.inverse_mass[i] + self.inverse_mass[j])
            normal = mechanisms.pressed(values, gap, (u * n).sum(axis=1), reduced)
            for k in (i, j):
                np.add.at(self.torque, k, mechanisms.rolling(values, normal, self.radius[k], self.spin[k]))

    def _field(
        self, item: LawUse, values: dict, t: float, xy: np.ndarray, v: np.ndarray, rows: np.ndarray
    ) -> np.ndarray:
        """Force [N] on each of ``rows``, which depends on that body's own state and the time [s] only."""
        mass = self.mass[rows][:, None]
        speed = np.hypot(v[:, 0], v[:, 1])[:, None]
        relative = (self.radius[rows] / self.radius[rows].mean())[:, None] if len(rows) else mass
        if item.name == "gravity":
            return mass * np.array(self.scene.gravity)
        if item.name == "uniform_force":
            return mass * np.array(values["a"])
        if item.name == "linear_drag":
            return -values["c"] * relative ** values["p"] * v
        if item.name == "quadratic_drag":
            return -values["c"] * relative ** values["p"] * speed * v
        if item.name == "coulomb_substrate":
            smooth = np.hypot(speed, values["v_0"])
            return -values["mu"] * mass * self.scene.gravity_size * v / np.where(smooth > 0, smooth, 1.0)
        if item.name == "confinement":
            return -values["mu_eff"] * values["mean_mass"] * 9.81 * values["layers"] * v
        if item.name == "curved_surface":
            bent = np.array({0: [1.0, 1.0], 1: [1.0, 0.0], 2: [0.0, 1.0]}[int(values["bent"])])
            return -mass * self.scene.gravity_size * values["curvature"] * bent * (xy - np.array(values["centre"]))
        if item.name == "periodic_force":
            turn = 2 * np.pi * values["f"] * t
            pushed = np.cos(turn) * np.array(values["a"]) + np.sin(turn) * np.array(values["b"])
            return mass * np.broadcast_to(pushed, xy.shape)
        if item.name == "lift":
            return values["l"] * speed * v[:, ::-1] * np.array([-1.0, 1.0])
        # a spring to an anchor
        r = xy - np.array(values["anchor"])
        distance = np.hypot(r[:, 0], r[:, 1])[:, None]
        stretched = distance - values["length"]
        return -values["stiffness"] * stretched * r / np.where(distance > 0, distance, 1.0)


def _segments(xy: np.ndarray, v: np.ndarray, mass: np.ndarray) -> tuple[np.ndarray, ...]:
    """Length [m], unit vector along, unit vector across, relative velocity, reduced mass of each segment."""
    r = np.diff(xy, axis=0)
    length = np.hypot(r[:, 0], r[:, 1])
    along = r / length[:, None]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    reduced = mass[1:] * mass[:-1] / (mass[1:] + mass[:-1])
    return length, along, across, np.diff(v, axis=0), reduced


def _opposite(on_second: np.ndarray) -> np.ndarray:
    """(n, 2) forces on the disks when segment s pushes disk s + 1 with ``on_second[s]`` and disk s back."""
    force = np.zeros((len(on_second) + 1, 2))
    force[1:] += on_second
    force[:-1] -= on_second
    return force


def union(
    t: float,
    xy: np.ndarray,
    v: np.ndarray,
    mass: np.ndarray,
    *,
    stiffness: float,
    damping: float,
    length: float,
) -> np.ndarray:
    """(n, 2) forces [N] of the springs between consecutive disks (optimal_frequency, Eq. 1)."""
    distance, along, _, relative, reduced = _segments(xy, v, mass)
    pull = -stiffness * (distance - length) - damping * reduced * (relative * along).sum(axis=1)
    return _opposite(pull[:, None] * along)


def bends(xy: np.ndarray, head: float, form: str = "leader") -> np.ndarray:
    """(n - 1,) bends phi_i [rad] of a chain, wrapped to (-pi, pi]; phi_0 is against the head's axis."""
    r = np.diff(xy, axis=0)
    angle = np.arctan2(r[:, 1], r[:, 0])
    before = np.full(len(angle), head) if form == "head_axis" else np.concatenate([[head], angle[:-1]])
    phi = angle - before
    return phi - 2 * np.pi * np.ceil((phi - np.pi) / (2 * np.pi))


def bending(
    t: float,
    xy: np.ndarray,
    v: np.ndarray,
    mass: np.ndarray,
    *,
    stiffness: float,
    damping: float,
    amplitude: float,
    frequency: float,
    phase: float,
    form: str,
    length: float = math.nan,
) -> np.ndarray:
    """(n, 2) forces [N] of bending (optimal_frequency, Eq. 3).

    ``elastic`` is minus the gradient of E = k_B d/2 sum phi_i^2 with d = ``length`` [m], the head's axis
    held from outside. phi_i = alpha_i - alpha_(i-1), and alpha of a segment grows by
    across . (dr_second - dr_first)/|r|; so segment s feels the torque -d E/d alpha_s =
    -k_B d (phi_s - phi_(s+1)), a pair of opposite forces torque/|r| across its ends.
    """
    head = amplitude * math.sin(2 * math.pi * frequency * t + phase)
    distance, _, across, relative, reduced = _segments(xy, v, mass)
    phi = bends(xy, head, form)
    if form == "elastic":
        torque = -stiffness * length * (phi - np.append(phi[1:], 0.0))
        push = torque / distance
    else:
        push = -stiffness * phi
    push = push - damping * reduced * (relative * across).sum(axis=1)
    return _opposite(push[:, None] * across)


def bending_energy(xy: np.ndarray, head: float, *, stiffness: float, length: float) -> float:
    """Energy k_B d/2 sum phi_i^2 [J] of a chain (n, 2) [m] whose head axis is turned by ``head`` [rad]."""
    return 0.5 * stiffness * length * float((bends(xy, head) ** 2).sum())
