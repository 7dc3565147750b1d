"""The proof's own simulator against the reference integrator: two codes, one physics."""

import math
import time

import numpy as np
import pytest

from granswim_pymunk.engine import Simulation
from granswim_pymunk.proof.world import Camera, Effect, World, followed
from granswim_pymunk.recording import see
from granswim_pymunk.scene import Body, Scene, swimmer, use
from granswim_pymunk.validation.reference import Reference

T = np.linspace(0.0, 0.5, 6)


def table(*laws) -> Scene:
    rng = np.random.default_rng(1)
    bodies = [
        Body(str(k), "free", 0.01 * (1 + 0.5 * k), 0.02 * (1 + k), initial=(0.1 * k, 0.15 * k, *rng.normal(size=2) / 4))
        for k in range(3)
    ]
    return Scene(tuple(bodies), tuple(laws))


def meeting(*laws) -> Scene:
    bodies = (
        Body("a", "free", 0.01, 0.02, initial=(0.0, 0.0, 0.25, 0.0)),
        Body("b", "free", 0.015, 0.05, initial=(0.08, 0.01, -0.12, 0.0)),
        Body("c", "free", 0.012, 0.03, initial=(0.06, 0.06, 0.0, -0.2)),
    )
    return Scene(bodies, laws)


def pendulum(*laws) -> Scene:
    body = Body("p", "free", 0.01, 0.1, initial=(0.2 * math.sin(0.8), -0.2 * math.cos(0.8), 0.0, 0.0), inertia=1e-4)
    rod = use("pin", anchor=(0.0, 0.0), length=0.2, bodies=["p"])
    return Scene((body,), (use("gravity"), rod, *laws), gravity=(0.0, -9.81))


def cart(*laws) -> Scene:
    body = Body("c", "free", 0.02, 0.3, initial=(0.08, 0.0, 0.0, 0.0))
    spring = use("spring", anchor=(0.0, 0.0), stiffness=8.0, bodies=["c"])
    return Scene((body,), (use("rail", direction=(1.0, 0.0)), spring, *laws))


def driven(*laws) -> Scene:
    t = np.arange(0.0, 0.8, 0.01)
    body = Body("m", "free", 0.02, 0.3, initial=(0.0, 0.0, 0.0, 0.0))
    own = (use("rail", direction=(0.6, 0.8)), use("drive", bodies=["m"], gain=1.1))
    return Scene((body,), (*own, *laws), inputs={"m": (tuple(t), tuple(0.1 * np.sin(9 * t) + 0.02))})


def swimming(*laws, form="leader") -> Scene:
    disks = swimmer(disks=4, radius=1.5e-3, density=1004.0, head=(0.01, 0.01), head_mass_factor=7.0)
    own = (
        use("union", stiffness=100.0, damping=1e3),
        use("bending", stiffness=2e-3, damping=1e2, amplitude=0.7, frequency=9.0, phase=0.3, form=form),
        use("linear_drag", c=1e-4),
    )
    return Scene(tuple(disks), (*own, *laws))


