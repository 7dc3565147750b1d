"""Hinges and rods: conservation, Lagrange's equations, other modes, what is refused."""

import math
from dataclasses import replace

import numpy as np
import pytest

from granswim_pymunk.engine import Simulation
from granswim_pymunk.engine.checkpoint import resume, save_checkpoint
from granswim_pymunk.errors import InputError
from granswim_pymunk.inference.data import prepare
from granswim_pymunk.inference.start import (
    Bar,
    Hinged,
    Pendulum,
    describe_starts,
    first_numbers,
    numbers_at,
    states,
    turning_angle,
)
from granswim_pymunk.joints import angles_of, place
from granswim_pymunk.recording import film
from granswim_pymunk.report.track_forms import _places_of
from granswim_pymunk.scene import Body, Scene, Time, scene_from_dict, use
from granswim_pymunk.validation.linked import double_pendulum, linked_motion

MASS, INERTIA, ARM, LENGTH = (0.2, 0.15), (4e-4, 3e-4), (0.07, 0.06), 0.14
MODES = ("verlet", "chipmunk", "python", "batch")


def bars(*laws, angles=(2.0, 1.5), rates=(3.0, -5.0), **time):
    """Two bars below each other, hung from the origin."""
    hinges = (
        use("gravity"),
        use("hinge", bodies=["a"], anchor_a=(0.0, ARM[0]), anchor=(0.0, 0.0)),
        use("hinge", bodies=["a", "b"], anchor_a=(0.0, ARM[0] - LENGTH), anchor_b=(0.0, ARM[1])),
    )
    bodies = tuple(
        Body(name, "free", 0.01, mass, initial=(0.0, 0.0, 0.0, 0.0), inertia=inertia)
        for name, mass, inertia in zip("ab", MASS, INERTIA, strict=True)
    )
    scene = Scene(bodies, (*hinges, *laws), gravity=(0.0, -9.81), time=Time(**time))
    return scene.with_initial(
        place(scene, dict(zip("ab", angles, strict=True)), dict(zip("ab", rates, strict=True)))
    )


def energy(scene, state):
    mass, moment = (np.array([getattr(b, name) for b in scene.bodies]) for name in ("mass", "moment"))
    kinetic = 0.5 * mass @ (state.v**2).sum(axis=1) + 0.5 * moment @ state.spin**2
    return float(kinetic + 9.81 * mass @ state.xy[:, 1])


