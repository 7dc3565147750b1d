"""The engine: modes against each other, the seam, lists, laws of a user's own, bits, lifetime of callbacks."""

import gc
import hashlib
import logging
import math
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pymunk
import pytest

from granswim_pymunk.engine import MODES, Simulation
from granswim_pymunk.errors import InputError, SimulationError
from granswim_pymunk.laws import Parameter, law
from granswim_pymunk.scene import Body, Scene, Time, swimmer, use

LENGTH, HEIGHT = 0.024, 0.016  # m
CONTACT = use("contact_linear", stiffness=2.2e3, damping=1e4)


def small_bed(*laws, seed=1, flow=-1.5, dt=2e-6, shift=0.0) -> Scene:
    """A swimmer of four disks and some 60 lively grains between two walls, flowing across the seam."""
    rng = np.random.default_rng(seed)
    disks = swimmer(disks=4, head=(0.002, HEIGHT / 2))
    bodies = [replace(b, initial=(b.initial[0] + shift, b.initial[1], flow, 0.0)) for b in disks]
    for k in range(12):
        for y in (0.0, HEIGHT):
            x = (k + 0.5) * LENGTH / 12 + shift
            bodies.append(Body(f"w{k}{'ab'[y > 0]}", "wall", 1e-3, 1.0, initial=(x, y, 0.0, 0.0)))
    for row in range(7):
        for column in range(12):
            x, y = (column + 0.5 * (row % 2)) * 2e-3, 2.0e-3 + row * 2.0e-3
            radius = float(rng.uniform(0.85e-3, 1.0e-3))
            if any(math.hypot(x - d.initial[0] + shift, y - d.initial[1]) < radius + d.radius for d in disks):
                continue
            v = rng.normal(0.0, 0.5, 2)
            mass = 1004 * 4 / 3 * math.pi * radius**3
            bodies.append(
                Body(f"g{row}-{column}", "grain", radius, mass, initial=(x + shift, y, float(v[0] + flow), float(v[1])))
            )
    swim = (
        CONTACT,
        use("union", stiffness=1e3, damping=1e3),
        use("bending", stiffness=2e-3, damping=1e2, amplitude=0.8, frequency=9.0),
        use("linear_drag", c=2.3e-5),
    )
    return Scene(bodies=tuple(bodies), laws=(*swim, *laws), periodic_x=LENGTH, time=Time(dt=dt))


def free(*laws, initial=(0.0, 0.0, 0.0, 0.0), mass=1e-3, dt=1e-4, **more) -> Scene:
    """One free disk."""
    return Scene((Body("0", "free", 5e-3, mass, initial=initial),), laws=laws, time=Time(dt=dt), **more)


def bits(*arrays: np.ndarray) -> str:
    return hashlib.sha256(b"".join(np.ascontiguousarray(a).tobytes() for a in arrays)).hexdigest()


def run(scene, mode="verlet", steps=400, **more):
    sim = Simulation(scene, mode=mode, **more)
    sim.advance(steps)
    return sim


