"""Laws for what a scene may lack: engine against reference, absence at zero strength, automatic values."""

import math
from dataclasses import replace

import numpy as np
import pytest

from granswim_pymunk.errors import InputError
from granswim_pymunk.laws import all_laws, get_law, law
from granswim_pymunk.laws.actuator_deadband import beyond
from granswim_pymunk.laws.actuator_delay import delayed
from granswim_pymunk.laws.actuator_lag import lagging
from granswim_pymunk.laws.actuator_saturation import clipped
from granswim_pymunk.scene import Body, Scene, read_scene, scene_from_dict, use, write_scene
from granswim_pymunk.validation import cases_bed
from granswim_pymunk.validation.results import runner

MASS = 0.2


def bed(form="leader"):
    return cases_bed.small_bed(form=form), 2e-6


def rough_bed():
    scene, dt = bed()
    return scene.with_laws(use("contact_friction", mu=0.4, v_0=1e-2)), dt


def carts():
    """Two carts on springs of their own, one straight, one of no length."""
    springs = [
        use("spring", bodies=["a"], anchor=(0.0, 0.0), stiffness=3.0, length=0.06),
        use("spring", bodies=["b"], anchor=(0.5, 0.1), stiffness=2.0),
    ]
    bodies = (
        Body("a", "free", 0.01, MASS, initial=(0.1, 0.01, 0.05, 0.4)),
        Body("b", "free", 0.01, MASS, initial=(0.6, 0.0, 0.0, 0.2)),
        Body("c", "free", 0.01, MASS, initial=(0.9, 0.5, 0.1, 0.0)),
    )
    return Scene(bodies, tuple(springs)), 1e-3


def pendulum():
    laws = (use("gravity"), use("pin", bodies=["bob"], anchor=(0.1, 0.0), length=0.3))
    start = (0.1 + 0.3 * math.sin(0.5), -0.3 * math.cos(0.5), 0.4 * math.cos(0.5), 0.4 * math.sin(0.5))
    return Scene(
        (Body("bob", "free", 0.02, MASS, initial=start, inertia=4e-4),), laws, gravity=(0.0, -9.81)
    ), 3e-6


def driven():
    """A driven body that pulls another by a force at a distance."""
    t = np.linspace(0.0, 0.3, 31)
    bodies = (
        Body("motor", "free", 0.01, MASS, initial=(0.0, 0.0, 0.0, 0.0)),
        Body("load", "free", 0.01, MASS, initial=(0.1, 0.0, 0.0, 0.0)),
    )
    laws = (use("drive", bodies=["motor"], gain=0.5), use("distance_force", s=1.0, n=2.0, range=1.0))
    return Scene(bodies, laws, inputs={"motor": (tuple(t), tuple(np.sin(20 * t)))}), 1e-3


FORMS = {f"bed-{form}": lambda form=form: bed(form) for form in ("leader", "elastic", "head_axis")}
SCENES = {"bed": bed, "rough bed": rough_bed, "carts": carts, "pendulum": pendulum, "driven": driven, **FORMS}
CASES = [
    ("ambient_flow", "bed", {"c": 1e-4, "u": (0.3, -0.1)}),
    ("quadratic_flow", "bed", {"c": 1e-3, "u": (0.3, -0.1), "p": 2}),
    ("distance_force", "bed", {"s": 2e-3, "n": 3.0}),
    ("distance_force", "bed", {"s": -2e-3, "n": 1.5, "range": 1e-3}),
    ("point_force", "bed", {"s": 2e-3, "a": (2e-3, -1e-3), "n": 1.5}),
    ("buried_force", "bed", {"s": -2e-3, "a": (2e-3, -1e-3), "n": 4, "b": 3e-3}),
    ("pair_spring", "carts", {"k": 2.0, "f_0": 0.7}),
    ("lift", "bed", {"l": 2e-3}),
    ("periodic_force", "bed", {"a": (0.4, -0.2), "b": (0.1, 0.3), "f": 9.0}),
    *[("curved_surface", "carts", {"curvature": 0.3, "bent": b, "centre": (0.1, -0.2)}) for b in (0, 1, 2)],
    ("cohesion", "bed", {"force": 1e-3, "range": 1e-4}),
    ("contact_friction", "bed", {"mu": 0.4, "v_0": 1e-2}),
    ("rolling_resistance", "rough bed", {"mu_r": 0.3, "w_0": 1e3}),
    ("wall_drag", "bed", {"c": 1e-3, "range": 2e-3}),
    ("pair_lubrication", "bed", {"c": 3e3, "range": 2e-4}),
    ("nonlinear_spring", "carts", {"k_3": 40.0}),
    ("joint_friction", "pendulum", {"torque": 1.0}),
    ("joint_drag", "pendulum", {"c": 0.05}),
    ("added_mass", "bed", {"beta": 0.4}),
    ("added_mass", "pendulum", {"beta": 0.4}),
    ("added_mass", "carts", {"beta": 0.4}),
    ("head_force", "bed", {"force": 2e-3, "angle": 0.7}),
    ("head_force", "bed", {"force": -2e-3, "axis": "head"}),
    *[("nonlinear_bending", form, {"k_3": 2.0}) for form in FORMS],
    *[("weak_joint", form, {"factor": 10.0, "joint": 1}) for form in FORMS],
    *[("resting_curvature", form, {"phi_0": 0.3}) for form in FORMS],
    ("resting_curvature", "bed-elastic", {"phi_0": -0.3, "joint": 2}),
    *[("joint_friction", form, {"force": 1e-3}) for form in FORMS],
    *[("actuator_lag", form, {"tau": 1e-3}) for form in FORMS],
    *[("actuator_delay", form, {"tau": 1e-3}) for form in FORMS],
    *[("actuator_saturation", form, {"limit": 0.05}) for form in FORMS],
    ("actuator_lag", "driven", {"tau": 0.03}),
    ("actuator_delay", "driven", {"tau": 0.03}),
    ("actuator_saturation", "driven", {"limit": 0.2}),
    ("actuator_deadband", "driven", {"width": 0.2}),
]
MECHANISMS = {case[0] for case in CASES} | {"pin_friction"}