CONTACT = use("contact_linear", stiffness=400.0, damping=5.0)
SAME = [
    (table, "linear_drag", {"c": 0.004, "p": 1}),
    (table, "quadratic_drag", {"c": 0.02, "p": 2}),
    (table, "coulomb_substrate", {"mu": 0.01}),
    (table, "ambient_flow", {"c": 0.004, "u": (0.1, -0.05)}),
    (table, "uniform_force", {"a": (0.02, -0.01)}),
    (pendulum, "linear_drag", {"c": 0.02}),
    (pendulum, "joint_friction", {"torque": 1e-3}),
    (pendulum, "added_mass", {"beta": 0.2}),
    (cart, "nonlinear_spring", {"k_3": 300.0}),
    (driven, "actuator_lag", {"tau": 0.02}),
    (driven, "actuator_delay", {"tau": 0.02}),
    (driven, "actuator_saturation", {"limit": 0.08}),
]
CONTACTS = [
    ("contact_friction", {"mu": 0.3}),
    ("cohesion", {"force": 0.004, "range": 0.002}),
    ("distance_force", {"s": 0.02, "n": 2.0}),
    ("pair_lubrication", {"c": 2.0, "range": 0.003}),
]
SWIMMER = [
    ("weak_joint", {"factor": 0.5, "joint": 1}),
    ("resting_curvature", {"phi_0": 0.1, "joint": 2}),
    ("nonlinear_bending", {"k_3": 1e-3}),
    ("joint_friction", {"force": 1e-4}),
    ("head_force", {"force": 1e-4, "angle": 0.4}),
    ("actuator_lag", {"tau": 0.004}),
    ("actuator_delay", {"tau": 0.004}),
    ("actuator_saturation", {"limit": 0.5}),
]


def differences(make, name, values, dt, t=T, effect_values=None, **kwargs):
    """Largest difference of the two codes, and how much the law itself moves the bodies [m]."""
    plain = make(**kwargs)
    ours = World(plain, [Effect(name, values)], dt).sample(t).xy
    theirs = Reference(make(use(name, **values), **kwargs), dt=dt).sample(t)
    without = World(plain, [], dt).sample(t).xy
    return np.abs(ours - theirs).max(), np.abs(ours - without).max()


def test_what_a_body_carries_along_is_struck_too():
    """An impulse moves what the forces move."""
    laws, t = (use("contact_elastic", restitution=0.8),), np.arange(0.0, 0.6, 0.05)
    heavier = World(meeting(*laws), [Effect("added_mass", {"beta": 0.3}, ("a",))], 1e-3).sample(t).xy
    plain = World(meeting(*laws), [], 1e-3).sample(t).xy
    theirs = Reference(meeting(*laws, use("added_mass", beta=0.3, bodies=["a"])), dt=1e-3).sample(t)
    assert np.abs(heavier - plain).max() > 1e-3
    assert np.abs(heavier - theirs).max() < 1e-9


@pytest.mark.parametrize(("make", "name", "values"), SAME)
def test_laws_of_single_bodies_agree_with_the_reference(make, name, values):
    wrong, moved = differences(make, name, values, 5e-4)
    assert moved > 1e-4
    assert wrong < 2e-3 * moved


@pytest.mark.parametrize(("name", "values"), CONTACTS)
def test_laws_of_pairs_agree_with_the_reference(name, values):
    # cohesion moves little, and the reference rounds the moment of touching to steps: 4 um with steps of 0.1 ms
    dt = 1e-5 if name == "cohesion" else 1e-4
    wrong, moved = differences(lambda *laws: meeting(CONTACT, *laws), name, values, dt, T[:5])
    assert moved > 4e-5
    assert wrong < 2e-2 * moved


@pytest.mark.parametrize(("name", "values"), SWIMMER)
def test_laws_of_a_swimmer_agree_with_the_reference(name, values):
    # the reference takes dampings at the half step: it differs in first order of dt
    wrong, moved = differences(swimming, name, values, 2e-5, np.linspace(0.0, 0.03, 3))
    assert moved > 2e-6
    assert wrong < max(2e-2 * moved, 5e-7)


@pytest.mark.parametrize("form", ["leader", "elastic", "head_axis"])
def test_forms_of_bending_agree_with_the_reference(form):
    t = np.linspace(0.0, 0.03, 3)
    ours = World(swimming(form=form), [], 2e-5).sample(t).xy
    theirs = Reference(swimming(form=form), dt=2e-5).sample(t)
    moved = np.abs(theirs[-1] - theirs[0]).max()
    assert moved > 1e-4
    assert np.abs(ours - theirs).max() < 2e-3 * moved