class TestModes:
    @pytest.mark.parametrize(("mode", "steps"), [("chipmunk", 600), ("batch", 400), ("python", 120)])
    @pytest.mark.parametrize("shift", [0.0, -3.1 * LENGTH])
    def test_agree_across_the_seam(self, mode, steps, shift):
        scene = small_bed(shift=shift)
        fast, other = run(scene, "verlet", steps), run(scene, mode, steps)
        start = np.array([b.initial[:2] for b in scene.bodies])
        a, b = fast.state(), other.state()
        # the bed really moves: some cross the seam, some meet
        crossed = np.floor(a.xy[:, 0] / LENGTH) != np.floor(start[:, 0] / LENGTH)
        assert crossed.sum() >= 2
        assert len(fast.contacts().i) >= 5
        # rounding differs, and collisions at a metre a second amplify it
        np.testing.assert_allclose(b.xy, a.xy, rtol=0, atol=1e-10)
        np.testing.assert_allclose(b.v, a.v, rtol=0, atol=1e-6)
        np.testing.assert_allclose(other.forces(), fast.forces(), rtol=0, atol=1e-5)

    def test_body_that_drifts_through_several_periods(self):
        """A lone disk between grains at rest: it meets each of them once a period, in every period."""
        still = [
            Body(f"{k}", "grain", 1e-3, 4e-6, initial=(0.004 * k + 0.003, 0.0019 * (-1) ** k, 0.0, 0.0))
            for k in range(6)
        ]
        fast = Body("fast", "grain", 1e-3, 1.0, initial=(0.001, 0.0, -40.0, 0.0))
        scene = Scene((fast, *still), laws=(CONTACT,), periodic_x=LENGTH, time=Time(dt=1e-6))
        sims = [run(scene, mode, 2000) for mode in ("verlet", "chipmunk")]
        a, b = (sim.state().xy for sim in sims)
        assert a[0, 0] < -3 * LENGTH
        assert (np.abs(a[1:, 1]) > 0.0025).all()  # all were hit and flew off sideways
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-11)

    def test_unknown_mode(self):
        with pytest.raises(InputError, match="unknown mode"):
            Simulation(free(), mode="fast")

    def test_batch_where_callbacks_cannot_be_installed(self, monkeypatch, caplog):
        scene = small_bed()
        expected = run(scene, steps=50).state()
        monkeypatch.setenv("GRANSWIM_NO_NATIVE", "1")
        with caplog.at_level(logging.WARNING, logger="granswim"):
            sim = run(scene, steps=50)
        assert sim.mode == "batch" and "batch" in caplog.text
        np.testing.assert_allclose(sim.state().xy, expected.xy, rtol=0, atol=1e-14)

    @pytest.mark.parametrize("mode", MODES)
    def test_force_of_the_user_counts(self, mode):
        """What a user puts on a body acts for one step, beside the laws."""
        sim = Simulation(free(), mode=mode)
        sim.advance(1)
        sim.body("0").force = (2e-3 / sim.units.force, 0.0)
        sim.body("0").torque = 1e-6 / sim.units.torque
        sim.advance(1)
        moment = sim.scene.bodies[0].moment
        assert sim.raw()["vx"][0] == pytest.approx(2e-3 / 1e-3 * 1e-4, rel=1e-12)
        assert sim.raw()["spin"][0] == pytest.approx(1e-6 / moment * 1e-4, rel=1e-12)
        sim.advance(3)
        assert sim.raw()["vx"][0] == pytest.approx(2e-4, rel=1e-12)
        assert sim.body("0").angle == pytest.approx(3 * sim.raw()["spin"][0] * 1e-4, rel=1e-12)


class TestLists:
    def test_overflow_regrows(self):
        scene = small_bed()
        expected = run(scene, steps=500).state()
        sim = Simulation(scene)
        sim.backend.make_room(40)
        sim.advance(500)
        assert sim.backend.state.lists.room > 40
        assert bits(sim.state().xy, sim.state().v) == bits(expected.xy, expected.v)

    def test_touching_disks_without_a_pair_law(self):
        disks = tuple(Body(str(k), "free", 5e-3, 1e-3, initial=(k * 9e-3, 0.0, 0.0, 0.0)) for k in range(4))
        sim = Simulation(Scene(disks, laws=(use("linear_drag", c=1e-4),), time=Time(dt=1e-4)), mode="chipmunk")
        sim.advance(20)
        assert sim.step == 20 and not sim.state().v.any()

    def test_overflow_in_the_middle_of_a_block(self):
        """Grains far apart that fly together: the first list is short, a later one does not fit."""
        rng = np.random.default_rng(3)
        bodies = []
        for k in range(80):
            angle = 2 * math.pi * k / 80
            away = float(rng.uniform(0.03, 0.06))
            x, y = away * math.cos(angle), away * math.sin(angle)
            bodies.append(Body(f"{k}", "grain", 1e-3, 4e-6, initial=(x, y, -80 * x, -80 * y)))
        scene = Scene(tuple(bodies), laws=(CONTACT,), time=Time(dt=2e-6))
        plain = Simulation(scene)
        plain.advance(6000)
        tight = Simulation(scene)
        tight.backend.make_room(60)
        tight.advance(6000)
        assert tight.backend.state.lists.room > 60 and tight.backend.context["n_pairs"] > 60
        assert bits(plain.state().xy) == bits(tight.state().xy)
        times = np.linspace(0.0, 0.012, 7)
        sampled = Simulation(scene)
        sampled.backend.make_room(60)
        np.testing.assert_array_equal(sampled.sample(times), Simulation(scene).sample(times))

    def test_skin_changes_no_bit(self):
        scene = small_bed()
        results = {bits(run(scene, steps=500, skin=skin).raw()["x"]) for skin in (2e-5, 1e-4, 3e-4, 1e-3)}
        assert len(results) == 1

    @pytest.mark.parametrize("periodic", [0.0, 0.004, 0.0075, 0.03])
    def test_pairs_against_all_pairs(self, periodic):
        """The list holds just the pairs within reach, whatever the number of cells."""
        rng = np.random.default_rng(7)
        n = 120
        xy = rng.uniform(-0.03, 0.03, (n, 2))
        radius = rng.uniform(2e-4, 7e-4, n)
        bodies = tuple(
            Body(f"{k}", "grain" if k % 9 else "wall", float(radius[k]), 1e-6, initial=(*xy[k].tolist(), 0.0, 0.0))
            for k in range(n)
        )
        sim = Simulation(Scene(bodies, laws=(CONTACT,), periodic_x=periodic or None, time=Time(dt=1e-6)))
        extra = 3e-4
        i, j = sim.backend.pairs_within(sim.backend.raw(), extra)
        rows = sim.backend.order.rows_of
        assert ((i[1:] > i[:-1]) | ((i[1:] == i[:-1]) & (j[1:] > j[:-1]))).all()
        found = {(min(a, b), max(a, b)) for a, b in zip(rows[i].tolist(), rows[j].tolist(), strict=True)}
        expected = set()
        for a in range(n):
            for b in range(a + 1, n):
                d = xy[b] - xy[a]
                if periodic:
                    d[0] -= periodic * math.floor(d[0] / periodic + 0.5)
                if math.hypot(*d) < radius[a] + radius[b] + extra and not (a % 9 == 0 and b % 9 == 0):
                    expected.add((a, b))
        assert found == expected and len(found) == len(i)

    def test_collapsed_bed_is_an_error(self):
        """Bodies that run away are told as such, or as not finite, and never as a crash."""
        scene = small_bed(dt=5e-3)
        with pytest.raises(SimulationError, match=r"not finite|collapsed|away"):
            Simulation(scene).advance(3000)

    @pytest.mark.parametrize("mode", MODES)
    def test_nan_is_an_error_that_names_the_body(self, mode):
        scene = small_bed()
        sim = Simulation(scene, mode=mode)
        sim.advance(3)
        sim.body("g0-3").velocity = (math.nan, 0.0)
        with pytest.raises(SimulationError, match="not finite"):
            sim.advance(20)


