"""The reference integrator against closed solutions, and against a bed of an independent code."""

import ast
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from granswim_pymunk.errors import InputError, SimulationError
from granswim_pymunk.scene import Body, Scene, Time, swimmer, use
from granswim_pymunk.validation import (
    cases_bed,
    cases_bodies,
    cases_contact,
    linked,
    reference,
    reference_forces,
    reference_mechanisms,
)
from granswim_pymunk.validation.analytic import pendulum_period
from granswim_pymunk.validation.cases_bodies import MASS, one_body
from granswim_pymunk.validation.crosscheck import crosscheck
from granswim_pymunk.validation.reference import Reference, exact
from granswim_pymunk.validation.reference_forces import bending, bending_energy

G = (0.0, -9.81)


def disk(name, x, y, vx=0.0, vy=0.0, role="free", mass=MASS, radius=0.01, inertia=None):
    return Body(name, role, radius, mass, initial=(x, y, vx, vy), inertia=inertia)


def assert_holds(case):
    assert case.figures
    failed = [f"{f.name}: {f.value:g} > {f.bound:g}" for f in case.figures if not f.holds]
    assert not failed, f"{case.name}: {'; '.join(failed)}"


@pytest.mark.parametrize(
    "case",
    [
        cases_contact.linear_collision,
        cases_contact.hertz_collision,
        cases_contact.impulse_collision,
        cases_bodies.spring,
        cases_bodies.motions,
        cases_bed.momentum,
    ],
)
def test_closed_solutions(case):
    assert_holds(case("reference", quick=True))


def test_bed_of_another_code():
    found = {d.steps: d.max_position_error for d in crosscheck("bed_9Hz", "reference", most=100)}
    assert set(found) == {1, 10, 100}
    assert max(found.values()) <= 1e-12


