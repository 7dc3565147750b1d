"""The ``pymunk.Space`` of a simulation: bodies and circles, segments of straight walls, ghosts at the seam, joints."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pymunk
from pymunk._chipmunk_cffi import ffi, lib

from ..errors import InputError
from ..scene import Scene
from . import stepping
from .callbacks import WALL
from .held import joints_for
from .native import LEAD, ROW, Offsets, address, releaser, settle_in
from .order import Order
from .state import Bodies
from .units import Units

MOST_SURFACES = 8
IMMOVABLE = 1e15  # times its mass, a body that is carried along is to Chipmunk
LEAST_ROOT = 1e-6  # of a restitution, where walls have another


class Surface(NamedTuple):
    """How a body bounces and rubs, and what a straight wall is to it: Chipmunk takes the product of two."""

    bounce: float
    rub: float
    wall: float


class World:
    """What stands in the Space, in engine units.

    space : the Space itself;  bodies, circles : lists in inner order;  segments : of the straight walls
    wall_body : the static body that they belong to
    joint_limits : addresses of the largest forces of Chipmunk's joints, which hold bodies across impacts
    ghosts : images of bodies near the seam, one period on, with their circles;  originals : inner rows of these bodies
    """

    def __init__(
        self, scene: Scene, order: Order, units: Units, state: Bodies, apart: list[tuple[int, int]],
        carried: frozenset[int], offsets: Offsets | None,
    ) -> None:  # fmt: skip
        """``apart``: pairs of rows that never touch; ``offsets``: of Chipmunk's structures, None where unknown."""
        self._scene, self._order, self._units, self._apart = scene, order, units, apart
        impulse = [item for item in scene.laws if item.law.kind == "impulse"]
        self.space = space = pymunk.Space()
        space.gravity = (0.0, 0.0)
        space.damping = 1.0
        space.iterations = 100 if impulse else 1
        space.sleep_time_threshold = float("inf")
        surface_of = self._surfaces(scene)
        # how bodies bounce and rub: a bit for each way, which tells Chipmunk the segments they meet
        ways = list(dict.fromkeys(surface_of[b.id] for b in scene.bodies if b.mobile))
        self._bits = {way: 1 << (31 - k) for k, way in enumerate(ways if scene.walls else ())}
        if len(self._bits) > MOST_SURFACES:
            raise InputError(f"beside straight walls bodies may have {MOST_SURFACES} restitutions, got {len(ways)}")
        self.bodies: list[pymunk.Body] = []
        self.circles: list[pymunk.Circle] = []
        self._place_bodies(state, carried)
        touching = set(scene.ids) if not impulse else set()
        for item in impulse:
            touching |= set(item.bodies or scene.ids)
        self._draw_circles(state, surface_of, touching)
        space.add(*self.bodies)
        self.segments: list[pymunk.Segment] = []
        self.wall_body = pymunk.Body(body_type=pymunk.Body.STATIC)
        self._lay_walls()
        self._shapes_in = False
        state.bodies[:] = [address(b._body) for b in self.bodies]
        self._joints: list[pymunk.Constraint] = []
        self.joint_limits = np.zeros(0, dtype=np.int64)
        if offsets is not None:
            self.ease(state, offsets)
            if impulse:
                self._joints, self.joint_limits = joints_for(scene, self.bodies, order.inner, units, space)
        self.ghosts: list[tuple[pymunk.Body, pymunk.Circle]] = []
        self.originals: list[int] = []

    def ease(self, state: Bodies, offsets: Offsets) -> None:
        """What the kick divides by, constant drags and all; ``mass`` stays what it is."""
        kicked = slice(0, self._order.n_mobile)
        kick = np.array([[1.0 / body.mass for body in self.bodies[kicked]]]) * state.ease[kicked]
        stepping.write_fields(state.bodies[kicked].copy(), np.array([offsets.inverse_mass]), kick)

    # ---- building -------------------------------------------------------------------------------

    def _surfaces(self, scene: Scene) -> dict[str, Surface]:
        """Root of restitution and of friction of each body, and what gives that of walls beside the first."""
        ids, impulse = scene.ids, [item for item in scene.laws if item.law.kind == "impulse"]
        restitution = dict.fromkeys(ids, (1.0, 1.0))
        for item in impulse:
            values = scene.resolved(item)
            root = wall = math.sqrt(values["restitution"])
            if values["wall_restitution"] != values["restitution"]:
                root = max(root, LEAST_ROOT)
                wall = values["wall_restitution"] / root
            for name in item.bodies or ids:
                restitution[name] = root, wall
        friction = dict.fromkeys(ids, 0.0)
        for item in scene.laws_named("contact_friction") if impulse else ():
            for name in item.bodies or ids:
                friction[name] = math.sqrt(item.values["mu"])
        return {name: Surface(restitution[name][0], friction[name], restitution[name][1]) for name in ids}

    def _place_bodies(self, state: Bodies, carried: frozenset[int]) -> None:
        u, order = self._units, self._order
        release = releaser(state.memory) if state.memory is not None else None
        for k, (x, y, vx, vy) in enumerate(state.initial.tolist()):
            row = int(order.rows_of[k])
            body = self._scene.bodies[row]
            if body.mobile:
                heavy = IMMOVABLE if row in carried else 1.0
                mass = heavy * float(state.heavier[k]) * body.mass
                own = pymunk.Body(mass / u.mass, heavy * body.moment / u.moment)
                own.velocity = (vx / u.velocity, vy / u.velocity)
                own.angle, own.angular_velocity = float(state.turned[k, 0]), float(state.turned[k, 1] * u.time)
            else:
                own = pymunk.Body(body_type=pymunk.Body.STATIC)
            own.position = (x / u.length, y / u.length)
            if state.memory is not None and release is not None:
                settle_in(own, state.memory.ctypes.data + 8 * (ROW * k + LEAD), release)
            self.bodies.append(own)

    def _draw_circles(self, state: Bodies, surface_of: dict[str, Surface], touching: set[str]) -> None:
        # bodies first, all circles afterwards: what a step touches lies close together
        for k, own in enumerate(self.bodies):
            body = self._scene.bodies[self._order.rows_of[k]]
            circle = pymunk.Circle(own, body.radius / self._units.length)
            circle.elasticity, circle.friction, _ = surface_of[body.id]
            group = max(int(state.group[k]), 0)
            if body.id in touching:
                circle.filter = self._shape_filter(k, group, self._bits.get(surface_of[body.id], 0))
            else:
                circle.filter = pymunk.ShapeFilter(group=group, categories=0, mask=0)
            self.circles.append(circle)

    def _shape_filter(self, k: int, group: int, surface: int) -> pymunk.ShapeFilter:
        """Chipmunk's filter of inner row k, of a body with the bit ``surface``.

        Joined bodies have a bit each, which their partners do not see; bits of surfaces are those of segments.
        """
        every = pymunk.ShapeFilter.ALL_MASKS()
        surfaces = sum(self._bits.values())
        mask = every & ~surfaces | surface
        members = sorted({row for pair in self._apart for row in pair})
        if k not in members:
            return pymunk.ShapeFilter(group=group, categories=every & ~surfaces, mask=mask)
        most = 31 - len(self._bits)
        if len(members) > most:
            raise InputError(f"at most {most} bodies may be joined where Chipmunk finds contacts, got {len(members)}")
        bit = {row: 1 << m for m, row in enumerate(members)}
        hidden = sum(bit[other] for pair in self._apart if k in pair for other in pair if other != k)
        return pymunk.ShapeFilter(categories=bit[k], mask=mask & ~hidden)

    def _lay_walls(self) -> None:
        """Chipmunk's segments of the straight walls, in one static body; with a period, their images beside them."""
        if not self._scene.walls:
            return
        self.space.add(self.wall_body)
        u, period = self._units.length, self._scene.periodic_x or 0.0
        for wall in self._scene.walls:
            for shift in (-period, 0.0, period) if period else (0.0,):
                ends = [((x + shift) / u, y / u) for x, y in (wall.begin, wall.end)]
                # Chipmunk takes the product of two: a segment for each way in which bodies bounce and rub
                for surface, bit in self._bits.items():
                    segment = pymunk.Segment(self.wall_body, ends[0], ends[1], wall.radius / u)
                    segment.elasticity, segment.friction = surface.wall, surface.rub
                    segment.filter = pymunk.ShapeFilter(categories=bit)
                    self.segments.append(segment)

    # ---- shapes ---------------------------------------------------------------------------------

    def resurface(self, scene: Scene) -> bool:
        """Let bodies and walls bounce and rub as in a scene that has other numbers of its contacts, and no more.

        False, and nothing done, where other bodies are alike then: which segment a body meets hangs on that.
        """
        surface_of = self._surfaces(scene)
        bodies = [self._scene.bodies[row] for row in self._order.rows_of]
        alike = list(dict.fromkeys(surface_of[b.id] for b in self._scene.bodies if b.mobile))
        if self._scene.walls:
            bits = {way: 1 << (31 - k) for k, way in enumerate(alike)}
            met = [(b, c.filter.mask & sum(self._bits.values())) for b, c in zip(bodies, self.circles, strict=True)]
            if any(bits.get(surface_of[b.id]) != bit for b, bit in met if bit) or len(bits) != len(self._bits):
                return False
            self._bits = bits
            own = [surface for _ in range(len(self.segments) // len(bits)) for surface in bits]
            for segment, surface in zip(self.segments, own, strict=True):
                segment.elasticity, segment.friction = surface.wall, surface.rub
        for body, circle in zip(bodies, self.circles, strict=True):
            circle.elasticity, circle.friction, _ = surface_of[body.id]
        return True

    def add_shapes(self) -> None:
        """Circles and segments into the Space, where Chipmunk finds contacts and a user sees them."""
        if not self._shapes_in:
            self.space.add(*self.circles, *self.segments)
            self._shapes_in = True

    def remove_shapes(self) -> None:
        """Circles and segments out of the Space, and with them Chipmunk's contacts and their impulses."""
        if self._shapes_in:
            self.space.remove(*self.circles, *self.segments)
            self._shapes_in = False

    def renew_shapes(self) -> None:
        """As out and in again, once bodies are where a run begins anew: contacts and their impulses are gone.

        Chipmunk is asked itself: what pymunk counts of the shapes stays as it is, and takes longer than the rest.
        """
        if not self._shapes_in:
            self.add_shapes()
            return
        space, shapes = self.space._space, [shape._shape for shape in (*self.circles, *self.segments)]
        for shape in shapes:
            lib.cpSpaceRemoveShape(space, shape)
        for shape in shapes:
            lib.cpSpaceAddShape(space, shape)

    def rounds(self) -> tuple[int, int]:
        """Iterations of Chipmunk's solver, and those that do in a step in which none of the scene's bodies can touch.

        The same ones where a user has put shapes or joints of his own into the Space.
        """
        space = self.space
        own = len(space.shapes) == len(self.circles) + len(self.segments)
        own = own and len(space.constraints) == len(self._joints)
        return space.iterations, 1 if own else space.iterations

    def shown(self) -> pymunk.Space:
        """The Space as a user of pymunk expects it: shapes in it, each where its body is."""
        self.add_shapes()
        for body in self.bodies[: self._order.n_mobile]:
            body.angle = body.angle  # renews Chipmunk's rotation, which the lean drift leaves alone
        self.space.reindex_shapes_for_body(self.space.static_body)
        for circle in self.circles[: self._order.n_mobile]:
            circle.cache_bb()
        return self.space

    # ---- the seam (Chipmunk knows no periodic boundary) -----------------------------------------

    def wrap(self, images: np.ndarray) -> None:
        """Move bodies by whole periods to where the Space has them; ``images`` (n,) counts what was taken off x."""
        period = (self._scene.periodic_x or 0.0) / self._units.length
        for k, body in enumerate(self.bodies):
            position = body.position
            turns = math.floor(position.x / period)
            if turns:
                body.position = (position.x - turns * period, position.y)
                images[k] += turns
                if self._shapes_in:
                    self.space.reindex_shapes_for_body(body)

    def lay_ghosts(self, shell: float) -> None:
        """Ghosts, one period on, of the bodies less than ``shell`` [m] beyond the left edge; earlier ones go.

        Bodies a little left of the edge (wrapped to the far right) are met as originals.
        """
        for ghost, circle in self.ghosts:
            self.space.remove(ghost, circle)
        self.ghosts.clear()
        self.originals.clear()
        period = (self._scene.periodic_x or 0.0) / self._units.length
        width = shell / self._units.length
        for k, original in enumerate(self.bodies):
            if original.position.x < width:
                ghost = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
                ghost.position = (original.position.x + period, original.position.y)
                circle = pymunk.Circle(ghost, self.circles[k].radius)
                circle.filter = pymunk.ShapeFilter(group=10**6)
                self.ghosts.append((ghost, circle))
                self.originals.append(k)
                self.space.add(ghost, circle)


def point_ghost(ghost: pymunk.Body, original: pymunk.Body, period: float, o: Offsets, drift: int) -> None:
    """Let compiled code (at address ``drift``) move a ghost: it finds its original and the period in the ghost."""
    base = address(ghost._body)
    ffi.cast("int64_t *", base + o.torque)[0] = address(original._body)
    ffi.cast("double *", base + o.force)[0] = period
    lib.cpBodySetPositionUpdateFunc(ghost._body, ffi.cast("cpBodyPositionFunc", drift))


def row_table(ghosts: dict[int, int], wall_body: pymunk.Body, bodies: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Open-addressing table (keys, values) from a body's address to its row.

    ghosts : address of a ghost -> its row, -2 - that of its original;  bodies : (n,) addresses that are to be in it
    """
    entries = ghosts | {address(wall_body._body): WALL} | {int(key): k for k, key in enumerate(bodies)}
    size = 64
    while size < 3 * len(entries):
        size *= 2
    keys, values = np.zeros(size, dtype=np.int64), np.zeros(size, dtype=np.int64)
    for key, value in entries.items():
        k = ((key >> 4) * 2654435761) & (size - 1)
        while keys[k]:
            k = (k + 1) & (size - 1)
        keys[k], values[k] = key, value
    return keys, values