class TestBits:
    def test_repeatable_in_one_process(self):
        scene = small_bed()
        for mode in ("verlet", "chipmunk"):
            one, two = run(scene, mode), Simulation(scene, mode=mode)
            for _ in range(40):
                two.advance(10)
            assert bits(*one.raw().values()) == bits(*two.raw().values())

    def test_repeatable_across_processes(self):
        script = (
            "from test_engine import *\n"
            "for mode in ('verlet', 'chipmunk'):\n"
            "    print(bits(*run(small_bed(), mode).raw().values()))\n"
        )
        here = os.path.dirname(__file__)
        results = set()
        for seed in ("1", "2"):
            environment = {**os.environ, "PYTHONHASHSEED": seed}
            done = subprocess.run(
                [sys.executable, "-c", script], cwd=here, env=environment, capture_output=True, text=True, check=True
            )
            results.add(done.stdout)
        assert len(results) == 1 and len(results.pop().split()) == 2

    def test_looking_changes_nothing(self):
        scene = small_bed()
        looked = Simulation(scene)
        for _ in range(8):
            looked.advance(50)
            looked.contacts(), looked.forces(), looked.state(), looked.space
        a, b = run(scene).raw(), looked.raw()
        assert bits(*a.values()) == bits(*b.values())


STIFFNESS = 0.5  # N/m, a constant that a law below looks up
SLOTS = 3


@law(kind="body", expression="F = -k x", reference="test", parameters=[Parameter("pull", "1", "factor", low=0.0)])
def trap_of_the_test(x, y, pull):
    return -pull * STIFFNESS * x, -pull * np.sqrt(STIFFNESS * STIFFNESS) * y * np.float64(SLOTS) / 3.0


@law(
    kind="body",
    expression="F = -k x",
    reference="test",
    parameters=[Parameter("k", "N/m", "stiffness")],
    compiled=False,
)
def plain_trap_of_the_test(x, y, k):
    return tuple(-k * value for value in [x, y])  # a generator is nothing that numba compiles


def outside(x):
    if x > 0.1:
        raise ValueError("no water there")
    return 1.0


@law(kind="body", expression="F = k", reference="test", parameters=[Parameter("k", "N", "push")], compiled=False)
def push_in_water_of_the_test(x, y, k):
    return k * outside(x), 0.0


@law(kind="body", expression="F = k", reference="test", parameters=[Parameter("k", "N", "push")])
def compiled_push_in_water_of_the_test(x, y, k):
    return k * outside(x), 0.0


class TestLawsThatRaise:
    """An error inside of a callback has nowhere to go: the run must not go on without the force."""

    def scene(self, law):
        bodies = (Body("a", "free", radius=0.01, mass=1.0, initial=(0.0, 0.0, 1.0, 0.0)),)
        return Scene(bodies=bodies, laws=(use(law, k=1.0),), time=Time(dt=0.01))

    def test_plain_ones_stop_the_run(self):
        sim = Simulation(self.scene(push_in_water_of_the_test), mode="python")
        says = r"push_in_water_of_the_test raised ValueError: no water there \(t = 0\.1"
        with pytest.raises(SimulationError, match=says):
            sim.advance(30)
        assert 8 <= sim.step <= 11

    @pytest.mark.parametrize("mode", ["verlet", "chipmunk"])
    def test_compiled_ones_are_refused(self, mode):
        with pytest.raises(InputError, match="compiled_push_in_water_of_the_test: raises errors"):
            Simulation(self.scene(compiled_push_in_water_of_the_test), mode=mode)