class TestDoublePendulum:
    def test_conserves_energy(self):
        scene = bars(dt=5e-4)
        run = Simulation(scene)
        first = energy(scene, run.state())
        worst = 0.0
        for _ in range(100):
            run.advance(200)
            worst = max(worst, abs(energy(scene, run.state()) - first))
        lift = 9.81 * (MASS[0] * ARM[0] + MASS[1] * (LENGTH + ARM[1])) * 2
        assert worst < 1e-4 * lift
        # hinges are closed to rounding, as far as the bars have turned
        state = run.state()
        seen, _ = angles_of(scene, state.xy, state.v)
        assert np.abs(np.angle(np.exp(1j * (seen - state.angle)))).max() < 1e-10

    @pytest.mark.parametrize("drag", [(0.0, 0.0), (3e-4, 2e-4)])
    def test_lagrange(self, drag):
        times = np.linspace(0.0, 1.0, 11)
        laws = [use("joint_drag", bodies=names, c=c) for names, c in zip((["a"], ["a", "b"]), drag, strict=True) if c]
        scene = bars(*laws)
        start = (2.0, 1.5, 3.0, -5.0)
        truth = double_pendulum(times, start, mass=MASS, inertia=INERTIA, arm=ARM, length=LENGTH, drag=drag)
        other = linked_motion(scene, times, np.array(start[:2]), np.array(start[2:]))
        np.testing.assert_allclose(other[1], truth, atol=1e-7)
        errors = []
        for dt in (2e-4, 1e-4):
            path = Simulation(scene, dt=dt).sample(times)
            angle, _ = angles_of(scene, path, np.zeros_like(path))
            errors.append(np.abs(np.angle(np.exp(1j * (angle - truth)))).max())
        assert errors[1] < 1e-3
        assert 3.5 < errors[0] / errors[1] < 4.5  # second order, dampings too

    def test_friction(self):
        times = np.linspace(0.0, 0.6, 7)
        scene = bars(use("joint_friction", torque=2e-3, w_0=0.5), use("linear_drag", c=0.02))
        truth = linked_motion(scene, times, np.array([2.0, 1.5]), np.array([3.0, -5.0]))[0]
        np.testing.assert_allclose(Simulation(scene, dt=5e-5).sample(times), truth, atol=2e-6)
        without = replace(scene, laws=scene.laws[:3])
        assert np.abs(Simulation(without, dt=5e-5).sample(times) - truth).max() > 1e-2

    def test_modes(self):
        scene = bars(use("joint_drag", c=2e-4), use("quadratic_drag", c=0.05), dt=5e-4)
        states = {}
        for mode in MODES:
            run = Simulation(scene, mode=mode)
            run.advance(200)
            states[mode] = run.state()
        for mode in MODES[1:]:
            np.testing.assert_allclose(states[mode].xy, states["verlet"].xy, rtol=0, atol=1e-11)
            np.testing.assert_allclose(states[mode].spin, states["verlet"].spin, rtol=0, atol=1e-8)

    def test_restart_and_checkpoint(self, tmp_path):
        scene = bars(use("joint_drag", c=2e-4), dt=5e-4)
        run = Simulation(scene)
        first = run.sample(np.linspace(0.0, 0.2, 5))
        initial = np.array([body.initial for body in scene.bodies])
        run.restart(initial[:, :2], initial[:, 2:], 0.0)
        np.testing.assert_array_equal(run.sample(np.linspace(0.0, 0.2, 5)), first)
        save_checkpoint(run, tmp_path / "c.npz")
        run.advance(100)
        again, _, _ = resume(tmp_path / "c.npz")
        again.advance(100)
        np.testing.assert_array_equal(again.state().xy, run.state().xy)
        np.testing.assert_array_equal(again.state().angle, run.state().angle)