def test_collisions_at_their_own_moment_agree_with_the_reference():
    scene = meeting(use("contact_elastic", restitution=0.7))
    wrong = np.abs(World(scene, [], 1e-3).sample(T).xy - Reference(scene, dt=1e-3).sample(T)).max()
    assert wrong < 1e-9
    softer = World(scene, [Effect("restitution", {"restitution": 0.6})], 1e-3).sample(T).xy
    assert np.abs(softer - Reference(meeting(use("contact_elastic", restitution=0.6)), dt=1e-3).sample(T)).max() < 1e-9


def test_the_engine_meets_collisions_at_their_own_moment_too():
    scene = meeting(use("contact_elastic", restitution=0.7))
    exact = World(scene, [], 1e-3).sample(T).xy
    moved = np.abs(exact[-1] - exact[0]).max()
    assert np.abs(Simulation(scene, dt=1e-3).sample(T) - exact).max() < 2e-5 * moved


def bed(columns: int, rows: int, grain: float = 1.5e-3, seed: int = 2) -> Scene:
    """Loose grains on a disturbed grid between two rows of walls, periodic in x."""
    rng = np.random.default_rng(seed)
    step = grain * 1.06
    bodies = []
    for i in range(columns):
        for j in range(rows + 2):
            wall = j in (0, rows + 1)
            shift = np.zeros(2) if wall else rng.normal(size=2) * 0.02 * grain
            xy = ((i + 0.5) * step + shift[0], (j + 0.5) * step + shift[1])
            v = (0.0, 0.0) if wall else tuple(rng.normal(size=2) * 0.1)
            bodies.append(Body(f"b{i}_{j}", "wall" if wall else "grain", grain / 2, 1.8e-6, initial=(*xy, *v)))
    return Scene(tuple(bodies), (use("contact_linear", stiffness=2.2e3, damping=1e3),), periodic_x=columns * step)


def test_a_bed_with_neighbour_lists_agrees_with_the_reference():
    scene = bed(10, 8)
    t = np.linspace(0.0, 1e-3, 3)
    ours = World(scene, [Effect("linear_drag", {"c": 1e-5})], 2e-6).sample(t).xy
    theirs = Reference(
        Scene(scene.bodies, (*scene.laws, use("linear_drag", c=1e-5)), periodic_x=scene.periodic_x), dt=2e-6
    ).sample(t)
    assert np.abs(theirs[-1] - theirs[0]).max() > 1e-4
    assert np.abs(ours - theirs).max() < 5e-3 * np.abs(theirs[-1] - theirs[0]).max()


def test_a_full_bed_is_fast_enough():
    scene = bed(64, 36)
    world = World(scene, [], 2e-6)
    world.sample(np.array([0.0, 2e-5]))
    began = time.process_time()
    world.sample(np.array([0.0, 1000 * 2e-6]))
    assert (time.process_time() - began) / 1000 < 300e-6  # 30 to 60 us on an idle core of today


def test_a_lag_of_second_order_is_as_late_as_one_of_first_order():
    t = np.linspace(0.0, 2.0, 4001)
    command = np.clip(t, 0.2, 1.2)
    first = followed(t, command, [Effect("actuator_lag", {"tau": 0.05})])
    second = followed(t, command, [Effect("actuator_lag", {"tau": 0.05}, other={"order": 2})])
    # both trail a ramp by tau, and differ where it begins
    assert np.interp(1.0, t, first) == pytest.approx(0.95, abs=1e-4)
    assert np.interp(1.0, t, second) == pytest.approx(0.95, abs=1e-4)
    assert np.abs(first - second).max() > 5e-3


def test_the_camera_is_that_of_the_contract():
    xy = np.random.default_rng(4).normal(size=(5, 2, 2))
    camera = Camera(scale=1.02, tilt=0.03, bias=(0.1, -0.2))
    np.testing.assert_allclose(camera.see(xy), see(xy, scale=1.02, tilt=0.03, bias=(0.1, -0.2)), atol=1e-14)