@law(
    kind="pair",
    expression="F_n = s while the gap is below range",
    reference="test",
    parameters=[Parameter("s", "N", "force"), Parameter("range", "m", "range", low=0.0)],
    reach="range",
)
def far_push_of_the_test(gap, s, range):
    return s * (1.0 - gap / range), 0.0


@law(kind="pair", expression="F_t = -c v_t", reference="test", parameters=[Parameter("c", "kg/s", "tangential drag")])
def rub_of_the_test(vt, c):
    return 0.0, -c * vt


class TestOwnLaws:
    def oscillation(self, item, mode="verlet"):
        sim = Simulation(free(item, initial=(0.01, 0.02, 0.0, 0.0)), mode=mode)
        sim.advance(1000)
        omega = math.sqrt(0.5 / 1e-3)
        # leapfrog at omega dt = 2e-3: phase error (omega dt)^2/24 a radian
        np.testing.assert_allclose(sim.state().xy[0], np.array([0.01, 0.02]) * math.cos(omega * 0.1), atol=1e-7)
        return sim

    @pytest.mark.parametrize("mode", ["verlet", "python"])
    def test_compiled_with_constants(self, mode):
        assert self.oscillation(use("trap_of_the_test", pull=1.0), mode).mode == mode

    def test_a_function_without_source(self):
        scope = {}
        exec("def made_up_of_the_test(x, y, k):\n    return -k * x, -k * y\n", scope)
        declared = law(
            kind="body", expression="F = -k x", reference="test", parameters=[Parameter("k", "N/m", "stiffness")]
        )(scope["made_up_of_the_test"])
        self.oscillation(use(declared, k=0.5))

    def test_plain_python_runs_in_python_mode_and_says_so(self, caplog):
        with caplog.at_level(logging.WARNING, logger="granswim"):
            sim = self.oscillation(use("plain_trap_of_the_test", k=0.5))
        assert sim.mode == "python" and "plain Python" in caplog.text

    def test_what_numba_cannot_compile_is_named(self):
        @law(kind="body", expression="-", reference="test")
        def hopeless_of_the_test(x):
            return {str(x): open}, 0.0

        with pytest.raises(InputError, match="hopeless_of_the_test"):
            Simulation(free(use("hopeless_of_the_test")))

    def test_pair_law_that_reaches_across_the_seam(self):
        """Verlet and python find pairs before contact; chipmunk cannot and says so."""
        scene = small_bed(use("far_push_of_the_test", s=1e-3, range=5e-4))
        a, b = run(scene, steps=30).state(), run(scene, "python", 30).state()
        np.testing.assert_allclose(a.xy, b.xy, rtol=0, atol=1e-12)
        assert np.abs(a.xy - run(small_bed(), steps=30).state().xy).max() > 1e-9
        with pytest.raises(InputError, match="acts before contact"):
            Simulation(scene, mode="chipmunk")

    def test_spin(self):
        """A tangential law turns the disks; angular momentum about the origin is kept."""
        bodies = (
            Body("a", "free", 1e-3, 2e-6, initial=(0.0, 0.0, 0.3, 0.1)),
            Body("b", "free", 1.5e-3, 7e-6, initial=(2.49e-3, 1e-4, -0.3, -0.2)),
        )
        scene = Scene(bodies, laws=(CONTACT, use("rub_of_the_test", c=1e-3)), time=Time(dt=1e-7))
        states = [run(scene, mode, 400).state() for mode in ("verlet", "chipmunk", "batch", "python")]
        for other in states[1:]:
            np.testing.assert_allclose(other.xy, states[0].xy, rtol=0, atol=1e-14)
            np.testing.assert_allclose(other.spin, states[0].spin, rtol=1e-9)
        mass = np.array([b.mass for b in bodies])
        moment = np.array([b.moment for b in bodies])

        def angular(xy, v, spin):
            return float((mass * (xy[:, 0] * v[:, 1] - xy[:, 1] * v[:, 0]) + moment * spin).sum())

        start = np.array([b.initial for b in bodies])
        before = angular(start[:, :2], start[:, 2:], np.zeros(2))
        after = states[0]
        assert np.abs(after.spin).min() > 1.0
        # torques act at the radii, forces at the centres: apart by the overlap, a hundredth of a radius
        assert angular(after.xy, after.v, after.spin) == pytest.approx(before, rel=0.02)