class TestRods:
    def chain(self, *laws, **time):
        """A point hung by a pin, another from it by a rod."""
        bodies = (
            Body("a", "free", 0.02, 0.2, initial=(0.3, 0.0, 0.0, 0.0)),
            Body("b", "free", 0.02, 0.1, initial=(0.3, 0.2, 0.0, 0.0)),
        )
        own = (
            use("gravity"), use("pin", bodies=["a"], anchor=(0.0, 0.0), length=0.3),
            use("rod", bodies=["a", "b"], length=0.2),
        )  # fmt: skip
        return Scene(bodies, (*own, *laws), gravity=(0.0, -9.81), time=Time(**time))

    def test_against_adaptive(self):
        times = np.linspace(0.0, 0.8, 9)
        scene = self.chain(use("joint_drag", c=2e-3), use("linear_drag", c=0.02))
        truth, _ = linked_motion(scene, times, np.zeros(2), np.zeros(2))
        path = Simulation(scene, dt=5e-5).sample(times)
        np.testing.assert_allclose(path, truth, atol=3e-6)
        np.testing.assert_allclose(np.hypot(*(path[:, 1] - path[:, 0]).T), 0.2, atol=1e-13)
        np.testing.assert_allclose(np.hypot(*path[:, 0].T), 0.3, atol=1e-13)

    def test_cart(self):
        """A bar that hangs from a cart on a rail."""
        bodies = (
            Body("cart", "free", 0.02, 0.3, initial=(0.0, 0.1, 0.0, 0.0)),
            Body("bar", "free", 0.02, 0.2, initial=(0.1, 0.1, 0.0, 0.0), inertia=5e-4),
        )
        laws = (
            use("gravity"), use("rail", bodies=["cart"], direction=(1.0, 0.0)),
            use("added_mass", bodies=["bar"], beta=0.2),
            use("hinge", bodies=["cart", "bar"], anchor_b=(-0.1, 0.0)), use("linear_drag", c=0.03),
        )  # fmt: skip
        scene = Scene(bodies, laws, gravity=(0.0, -9.81))
        times = np.linspace(0.0, 0.8, 9)
        truth, _ = linked_motion(scene, times, np.zeros(2), np.zeros(2))
        np.testing.assert_allclose(Simulation(scene, dt=5e-5).sample(times), truth, atol=3e-6)

    def test_driven_cart(self):
        """A pendulum on a cart that is shaken follows its pivot's acceleration."""
        t = np.linspace(0.0, 1.0, 2001)
        bodies = (
            Body("cart", "free", 0.02, 0.3, initial=(0.0, 0.0, 0.0, 0.0)),
            Body("bob", "free", 0.02, 0.2, initial=(0.0, -0.2, 0.0, 0.0)),
        )
        laws = (use("gravity"), use("drive", bodies=["cart"]), use("rod", bodies=["cart", "bob"], length=0.2))
        speed = 0.05 * (1 - np.cos(9 * t))
        scene = Scene(
            bodies, laws, gravity=(0.0, -9.81), inputs={"cart": (tuple(t), tuple(speed))}, time=Time(dt=1e-4)
        )
        from scipy.integrate import solve_ivp

        found = solve_ivp(
            lambda s, y: [y[1], -(9.81 * math.sin(y[0]) + 0.45 * math.sin(9 * s) * math.cos(y[0])) / 0.2],
            (0.0, 1.0), [0.0, 0.0], t_eval=[1.0], rtol=1e-10, atol=1e-12,
        )  # fmt: skip
        path = Simulation(scene).sample(np.array([1.0]))[0]
        assert path[0, 0] == pytest.approx(0.05 * (1 - math.sin(9) / 9), abs=1e-6)
        assert math.atan2(path[1, 0] - path[0, 0], -path[1, 1]) == pytest.approx(found.y[0, 0], abs=2e-5)


class TestScene:
    def test_do_not_touch(self):
        """Two joined disks that overlap push each other in no mode; a third one is pushed."""
        bodies = (
            Body("a", "free", 0.02, 0.1, initial=(0.0, 0.0, 0.0, 0.0)),
            Body("b", "free", 0.02, 0.1, initial=(0.03, 0.0, 0.0, 0.0)),
            Body("c", "free", 0.02, 0.1, initial=(0.069, 0.0, 0.0, 0.0)),
        )
        laws = (use("rod", bodies=["a", "b"], length=0.03), use("contact_linear", stiffness=1e3, damping=0.0))
        for mode in MODES:
            run = Simulation(Scene(bodies, laws), mode=mode, dt=1e-4)
            run.advance(50)
            xy = run.state().xy
            assert xy[1, 0] - xy[0, 0] == pytest.approx(0.03, abs=1e-14)
            assert xy[2, 0] > 0.0691
            assert xy[0, 0] < 0

    def test_files(self):
        scene = bars(use("joint_drag", bodies=["a", "b"], c=1e-4))
        data = scene.to_dict()
        assert scene_from_dict(data) == scene
        assert next(law for law in data["law"] if law["name"] == "hinge")["body"] == "a"
        friction = {"name": "joint_friction", "bodies": ["a"], "torque": 1e-3}
        assert scene_from_dict({**data, "law": [*data["law"], friction]}).laws[-1].name == "pin_friction"

    def test_angles(self):
        scene = bars()
        initial = np.array([body.initial for body in scene.bodies])
        angle, spin = angles_of(scene, initial[:, :2], initial[:, 2:])
        np.testing.assert_allclose(angle, (2.0, 1.5), atol=1e-14)
        np.testing.assert_allclose(spin, (3.0, -5.0), atol=1e-12)

    def test_refused(self):
        scene = bars()
        with pytest.raises(InputError, match=r"hinge.*one or two bodies"):
            replace(scene, laws=(use("hinge"),))
        with pytest.raises(InputError, match=r"rod.*two bodies"):
            replace(scene, laws=(use("rod", bodies=["a"], length=0.1),))
        with pytest.raises(InputError, match="no pin or hinge of b"):
            Simulation(scene.with_laws(use("joint_drag", bodies=["b"], c=1.0)))
        moved = scene.with_initial({"b": (0.0, 0.0, 0.0, 0.0)})
        with pytest.raises(InputError, match="do not start where hinges"):
            Simulation(moved)