def ends(scene, dt, mode, steps=300):
    run = runner(scene, mode, dt)
    run.advance(steps)
    state = run.state()
    return np.column_stack([state.xy, state.v * dt * steps])


def tolerance(where):
    """Relative to the largest displacement. The engine takes a drive's command in the middle of a step."""
    return 3e-5 if where == "driven" else 1e-9


@pytest.fixture(scope="module")
def without():
    """Each scene after 300 steps without any of the laws."""
    return {name: ends(*build(), "verlet") for name, build in SCENES.items()}


def stepped(scene, scheme):
    return replace(scene, time=replace(scene.time, scheme=scheme))


@pytest.mark.parametrize(("name", "where", "values"), CASES)
class TestMechanism:
    def test_engine_against_reference(self, name, where, values, without):
        scene, dt = SCENES[where]()
        # to rounding where both take the same sums; in the exact scheme each solves for the velocity in its own way
        scene = stepped(scene.with_laws(use(name, **values)), "half_step")
        start = np.array([body.initial for body in scene.bodies])[:, :2]
        engine, reference = ends(scene, dt, "verlet"), ends(scene, dt, "reference")
        moved = np.abs(engine[:, :2] - start).max()
        changed = np.abs(engine - without[where]).max()
        assert changed > 1e-3 * moved
        columns = slice(0, 2 if where == "driven" else 4)
        np.testing.assert_allclose(
            engine[:, columns], reference[:, columns], rtol=0, atol=tolerance(where) * moved
        )

    def test_exact_scheme_against_reference(self, name, where, values):
        scene, dt = SCENES[where]()
        scene = scene.with_laws(use(name, **values))
        start = np.array([body.initial for body in scene.bodies])[:, :2]
        engine, reference = ends(scene, dt, "verlet"), ends(scene, dt, "reference")
        moved = np.abs(engine[:, :2] - start).max()
        np.testing.assert_allclose(
            engine[:, :2], reference[:, :2], rtol=0, atol=max(tolerance(where), 1e-7) * moved
        )

    def test_absent_at_zero_strength(self, name, where, values, without):
        scene, dt = SCENES[where]()
        law = get_law(name, given=values)
        # what comes from a hidden point is not asked by itself, and how a surface is bent beside another law alone
        assert law.candidate == {"source": "", "beat": "", "surface": "beside"}.get(law.role, "named")
        assert law.strength and name in (law.name, law.mechanism)
        numbers = [law.parameter(strength) for strength in law.strength]
        absent = {p.name: p.neutral if p.size == 1 else (p.neutral,) * p.size for p in numbers}
        np.testing.assert_array_equal(
            ends(scene.with_laws(use(name, **{**values, **absent})), dt, "verlet"), without[where]
        )