class TestSpace:
    def test_pymunk_understands_it(self):
        scene = small_bed()
        sim = run(scene)
        xy = sim.state().xy
        space, unit = sim.space, sim.units.length
        for k in (0, 10, 40):
            hit = space.point_query_nearest(tuple(xy[k] / unit), 0.0, pymunk.ShapeFilter())
            assert hit is not None and hit.shape.body is sim.body(scene.bodies[k].id)
            assert hit.shape.radius == pytest.approx(scene.bodies[k].radius / unit)
        assert len(space.bodies) == len(scene.bodies)
        sim.advance(200)
        xy = sim.state().xy
        hit = sim.space.point_query_nearest(tuple(xy[40] / unit), 0.0, pymunk.ShapeFilter())
        assert hit.shape.body is sim.body(scene.bodies[40].id)
        sim.advance(10)  # goes on after somebody looked
        np.testing.assert_array_equal(sim.state().xy, run(scene, steps=610).state().xy)

    def test_debug_draw(self):
        from matplotlib.figure import Figure
        from pymunk.matplotlib_util import DrawOptions

        sim = run(small_bed(), steps=10)
        axes = Figure().add_subplot()
        with pytest.warns(DeprecationWarning):  # pymunk would rather drop it; it is there as yet
            options = DrawOptions(axes)
        sim.space.debug_draw(options)
        assert len(axes.patches) >= len(sim.scene.bodies)

    @pytest.mark.parametrize("mode", MODES)
    def test_space_outlives_the_simulation(self, mode):
        """The callbacks leave with the simulation; Chipmunk goes on with its own."""
        sim = run(small_bed(), mode, 10)
        space, body = sim.space, sim.body("g3-9")
        before, velocity = body.position, body.velocity
        del sim
        gc.collect()
        for _ in range(20):
            space.step(1e-3)
        assert body.position != before or velocity == (0.0, 0.0)
        assert tuple(body.center_of_gravity) == (0.0, 0.0)
        assert all(math.isfinite(b.position.x) for b in space.bodies)

    def test_many_that_come_and_go(self):
        scene = small_bed()
        kept = [Simulation(scene, mode=mode).space for mode in ("verlet", "chipmunk") for _ in range(5)]
        gc.collect()
        sims = [Simulation(scene) for _ in range(5)]
        for sim in sims:
            sim.advance(20)
        for space in kept:
            space.step(1e-4)
        assert len({bits(sim.state().xy) for sim in sims}) == 1


class TestConstraints:
    @pytest.mark.parametrize("mode", MODES)
    @pytest.mark.parametrize("restitution", [1.0, 0.6])
    def test_elastic_collision(self, mode, restitution):
        """v' = -e v relative, momentum kept."""
        bodies = (
            Body("a", "free", 0.01, 0.2, initial=(0.0, 0.0, 1.0, 0.0)),
            Body("b", "free", 0.01, 0.1, initial=(0.05, 0.0, -0.5, 0.0)),
        )
        scene = Scene(bodies, laws=(use("contact_elastic", restitution=restitution),), time=Time(dt=1e-4))
        v = run(scene, mode, 500).state().v
        assert v[1, 0] - v[0, 0] == pytest.approx(restitution * 1.5, rel=1e-6)
        assert 0.2 * v[0, 0] + 0.1 * v[1, 0] == pytest.approx(0.15, rel=1e-9)
        assert np.abs(v[:, 1]).max() < 1e-12

    @pytest.mark.parametrize("mode", ["verlet", "python"])
    @pytest.mark.parametrize("restitution", [0.4, 0.9])
    @pytest.mark.parametrize("averaged", [False, True])
    def test_attraction_on_both_sides_of_an_elastic_collision(self, mode, restitution, averaged):
        """In at v, faster by the work of the force, out by e, slower by the same: v'^2 = e^2 (v^2 + w) - w."""
        force, reach, v = 0.05, 1.5e-3, 0.5
        bodies = (
            Body("a", "free", 0.01, 0.006, initial=(0.0, 0.0, v, 0.0)),
            Body("b", "free", 0.015, 0.018, initial=(0.05, 0.0, 0.0, 0.0)),
        )
        laws = use("contact_elastic", restitution=restitution), use("cohesion", force=force, range=reach)
        # the list of near pairs is longer lived than the steps are: the disks come a long way before they meet
        sim = Simulation(Scene(bodies, laws, time=Time(dt=2e-5)), mode=mode, averaged=averaged)
        out = sim.sample(np.array([0.3, 0.4]))
        gap = np.diff(out[:, :, 0], axis=1)[:, 0]
        work = 2 * force * reach * (1 / 0.006 + 1 / 0.018)
        expected = math.sqrt(restitution**2 * (v**2 + work) - work)
        assert (gap[1] - gap[0]) / 0.1 == pytest.approx(expected, rel=0.01)

    @pytest.mark.parametrize("mode", MODES)
    def test_pin_keeps_its_length(self, mode):
        scene = free(
            use("gravity"), use("pin", bodies=["0"], anchor=(0.1, 0.2), length=0.5),
            initial=(0.1 + 0.5 * math.sin(1.0), 0.2 - 0.5 * math.cos(1.0), 0.0, 0.0), gravity=(0.0, -9.81), dt=1e-3,
        )  # fmt: skip
        sim = Simulation(scene, mode=mode)
        for _ in range(20):
            sim.advance(50)
            x, y = sim.state().xy[0]
            assert math.hypot(x - 0.1, y - 0.2) == pytest.approx(0.5, abs=1e-13)
        assert x < 0.1  # it swings

    @pytest.mark.parametrize("mode", MODES)
    def test_rail_and_drive(self, mode):
        direction = (3.0, 4.0)
        scene = Scene(
            (
                Body("slides", "free", 1e-3, 1e-3, initial=(0.0, 0.0, 0.3, 0.4)),
                Body("cart", "free", 1e-3, 1e-3, initial=(0.1, 0.0, 0.0, 0.0)),
            ),
            laws=(
                use("gravity"),
                use("rail", bodies=["slides"], direction=direction),
                use("drive", bodies=["cart"], gain=2.0, direction=(1.0, 0.0)),
            ),
            gravity=(0.0, -1.0),
            inputs={"cart": ((0.0, 0.1, 1.0), (0.0, 0.5, 0.5))},
            time=Time(dt=1e-3),
        )
        sim = Simulation(scene, mode=mode)
        sim.advance(300)
        state = sim.state()
        across = np.array([-0.8, 0.6])
        assert abs(state.xy[0] @ across) < 1e-14
        along = 0.5 * 0.3 - 0.5 * 0.8 * 0.3**2
        assert state.xy[0] @ np.array([0.6, 0.8]) == pytest.approx(along, abs=1e-6)
        # the commanded velocity in the middle of each step is followed exactly
        assert sim.raw()["vx"][1] == pytest.approx(1.0, abs=1e-14)
        assert state.xy[1, 1] == 0.0
        assert state.xy[1, 0] == pytest.approx(0.1 + 2 * (0.5 * 0.1 * 0.5 + 0.2 * 0.5), abs=1e-12)

    def test_sample_hits_the_times(self):
        sim = Simulation(free(initial=(0.0, 0.0, 2.0, -1.0)))
        times = np.array([0.0, 0.00503, 0.0101, 0.1])
        np.testing.assert_allclose(sim.sample(times)[:, 0], times[:, None] * [[2.0, -1.0]], atol=1e-15)
        with pytest.raises(InputError, match="rise"):
            sim.sample([0.05])