class TestStarts:
    @pytest.mark.parametrize("positions", [False, True])
    def test_double_pendulum(self, positions):
        """Angles and rates at the start come back from tracked angles, and from positions; so do the angles later."""
        scene = bars(dt=2e-4)
        recording = film(
            scene, np.arange(0.0, 0.3, 0.002), positions=positions, noise=1e-6 if positions else 0.0, angle_noise=1e-5,
            rng=np.random.default_rng(1),
        )  # fmt: skip
        if positions:
            recording = replace(recording, angle=None, angle_noise=None)
        case = prepare(recording, held_out=False, split=False)
        assert {c.kind for c in case.channels} == ({"x", "y"} if positions else {"angle"})
        starts = describe_starts(case, np.ones(len(case.t), dtype=bool), scene)
        assert [type(s.coordinates) for s in starts] == [Hinged, Hinged]
        np.testing.assert_allclose([s.first[0] for s in starts], (2.0, 1.5), atol=2e-4)
        np.testing.assert_allclose([s.first[1] for s in starts], (3.0, -5.0), atol=0.05)
        exact = np.array([2.0, 3.0, 1.5, -5.0])
        placed = states(starts, exact, scene, 0.0)
        for body in scene.bodies:
            np.testing.assert_allclose(placed[body.id], body.initial, atol=1e-14)
        initial = np.array([body.initial for body in scene.bodies])
        np.testing.assert_allclose(numbers_at(starts, scene, initial[:, :2], initial[:, 2:]), exact, atol=1e-12)
        path = Simulation(scene).sample(case.t)
        if not positions:
            for k, name in enumerate("ab"):
                np.testing.assert_allclose(turning_angle(path, [0, 1], scene, name), case.values[:, k], atol=1e-4)

    def test_rod(self):
        scene = TestRods().chain(dt=2e-4)
        recording = film(scene, np.arange(0.0, 0.1, 0.002), noise=1e-6, rng=np.random.default_rng(2))
        case = prepare(replace(recording, angle=None), held_out=False, split=False)
        starts = describe_starts(case, np.ones(len(case.t), dtype=bool), scene)
        assert [type(s.coordinates) for s in starts] == [Pendulum, Bar]
        initial = np.array([body.initial for body in scene.bodies])
        back = numbers_at(starts, scene, initial[:, :2], initial[:, 2:])
        for name, state in states(starts, back, scene, 0.0).items():
            np.testing.assert_allclose(state, scene.body(name).initial, atol=1e-12)
        for name, state in states(starts, first_numbers(starts), scene, 0.0).items():
            np.testing.assert_allclose(state[:2], scene.body(name).initial[:2], atol=2e-5)


def test_places_of_bars_whose_angles_alone_were_measured():
    """What a picture of the field shows: where the bars were, told from their angles."""
    scene = bars()
    seen = film(scene, np.arange(0.0, 0.3, 0.01), positions=False)
    assert not np.isfinite(seen.xy).any()
    case = prepare(seen, held_out=False, split=False)
    places = _places_of(case)
    true = Simulation(scene).sample(seen.t).reshape(-1, 2)
    assert len(places) == len(true)
    np.testing.assert_allclose(places, true, atol=1e-6)