def test_friction_keeps_the_angular_momentum():
    """A grazing collision: spins as in the reference; orbital and spin angular momentum sum to the same.

    Not to rounding: the arm of the force is the radius, not the radius less half of the overlap.
    """
    bodies = (
        Body("a", "free", 0.01, MASS, initial=(-0.0201, 0.0, 1.0, 0.6)),
        Body("b", "free", 0.015, 0.5, initial=(0.0, 0.015, 0.0, 0.0)),
    )
    laws = (use("contact_linear", stiffness=1e5, damping=50.0), use("contact_friction", mu=0.5))
    scene = Scene(bodies, laws)

    def momentum(state):
        mass, moment = np.array([b.mass for b in bodies]), np.array([b.moment for b in bodies])
        x, y, u, v = state.xy[:, 0], state.xy[:, 1], state.v[:, 0], state.v[:, 1]
        return float(np.sum(mass * (x * v - y * u) + moment * state.spin))

    states = {}
    for mode in ("verlet", "chipmunk", "python", "reference"):
        run = runner(scene, mode, 2e-6)
        before = momentum(run.state())
        run.advance(3000)
        states[mode] = run.state()
        assert abs(states[mode].spin).min() > 1.0
        assert momentum(states[mode]) == pytest.approx(before, rel=1e-3)
    for state in states.values():
        np.testing.assert_allclose(state.spin, states["reference"].spin, rtol=1e-9)
        np.testing.assert_allclose(state.v, states["reference"].v, rtol=0, atol=1e-9)


PLAIN_SCENES = ("bed", "rough bed", "carts")


@pytest.mark.parametrize(("name", "where", "values"), [case for case in CASES if case[1] in PLAIN_SCENES])
def test_python_mode(name, where, values):
    """The same law read as plain Python."""
    scene, dt = SCENES[where]()
    scene = scene.with_laws(use(name, **values))
    compiled, plain = ends(scene, dt, "verlet", 3), ends(scene, dt, "python", 3)
    np.testing.assert_allclose(plain, compiled, rtol=0, atol=1e-14)


class TestActuatorSeries:
    t = np.array([0.0, 0.1, 0.15, 0.4])
    value = np.array([0.5, 1.0, -0.4, 0.3])

    def test_lag_solves_its_equation(self):
        from scipy.integrate import solve_ivp

        tau = 0.04
        t, value = lagging(self.t, self.value, tau)
        assert value[0] == 0.5 and abs(value[-1] - 0.3) < 1e-8
        exact = solve_ivp(
            lambda s, x: (np.interp(s, self.t, self.value) - x) / tau, (0.0, 0.4), [0.5], t_eval=t[t <= 0.4],
            rtol=1e-10, atol=1e-12, max_step=1e-3,
        )  # fmt: skip
        np.testing.assert_allclose(value[t <= 0.4], exact.y[0], atol=1e-7)

    def test_delay(self):
        t, value = delayed(self.t, self.value, 0.03)
        assert np.interp(0.13, t, value) == pytest.approx(1.0)

    def test_saturation_is_exact_between_rows(self):
        t, value = clipped(self.t, self.value, 0.6)
        dense = np.linspace(0.0, 0.4, 4001)
        expected = np.clip(np.interp(dense, self.t, self.value), -0.6, 0.6)
        np.testing.assert_allclose(np.interp(dense, t, value), expected, atol=1e-12)

    def test_dead_band_is_exact_between_rows(self):
        t, value = beyond(self.t, self.value, 0.35)
        dense = np.linspace(0.0, 0.4, 4001)
        asked = np.interp(dense, self.t, self.value)
        expected = np.sign(asked) * np.maximum(np.abs(asked) - 0.35, 0.0)
        np.testing.assert_allclose(np.interp(dense, t, value), expected, atol=1e-12)
        np.testing.assert_allclose(np.interp(self.t, *beyond(self.t, self.value, 0.0)), self.value, atol=1e-15)

    def test_limit_is_a_velocity(self):
        """The limit is that of the driven velocity, gain * input."""
        scene, _ = driven()
        _, value = scene.with_actuator("saturation", 0.2).commands["motor"]
        assert max(value) == pytest.approx(0.4) and scene.commands == scene.inputs
        assert (
            scene.with_actuator("saturation", 0.2, bodies=["load"]).commands["motor"] == scene.inputs["motor"]
        )
        lag = scene.with_actuator("lag", 0.03)
        assert lag.laws[-1].name == "actuator_lag" and lag.commands["motor"] != scene.inputs["motor"]