def two_swimmers(*laws) -> Scene:
    """Two chains of three disks side by side, stretched and bent a little."""
    bodies = []
    for k in range(2):
        for n, b in enumerate(swimmer(disks=3, head=(0.0, 0.05 * k))):
            x, y = b.initial[:2]
            bodies.append(replace(b, id=f"{'ab'[k]}{n}", initial=(1.1 * x, y + 1e-4 * n * n, 0.1 * n, 0.0)))
    return Scene(tuple(bodies), laws=laws, time=Time(dt=1e-6))


class TestTwoSwimmers:
    NAMES = ("b0", "b1", "b2")

    @pytest.mark.parametrize("mode", ["verlet", "batch", "python"])
    def test_a_law_acts_on_the_swimmer_that_it_names(self, mode):
        laws = [
            {"stiffness": 1e3, "damping": 1e3},
            {"stiffness": 2e-3, "damping": 1e2, "amplitude": 0.8, "frequency": 9.0},
        ]
        both = two_swimmers(*(use(name, **v) for name, v in zip(("union", "bending"), laws, strict=True)))
        one = two_swimmers(
            *(use(name, bodies=self.NAMES, **v) for name, v in zip(("union", "bending"), laws, strict=True))
        )
        assert len(one.chains) == 2
        full, part = (run(scene, mode, 50).forces() for scene in (both, one))
        assert (np.abs(full).max(axis=1) > 0).all()
        np.testing.assert_array_equal(part[:3], 0.0)
        np.testing.assert_array_equal(part[3:], full[3:])

    def test_one_disk_stands_for_its_swimmer(self):
        some, all_ = (
            two_swimmers(use("union", stiffness=1e3, damping=0.0, bodies=names))
            for names in (("a1",), ("a0", "a1", "a2"))
        )
        np.testing.assert_array_equal(run(some, steps=20).forces(), run(all_, steps=20).forces())


# ---- parts of a scene, and bodies that are carried along --------------------------------------


def _row_of_disks(count: int = 4) -> Scene:
    bodies = tuple(
        Body(f"d{k}", "grain", radius=1e-3, mass=3e-6, initial=(2.1e-3 * k, 0.0, 0.0, 0.0)) for k in range(count)
    )
    laws = (use("contact_linear", stiffness=200.0, damping=300.0), use("linear_drag", c=1e-6))
    return Scene(bodies, laws)