def test_shares_no_force_code():
    for module in (reference, reference_forces, reference_mechanisms, linked):
        tree = ast.parse(Path(module.__file__).read_text(encoding="utf-8"))
        imported = {node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
        imported |= {
            name.name for node in ast.walk(tree) if isinstance(node, ast.Import) for name in node.names
        }
        assert not [name for name in imported if "laws" in name or "engine" in name]
        # nor what a scene has made of its inputs by the actuators' own code
        used = {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
        assert not used & {"commands", "series", "function"}


class TestBending:
    def test_elastic_is_the_gradient_of_its_energy(self):
        rng = np.random.default_rng(1)
        angle = np.cumsum(rng.uniform(-0.8, 0.8, 6))
        xy = np.zeros((7, 2))
        xy[1:] = np.cumsum(
            rng.uniform(2.5e-3, 3.5e-3, (6, 1)) * np.stack([np.cos(angle), np.sin(angle)], 1), axis=0
        )
        head, length, k = 0.3, 3e-3, 2e-3
        values = dict(
            stiffness=k, damping=0.0, amplitude=head, frequency=0.0, phase=math.pi / 2, form="elastic"
        )
        force = bending(0.0, xy, np.zeros((7, 2)), np.ones(7), length=length, **values)
        gradient = np.zeros_like(xy)
        for index in np.ndindex(7, 2):
            step = np.zeros_like(xy)
            step[index] = 1e-8
            up, down = (bending_energy(xy + s * step, head, stiffness=k, length=length) for s in (1, -1))
            gradient[index] = (up - down) / 2e-8
        np.testing.assert_allclose(force, -gradient, atol=1e-6 * np.abs(force).max())

    @pytest.mark.parametrize("form", ["leader", "elastic", "head_axis"])
    def test_no_net_force(self, form):
        rng = np.random.default_rng(2)
        xy = np.cumsum(rng.uniform(1e-3, 3e-3, (5, 2)), axis=0)
        values = dict(stiffness=2e-3, damping=100.0, amplitude=0.7, frequency=9.0, phase=0.1, length=3e-3)
        force = bending(0.01, xy, rng.normal(size=(5, 2)), np.ones(5), form=form, **values)
        assert np.abs(force.sum(axis=0)).max() < 1e-12 * np.abs(force).max()


class TestPairs:
    def test_collision_across_the_seam_is_the_same(self):
        law = use("contact_linear", stiffness=1e3, damping=50.0)
        middle = Scene((disk("a", 0.03, 0.0, 1.0), disk("b", 0.055, 0.004)), (law,), periodic_x=0.1)
        seam = Scene((disk("a", 0.08, 0.0, 1.0), disk("b", 0.105 - 3 * 0.1, 0.004)), (law,), periodic_x=0.1)
        runs = [Reference(scene, dt=1e-5) for scene in (middle, seam)]
        for run in runs:
            run.advance(3000)
        np.testing.assert_allclose(runs[0].state().v, runs[1].state().v, atol=1e-9)
        assert runs[0].state().v[1, 0] > 0.3  # they did collide

    def test_list_is_renewed(self):
        rng = np.random.default_rng(4)
        bed = cases_bed.small_bed()
        run = Reference(bed, dt=2e-6)
        for _ in range(3):
            run.xy += rng.normal(0.0, 4e-4, run.xy.shape)
            fresh = Reference(replace(bed, laws=bed.laws), dt=2e-6)
            fresh.xy = run.xy
            fresh.laws.pairs.built_at = None
            np.testing.assert_array_equal(run.forces(), fresh.laws(run.t, run.xy, run._v))

    def test_disks_of_a_swimmer_do_not_touch(self):
        bodies = swimmer(disks=3)
        bodies[2] = replace(bodies[2], initial=(0.5e-3, 1e-3, 0.0, 0.0))
        run = Reference(Scene(tuple(bodies), (use("contact_linear", stiffness=1e3),)), dt=1e-6)
        assert not run.forces().any()

    def test_period_too_short(self):
        scene = Scene(
            (disk("a", 0, 0), disk("b", 0.02, 0)), (use("contact_linear", stiffness=1.0),), periodic_x=0.03
        )
        with pytest.raises(InputError, match="periodic_x"):
            Reference(scene, dt=1e-3)


class TestConstraints:
    @pytest.mark.parametrize("inertia", [None, 4e-4])
    def test_pendulum(self, inertia):
        amplitude, length = 1.5, 0.3
        start = (length * math.sin(amplitude), -length * math.cos(amplitude), 0.0, 0.0)
        pin = use("pin", bodies=["ball"], anchor=(0.0, 0.0), length=length)
        scene = one_body(use("gravity"), pin, initial=start, gravity=G, inertia=inertia)
        period = pendulum_period(length, 9.81, amplitude, MASS, inertia or 0.0)
        run = Reference(scene, dt=period / 4000)
        run.advance(2000)
        assert run.state().angle[0] == pytest.approx(-amplitude, abs=1e-5)
        assert abs(run.state().spin[0]) < 1e-3
        run.advance(1000)
        state = run.state()
        assert abs(state.angle[0]) < 1e-4
        fastest = math.sqrt(
            2 * MASS * 9.81 * length * (1 - math.cos(amplitude)) / (MASS * length**2 + (inertia or 0.0))
        )
        assert state.spin[0] == pytest.approx(fastest, rel=1e-5)
        assert np.hypot(*state.v[0]) == pytest.approx(length * fastest, rel=1e-5)
        np.testing.assert_allclose(exact(scene, np.array([0.75 * period])), state.xy[None], atol=1e-6)

    def test_rail_keeps_its_line(self):
        rail = use("rail", direction=(1.0, 2.0))
        run = Reference(one_body(use("gravity"), rail, initial=(0.1, 0.2, 1.0, 1.0), gravity=G), dt=1e-3)
        run.advance(500)
        along = run.state().xy[0] - (0.1, 0.2)
        assert along[1] == pytest.approx(2 * along[0], rel=1e-12)

    def test_drive_pushes_and_is_not_pushed(self):
        scene = Scene(
            (disk("pusher", 0.0, 0.0), disk("ball", 0.03, 0.0)),
            (use("contact_linear", stiffness=1e3, damping=10.0), use("drive", bodies=["pusher"])),
            inputs={"pusher": ((0.0, 0.1, 0.2), (0.0, 1.0, 1.0))},
        )
        times = np.array([0.05, 0.1, 0.15])
        for path in (Reference(scene, dt=1e-5).sample(times), exact(scene, times, rtol=1e-8, max_step=1e-3)):
            np.testing.assert_allclose(path[:, 0, 0], [0.0125, 0.05, 0.1], atol=1e-12)
            assert path[-1, 1, 0] > 0.119

    def test_two_on_one_body(self):
        laws = use("rail", direction=(1.0, 0.0)), use("pin", bodies=["ball"], anchor=(0.0, 0.0), length=0.1)
        with pytest.raises(InputError, match="has a rail already"):
            Reference(one_body(*laws, initial=(0.1, 0.0, 0.0, 0.0)), dt=1e-3)

    def test_drive_without_input(self):
        with pytest.raises(InputError, match="ball"):
            Reference(one_body(use("drive", bodies=["ball"]), initial=(0.0, 0.0, 0.0, 0.0)), dt=1e-3)


class TestImpulses:
    def test_cradle_keeps_its_energy(self):
        length, n, amplitude = 0.3, 4, 0.6
        bodies = [disk(str(k), 0.02 * k, -length) for k in range(n)]
        bodies[0] = disk("0", -length * math.sin(amplitude), -length * math.cos(amplitude))
        pins = [use("pin", bodies=[str(k)], anchor=(0.02 * k, 0.0), length=length) for k in range(n)]
        scene = Scene(
            tuple(bodies), (use("gravity"), use("contact_elastic", restitution=1.0), *pins), gravity=G
        )
        half = pendulum_period(length, 9.81, amplitude) / 2
        run = Reference(scene, dt=half / 2000)
        run.advance(2000)
        np.testing.assert_allclose(run.state().angle, [0.0, 0.0, 0.0, amplitude], atol=2e-3)

    def test_bouncing_ball_comes_to_rest(self):
        floor = disk("floor", 0.0, -1.0, role="wall", radius=1.0)
        laws = use("gravity"), use("rail", direction=(0.0, 1.0)), use("contact_elastic", restitution=0.5)
        run = Reference(Scene((floor, disk("ball", 0.0, 0.06)), laws, gravity=G), dt=5e-4)
        fall = math.sqrt(2 * 0.05 / 9.81)
        top = run.sample(np.array([fall + 0.5 * fall]))[0, 1, 1]  # 0.5 v upwards for 0.5 v/g
        assert top == pytest.approx(0.01 + 0.25 * 0.05, rel=1e-3)
        run.advance(2000)
        assert run.state().xy[1, 1] == pytest.approx(0.01, abs=1e-5)
        assert abs(run.state().v[1, 1]) < 0.01


class TestRun:
    def test_leapfrog_start(self):
        k, dt, n = 3.0, 1e-3, 50
        scene = one_body(use("spring", anchor=(0.0, 0.0), stiffness=k), initial=(0.1, 0.0, 0.2, 0.0))
        run = Reference(scene, dt=dt, start="leapfrog")
        x, v = 0.1, 0.2
        for _ in range(n):
            x += dt * v
            v -= dt * k / MASS * x
        run.advance(n)
        assert run.state().xy[0, 0] == pytest.approx(x, rel=1e-13)
        assert run.v_half[0, 0] == pytest.approx(v, rel=1e-12)
        assert run.state().v[0, 0] == pytest.approx(v + 0.5 * dt * k / MASS * x, rel=1e-12)

    def test_sampling_does_not_disturb(self):
        bed = cases_bed.small_bed()
        plain, sampled = Reference(bed, dt=2e-6), Reference(bed, dt=2e-6)
        times = np.array([41.3e-6, 0.0, 12e-6, 41.3e-6])
        seen = sampled.sample(times)
        plain.advance(6)
        np.testing.assert_array_equal(seen[2], plain.state().xy)
        plain.advance(14)
        np.testing.assert_allclose(seen[0], plain.state().xy + 1.3e-6 * plain.v_half, atol=1e-15)
        np.testing.assert_array_equal(seen[0], seen[3])
        np.testing.assert_array_equal(sampled.state().xy, plain.state().xy)
        assert sampled.sample(np.array([50e-6]), rows=np.array([2])).shape == (1, 1, 2)

    def test_extra_force(self):
        scene = one_body(initial=(0.0, 0.0, 0.0, 0.0))
        times = np.array([1.0])

        def push(t, xy, v):
            return np.full_like(xy, MASS * 2.0)

        np.testing.assert_allclose(Reference(scene, dt=1e-2, extra=push).sample(times)[0, 0], 1.0, rtol=1e-12)
        np.testing.assert_allclose(exact(scene, times, extra=push)[0, 0], 1.0, rtol=1e-9)

    def test_refuses(self):
        scene = one_body(use("linear_drag", c=1e-3), initial=(0.0, 0.0, 1.0, 0.0))
        with pytest.raises(InputError, match="time step"):
            Reference(scene)
        assert Reference(replace(scene, time=Time(dt=1e-3))).dt == 1e-3
        with pytest.raises(InputError, match="leapfrog"):
            Reference(scene, dt=1e-3, start="euler")
        with pytest.raises(InputError, match="before the present time"):
            Reference(scene, dt=1e-3).sample(np.array([-1.0]))
        nowhere = Scene((Body("b", "free", 0.01, MASS),))
        with pytest.raises(InputError, match="body b: needs initial"):
            Reference(nowhere, dt=1e-3)
        with pytest.raises(InputError, match="instantaneous"):
            exact(scene.with_laws(use("contact_elastic", restitution=1.0)), np.array([1.0]))

    def test_not_finite(self):
        scene = one_body(initial=(0.0, 0.0, 0.0, 0.0))
        with pytest.raises(SimulationError, match="ball is not finite"):
            Reference(
                scene, dt=1e-3, extra=lambda t, xy, v: np.full_like(xy, np.nan if t > 4e-3 else 0.0)
            ).advance(9)