class TestAutomatic:
    def test_from_the_law_that_is_refined(self):
        scene, _ = bed("elastic")
        values = scene.resolved(use("weak_joint", factor=0.5, joint=3))
        bending = scene.resolved(scene.laws_named("bending")[0])
        assert {
            name: values[name] for name in ("stiffness", "amplitude", "frequency", "phase", "form", "length")
        } == {
            name: bending[name] for name in ("stiffness", "amplitude", "frequency", "phase", "form", "length")
        }
        assert values["length"] == 3e-3
        friction = scene.resolved(use("contact_friction", mu=0.1))
        assert friction["stiffness"] == cases_bed.STIFFNESS and friction["hertz"] == 0.0
        hertz = cases_bed.small_bed(contact=use("contact_hertz", stiffness=1e6, damping=7.0))
        friction = hertz.resolved(use("contact_friction", mu=0.1))
        assert (friction["stiffness"], friction["hertz"], friction["damping"]) == (0.0, 1e6, 7.0)

    def test_one_use_for_each_spring(self):
        scene, _ = carts()
        scene = scene.with_laws(use("nonlinear_spring", k_3=40.0))
        parts = scene.acting[len(scene.laws_named("spring")) :]
        assert [part.bodies for part in parts] == [("a",), ("b",)]
        assert [scene.resolved(part)["anchor"] for part in parts] == [(0.0, 0.0), (0.5, 0.1)]

    def test_length_of_bending(self):
        bending = use("bending", stiffness=1e-3, amplitude=0.1, frequency=1.0)
        bodies = (Body("0", "head", 2e-3, 1e-5), Body("1", "tail", 2e-3, 1e-5))
        assert Scene(bodies, (bending,)).resolved(bending)["length"] == 4e-3
        union = use("union", stiffness=1.0, length=5e-3)
        assert Scene(bodies, (bending, union)).resolved(bending)["length"] == 5e-3

    def test_range_of_a_force_at_a_distance(self):
        force = use("distance_force", s=1.0)
        assert carts()[0].resolved(force)["range"] == 1e3
        scene, _ = bed()
        reach = scene.resolved(force)["range"]
        assert reach + 2 * 1.5e-3 < 0.5 * scene.periodic_x

    def test_walls(self):
        scene, _ = bed()
        values = scene.resolved(use("wall_drag", c=1.0))
        walls = [b for b in scene.bodies if b.role == "wall"]
        below = max(b.initial[1] + b.radius for b in walls if b.initial[1] < 5e-3)
        above = min(b.initial[1] - b.radius for b in walls if b.initial[1] > 5e-3)
        assert (values["bottom"], values["top"]) == (below, above)
        with pytest.raises(InputError, match="role wall"):
            carts()[0].resolved(use("wall_drag", c=1.0))

    def test_nothing_to_take_it_from(self):
        with pytest.raises(InputError, match="no bending to take it from"):
            carts()[0].resolved(use("nonlinear_bending", k_3=1.0))


def test_where_laws_can_act():
    admitted = {
        where: {law.name for law in all_laws().values() if law.name in MECHANISMS and build()[0].admits(law)}
        for where, build in SCENES.items()
    }
    always = {
        "ambient_flow", "quadratic_flow", "added_mass", "point_force", "buried_force", "curved_surface", "lift",
        "periodic_force",
    }  # fmt: skip
    pairs = {"distance_force", "cohesion", "pair_lubrication"}
    actuators = {"actuator_lag", "actuator_delay", "actuator_saturation", "actuator_deadband"}
    assert admitted["carts"] == always | pairs | {"nonlinear_spring", "pair_spring"}
    assert admitted["pendulum"] == always | {"pin_friction", "joint_drag"}
    assert admitted["driven"] == always | pairs | actuators
    assert admitted["bed"] == MECHANISMS - {
        "nonlinear_spring", "pair_spring", "pin_friction", "joint_drag", "actuator_deadband",
    }  # fmt: skip


def test_friction_of_a_pin_by_its_name_in_files(tmp_path):
    scene, _ = pendulum()
    scene = scene.with_laws(use("joint_friction", torque=0.3), use("resting_curvature", phi_0=0.1, joint=4))
    assert scene.laws[-2].name == "pin_friction"
    write_scene(scene, tmp_path / "scene.toml")
    again = read_scene(tmp_path / "scene.toml")
    assert again.hash == scene.hash and again.laws[-1].values["joint"] == 4
    data = scene.to_dict()
    data["law"] = [*data["law"][:-2], {"name": "joint_friction", "body": "bob", "torque": 0.3}]
    assert scene_from_dict(data).laws[-1].name == "pin_friction"


def test_a_role_that_nobody_asks_for_is_refused():
    with pytest.raises(InputError, match="unknown role 'pendullum'; expected one of contact, "):

        @law(kind="body", expression="0", reference="none", role="pendullum")
        def mistaken(x):
            return 0.0, 0.0

    assert "mistaken" not in all_laws()


def test_a_spring_between_bodies_acts_on_those_that_are_held():
    scene, dt = carts()
    with_spring = scene.with_laws(use("pair_spring", k=2.0, f_0=0.7))
    assert [scene.bodies[k].id for k in with_spring.rows(with_spring.laws[-1])] == ["a", "b"]
    moved = np.abs(ends(with_spring, dt, "verlet") - ends(scene, dt, "verlet")).max(axis=1)
    assert moved[2] == 0.0 and (moved[:2] > 1e-4).all()
    one, _ = pendulum()
    law = all_laws()["pair_spring"]
    free = Body("free", "free", 0.01, MASS, initial=(1.0, 0.0, 0.0, 0.0))
    assert not replace(one, bodies=(*one.bodies, free)).admits(law) and scene.admits(law)