def test_carried_body_goes_its_way_and_pushes():
    """A wall that moves: what it meets is pushed, drag and contacts do not slow it, and it can be steered."""
    scene = _row_of_disks(3)
    sim = Simulation(scene, dt=1e-6, carried=[0])
    start = np.array([b.initial for b in scene.bodies])
    v = np.zeros((3, 2))
    v[0] = 0.1, 0.0
    sim.restart(start[:, :2], v, 0.0)
    first = sim.sample([0.005])[0]
    v[0] = -0.05, 0.02
    sim.steer(v)
    then = sim.sample([0.010])[0]
    assert np.allclose(first[0], (5e-4, 0.0), atol=1e-12)
    assert np.allclose(then[0], (2.5e-4, 1e-4), atol=1e-9)
    assert first[1, 0] > start[1, 0] + 2e-4 and then[2, 0] > start[2, 0]
    assert sim.state().v[0] == pytest.approx((-0.05, 0.02), abs=1e-12)


def test_part_of_a_scene_is_as_if_the_rest_were_not_there():
    scene = _row_of_disks(4)
    part = Simulation(scene, dt=1e-6, only=[1, 2])
    alone = Simulation(replace(scene, bodies=scene.bodies[1:3]), dt=1e-6)
    start = np.array([b.initial for b in scene.bodies])
    v = np.array([[0.0, 0.0], [0.2, 0.0], [0.0, 0.01], [0.0, 0.0]])
    part.restart(start[:, :2], v, 0.0)
    alone.restart(start[1:3, :2], v[1:3], 0.0)
    assert np.array_equal(part.sample([0.01], [1, 2]), alone.sample([0.01]))
    state = part.state()
    assert np.isnan(state.xy[[0, 3]]).all() and np.isfinite(state.xy[1:3]).all()
    assert np.isnan(part.forces()[[0, 3]]).all()
    with pytest.raises(InputError, match="body d0 is not simulated"):
        part.sample([0.02])


def test_impacts_begin_again_with_the_same_bits():
    """Three disks that attract one another and meet: a new simulation and one begun again."""
    bodies = [Body(f"r{r}", "free", r, 2 * r, initial=(0.0, 0.0, 0.0, 0.0)) for r in (0.01, 0.012, 0.015)]
    laws = use("contact_elastic", restitution=0.8), use("linear_drag", c=1e-3), use("cohesion", force=0.2)
    scene = Scene(tuple(bodies), laws, time=Time(dt=1e-3))
    rng = np.random.default_rng(4)
    again = None
    t = np.linspace(0.0, 0.6, 31)
    for _ in range(5):
        xy = np.array([[0.0, 0.0], [0.05, 0.02], [0.1, -0.01]]) + rng.uniform(-0.01, 0.01, (3, 2))
        v = np.array([[0.3, 0.0], [0.0, -0.1], [-0.4, 0.05]]) + rng.uniform(-0.05, 0.05, (3, 2))
        start = np.column_stack([xy, v])
        fresh = Simulation(scene.with_initial(dict(zip(scene.ids, map(tuple, start), strict=True))), averaged=True)
        if again is None:
            again = Simulation(scene.with_initial({b: (*p, 0.0, 0.0) for b, p in zip(scene.ids, xy, strict=True)}),
                               averaged=True)  # fmt: skip
            again.sample(t[:9])
        again.restart(xy, v, 0.0)
        np.testing.assert_array_equal(again.sample(t), fresh.sample(t))


@pytest.mark.parametrize("mode", MODES)
def test_absent_bodies_are_not_a_number(mode):
    run = Simulation(_row_of_disks(3), mode=mode, only=[0, 2])
    run.advance(3)
    for values in (run.state().xy, run.forces(), run.raw()["x"]):
        assert np.isnan(values[1]).all() and np.isfinite(values[[0, 2]]).all()


def test_parts_that_cannot_be_simulated_are_refused():
    scene = _row_of_disks(3)
    with pytest.raises(InputError, match="rows of the scene's 3 bodies"):
        Simulation(scene, only=[5])
    with pytest.raises(InputError, match="mode verlet"):
        Simulation(scene, mode="chipmunk", carried=[0])


def _glancing(phase: float) -> Scene:
    """Two soft disks that meet off the centre; ``phase`` [m] shifts the moment at which they touch."""
    a = Body("a", "free", 0.015, 0.02, initial=(-0.05 + phase, 0.0, 0.2, 0.0))
    b = Body("b", "free", 0.012, 0.015, initial=(0.05, 0.012, -0.15, 0.0))
    return Scene((a, b), (use("contact_linear", stiffness=150.0, damping=9.0),))


