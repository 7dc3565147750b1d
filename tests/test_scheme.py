"""The exact scheme: drags and friction of substrate and joints without an error of first order in the step."""

import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from granswim_pymunk.engine import Simulation
from granswim_pymunk.errors import InputError
from granswim_pymunk.paper.scenes import paper_scene
from granswim_pymunk.scene import Body, Scene, Time, scene_from_dict, use
from granswim_pymunk.validation import cases_bed
from granswim_pymunk.validation.crosscheck import read_bed
from granswim_pymunk.validation.reference import Reference

MASS = 0.2
MODES = ("verlet", "chipmunk", "python", "batch")


def puck(*laws, scheme="exact", dt=1e-2, **more):
    body = Body("puck", "free", 0.02, MASS, initial=(0.0, 0.0, 1.0, 0.5))
    return Scene((body,), laws, time=Time(dt=dt, scheme=scheme), **more)


def runs(scene):
    return {mode: Simulation(scene, mode=mode) for mode in MODES} | {"reference": Reference(scene)}


def way(run, t):
    return run.sample(np.array([t]))[0, 0, 0]


class TestClosedSolutions:
    @pytest.mark.parametrize("laws", [("linear_drag",), ("linear_drag", "confinement"), ("linear_drag", "added_mass")])
    def test_drag(self, laws):
        """x = v/k (1 - exp(-k t)); k dt = 2e-3 or more, and half of that is what the half-step scheme is off by."""
        rate = 0.2
        values = {
            "linear_drag": {"c": rate * MASS},
            "confinement": {"mu_eff": 0.1 / (9.81 * MASS), "layers": 1.0, "mean_mass": MASS},
            "added_mass": {"beta": 0.25},
        }
        rate = (rate + 0.1 * ("confinement" in laws) * 1.0 / MASS) / (1.25 if "added_mass" in laws else 1.0)
        expected = (1 - math.exp(-3 * rate)) / rate
        scene = puck(*(use(name, **values[name]) for name in laws))
        for name, run in runs(scene).items():
            assert way(run, 3.0) == pytest.approx(expected, rel=2e-5), name
        late = way(Simulation(replace(scene, time=replace(scene.time, scheme="half_step"))), 3.0)
        assert abs(late / expected - 1) > 1e-4

    def test_flow(self):
        """v = u + (v_0 - u) exp(-k t)"""
        rate, u = 0.3, -0.4
        scene = puck(use("ambient_flow", c=rate * MASS, u=(u, 0.0)))
        expected = 3 * u + (1 - u) * (1 - math.exp(-3 * rate)) / rate
        for name, run in runs(scene).items():
            assert way(run, 3.0) == pytest.approx(expected, rel=1e-5), name

    def test_quadratic_drag(self):
        """x = m/c log(1 + c v t/m), along the first velocity"""
        c, speed = 0.1, math.hypot(1.0, 0.5)
        scene = puck(use("quadratic_drag", c=c))
        expected = MASS / c * math.log1p(c * speed * 3.0 / MASS) / speed
        for name, run in runs(scene).items():
            assert way(run, 3.0) == pytest.approx(expected, rel=1e-5), name

    def test_dry_friction(self):
        """v' = -a v/sqrt(v^2 + w^2): a t = [sqrt(v^2 + w^2) - w asinh(w/v)] from the present v to the first"""
        a, smooth, first = 0.5, 0.2, math.hypot(1.0, 0.5)

        def left(v):
            return math.hypot(v, smooth) - smooth * math.asinh(smooth / v)

        scene = puck(use("coulomb_substrate", mu=a / 9.81, v_0=smooth))
        for name, run in runs(scene).items():
            run.advance(200)
            v = math.hypot(*run.state().v[0])
            expected = brentq(lambda v: left(first) - left(v) - a * 2.0, 1e-3, first)
            assert v == pytest.approx(expected, rel=3e-5), name
        late = Simulation(replace(scene, time=replace(scene.time, scheme="half_step")))
        late.advance(200)
        assert abs(math.hypot(*late.state().v[0]) / expected - 1) > 1e-3

    def test_stopping(self):
        """A puck that slides to rest: t = v/a, and there it stays."""
        scene = puck(use("coulomb_substrate", mu=0.05, v_0=1e-3), dt=1e-3)
        a, speed = 0.05 * 9.81, math.hypot(1.0, 0.5)
        run = Simulation(scene)
        run.advance(3000)
        assert way(run, 4.0) == pytest.approx(speed**2 / (2 * a) / speed, rel=1e-3)
        assert math.hypot(*run.state().v[0]) < 1e-6

    @pytest.mark.parametrize("law", ["linear_drag", "pin_friction"])
    def test_pendulum(self, law):
        """60 frames a second for 10 s at 1 ms: the decay of the swing is that of a step twenty times shorter."""
        angle, length = 0.2, 0.25
        damping = {"linear_drag": {"c": 0.16 * MASS}, "pin_friction": {"torque": 2e-4, "w_0": 0.5}}[law]
        body = Body("bob", "free", 0.01, MASS, initial=(length * math.sin(angle), -length * math.cos(angle), 0.0, 0.0))
        laws = (use("gravity"), use("pin", bodies=["bob"], anchor=(0.0, 0.0), length=length), use(law, **damping))
        scene = Scene((body,), laws, gravity=(0.0, -9.81))
        times = np.arange(0.0, 10.0, 2e-3)

        def rate(run):
            """Decay of the maxima [1/s], by parabolas through the largest three samples of each."""
            xy = run.sample(times)[:, 0]
            swing = np.arctan2(xy[:, 0], -xy[:, 1])
            k = np.flatnonzero((swing[1:-1] > swing[:-2]) & (swing[1:-1] >= swing[2:])) + 1
            before, top, after = swing[k - 1], swing[k], swing[k + 1]
            heights = top + (before - after) ** 2 / (8 * (2 * top - before - after))
            return -np.polyfit(times[k], np.log(heights), 1)[0]

        fine = rate(Simulation(scene, dt=5e-5))
        for run in (Simulation(scene, dt=1e-3), Reference(scene, dt=1e-3)):
            assert rate(run) == pytest.approx(fine, rel=1e-5)
        if law == "linear_drag":  # small swings: half of c/m, and what is left depends on the height in fourth order
            assert fine == pytest.approx(0.08, rel=2e-3)
            half_step = replace(scene, time=Time(scheme="half_step"))
            assert abs(rate(Simulation(half_step, dt=1e-3)) / fine - 1) > 2e-5

    def test_swimmer_joints(self):
        """Friction of a swimmer's joints beside another damping: the same in all modes, and of second order."""
        scene = cases_bed.small_bed().with_laws(use("joint_friction", force=2e-3), use("quadratic_drag", c=1e-2))
        ends = {}
        for mode in MODES:
            run = Simulation(scene, mode=mode, dt=2e-6)
            run.advance(60)
            ends[mode] = run.state().xy
        start = np.array([body.initial for body in scene.bodies])[:, :2]
        moved = np.abs(ends["verlet"] - start).max()
        for mode in MODES[1:]:
            np.testing.assert_allclose(ends[mode], ends["verlet"], rtol=0, atol=1e-10 * moved)