def test_averaged_contacts_touch_when_they_do_and_not_at_the_next_step():
    """The dashpot's jump rounds the moment of touching to steps; with its share of a step the error is small."""
    t = np.array([0.0, 0.3, 0.6])
    plain, averaged = [], []
    for phase in np.linspace(0.0, 6e-5, 7):
        scene = _glancing(phase)
        exact = Simulation(scene, dt=1e-6).sample(t)
        plain.append(np.abs(Simulation(scene, dt=2e-4).sample(t) - exact).max())
        averaged.append(np.abs(Simulation(scene, dt=2e-4, averaged=True).sample(t) - exact).max())
    assert np.max(plain) > 1.2e-5
    assert np.max(averaged) < 0.4 * np.max(plain)
    # the error of what is left is a smooth one of the first order in dt: no jitter between phases
    assert np.std(averaged) < 0.2 * np.std(plain)


def test_an_averaged_attraction_begins_and_ends_at_its_reach():
    """A path does not jump as the reach grows past the places where steps end."""
    a = Body("a", "free", 0.01, 0.006, initial=(0.0, 0.0, 0.5, 0.0))
    b = Body("b", "free", 0.015, 0.018, initial=(0.05, 0.004, 0.0, 0.0))
    plain, averaged = [], []
    for reach in np.linspace(1.0e-3, 1.4e-3, 41):
        laws = use("contact_elastic", restitution=0.7), use("cohesion", force=0.1, range=reach)
        scene = Scene((a, b), laws)
        for kept, on in ((plain, False), (averaged, True)):
            kept.append(Simulation(scene, dt=5e-4, averaged=on).sample([0.3])[0, 0, 0])
    jumps = [np.abs(np.diff(kept, 2)).max() for kept in (plain, averaged)]
    assert jumps[0] > 1e-4
    assert jumps[1] < 0.05 * jumps[0]


def test_forces_of_a_moment_are_not_those_of_a_step():
    scene = _glancing(0.0)
    both = [Simulation(scene, dt=2e-4, averaged=on) for on in (False, True)]
    for simulation in both:
        simulation.restart(np.array([[0.0, 0.0], [0.026999, 0.0]]), np.array([[0.2, 0.0], [0.0, 0.0]]), 0.0)
    np.testing.assert_array_equal(both[0].forces(), both[1].forces())
    assert np.abs(both[0].forces()).max() > 0


def test_a_scene_compiles_its_own_laws_and_no_more(monkeypatch):
    """Nothing of other laws, of pairs, walls, links and Chipmunk's contacts, until a scene needs it."""
    from granswim_pymunk.engine import callbacks
    from granswim_pymunk.engine.backends import compiled
    from granswim_pymunk.engine.native import offsets

    asked = []

    def watched(kind, *arguments, made=callbacks._module):
        asked.append(kind)
        return made(kind, *arguments)

    monkeypatch.setattr(callbacks, "_module", watched)
    fresh = callbacks.Kernel(offsets())
    monkeypatch.setattr(compiled, "kernel_for", lambda offsets: fresh)
    Simulation(free(use("gravity"), use("linear_drag", c=1e-3))).advance(10)
    assert asked == ["kernel", "block_gravity", "block_linear_drag"]
    Simulation(small_bed()).advance(10)
    assert {"lists", "block_contact_linear"} <= set(asked) and not {"walls", "links", "contacts"} & set(asked)


def test_names_of_the_core_are_numbers_and_arrays_of_the_context():
    """What editors see as imported stands before the text when it is compiled, and ``unpack`` makes the arrays."""
    from granswim_pymunk.engine import callbacks
    from granswim_pymunk.engine.kernel import names
    from granswim_pymunk.engine.native import offsets

    numbers = vars(callbacks.Kernel(offsets()).core)
    known = [name for name in vars(names) if not name.startswith("_") and name not in ("Any", "Callable")]
    local = {"I", "F", "n", "unpack"}
    arrays = [name for name in known if not name.isupper() and name not in numbers and name not in local]
    assert set(arrays) <= set(callbacks.INTS) and len(arrays) > 60
    assert not [name for name in known if name.isupper() and name not in numbers and name not in local]


def test_setting_up_a_scene_is_linear_in_its_bodies(monkeypatch):
    """A drag that every body has was worked out with a look at all bodies for each of them."""
    looked = 0
    mobile = Body.mobile.fget

    def counted(body):
        nonlocal looked
        looked += 1
        return mobile(body)

    monkeypatch.setattr(Body, "mobile", property(counted))
    looks = []
    for n in (50, 100):
        bodies = tuple(Body(str(k), "free", 1e-3, 1e-5, initial=(3e-3 * k, 0.0, 0.0, 0.0)) for k in range(n))
        looked = 0
        Simulation(Scene(bodies, (use("linear_drag", c=1e-5),)), dt=1e-3)
        looks.append(looked)
    assert looks[1] <= 2 * looks[0] + 10, looks