class TestScene:
    def test_in_files(self):
        scene = puck(scheme="half_step")
        data = tomllib.loads(scene.to_toml())
        assert data["time"]["scheme"] == "half_step"
        assert scene_from_dict(data) == scene
        assert Scene(scene.bodies).to_dict()["time"]["scheme"] == "exact"
        del data["time"]
        assert scene_from_dict(data).time.scheme == "exact"
        assert scene_from_dict(data).hash != scene.hash
        with pytest.raises(InputError, match=r"time\.scheme.*exact, half_step.*'euler'"):
            scene_from_dict({**data, "time": {"scheme": "euler"}})

    def test_where_it_is_the_old_one(self):
        assert read_bed("bed_9Hz").scene.time.scheme == "half_step"
        assert paper_scene(frequency=9.0).time.scheme == "half_step"

    def test_a_drag_leaves_the_mass_alone(self):
        """The kick takes a constant drag for more mass; the body that a user sees has its own."""
        sim = Simulation(puck(use("linear_drag", c=1.0)))
        sim.advance(10)
        assert sim.body("puck").mass == pytest.approx(MASS, rel=1e-15) or sim.units.mass != 1.0
        # the force is that which the motion shows
        before = sim.raw()["vx"][0]
        sim.advance(1)
        assert sim.forces()[0, 0] == pytest.approx(MASS * (sim.raw()["vx"][0] - before) / sim.dt, rel=1e-12)
