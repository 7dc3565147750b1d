"""Laws of a swimmer's joints, written for one joint and lifted to the disks by the engine."""

import math
from dataclasses import replace

import numpy as np
import pytest

from granswim_pymunk.engine import MODES, Simulation
from granswim_pymunk.engine.swimmers import lifted, swimmer_forces
from granswim_pymunk.errors import InputError
from granswim_pymunk.laws import Parameter, get_law, law
from granswim_pymunk.laws.bending import FORMS, of_bending
from granswim_pymunk.scene import Scene, Time, swimmer, use

AXIS = dict(amplitude=0.7, frequency=9.0, phase=1.0)
SQUARE = 3.0  # 1/rad, a constant that a law below looks up


@law(
    kind="chain",
    expression="F_t = -force phi (1 + |phi|)",
    reference="test",
    # a number may have the name of what the engine works out on the way
    parameters=[
        Parameter("force", "N/rad", "bending force"), *of_bending("amplitude", "frequency", "phase", "form", "length")
    ],
    refines=("bending",),
)
def curled_of_the_test(bend, force):
    return -force * bend * (1.0 + SQUARE * abs(bend))


def worm(*laws, form="leader") -> Scene:
    """A bent swimmer whose disks move."""
    rng = np.random.default_rng(2)
    disks = [
        replace(b, initial=tuple(np.array(b.initial) + rng.normal(size=4) * [2e-4, 2e-4, 5e-3, 5e-3]))
        for b in swimmer(disks=5)
    ]
    own = (
        use("union", stiffness=100.0, damping=1e3),
        use("bending", stiffness=2e-3, damping=1e2, form=form, **AXIS),
    )
    return Scene(tuple(disks), (*own, *laws), time=Time(dt=2e-5))


def seen(scene: Scene):
    """Places and velocities (n, 2), and bends (n - 1,) as the form of the bending has them."""
    state = np.array([b.initial for b in scene.bodies])
    xy, v = state[:, :2], state[:, 2:]
    angle = np.arctan2(*np.diff(xy, axis=0).T[::-1])
    head = AXIS["amplitude"] * math.sin(AXIS["phase"])
    form = scene.laws[1].values["form"]
    before = np.full(len(angle), head) if form == "head_axis" else np.concatenate([[head], angle[:-1]])
    return xy, v, np.angle(np.exp(1j * (angle - before)))


@pytest.mark.parametrize("form", FORMS)
def test_forces_of_a_law_of_one_joint(form):
    """Across the segment behind each joint; in the elastic form minus the gradient of the energy."""
    item = use("curled_of_the_test", force=2e-3)
    scene = worm(item, form=form)
    values = scene.resolved(item)
    xy, v, bends = seen(scene)
    mass = np.array([b.mass for b in scene.bodies])
    found = swimmer_forces(item.law, values, 0.0, xy, v, mass).T
    assert np.abs(found.sum(axis=0)).max() < 1e-16  # nothing from outside
    if form == "elastic":

        def energy(places):
            moved = replace(scene, bodies=tuple(
                replace(b, initial=(*p, 0.0, 0.0)) for b, p in zip(scene.bodies, places, strict=True)
            ))  # fmt: skip
            bend = np.abs(seen(moved)[2])
            return 2e-3 * values["length"] * float((bend**2 / 2 + SQUARE * bend**3 / 3).sum())

        for k in range(len(xy)):
            for c in range(2):
                step = np.zeros_like(xy)
                step[k, c] = 1e-9
                slope = (energy(xy + step) - energy(xy - step)) / 2e-9
                assert found[k, c] == pytest.approx(-slope, rel=1e-5, abs=1e-9)
        return
    expected = np.zeros_like(xy)
    for i, bend in enumerate(bends):
        dx, dy = xy[i + 1] - xy[i]
        across = -2e-3 * bend * (1 + SQUARE * abs(bend)) * np.array([-dy, dx]) / math.hypot(dx, dy)
        expected[i + 1] += across
        expected[i] -= across
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-18)


@pytest.mark.parametrize("mode", MODES)
def test_modes_agree(mode):
    scene = worm(use("curled_of_the_test", force=2e-3), use("actuator_lag", tau=1e-3), form="elastic")
    runs = [Simulation(scene, mode=m) for m in ("verlet", mode)]
    for run in runs:
        run.advance(60)
    np.testing.assert_allclose(runs[1].state().xy, runs[0].state().xy, rtol=0, atol=1e-14)
    without = Simulation(worm(use("actuator_lag", tau=1e-3), form="elastic"))
    without.advance(60)
    assert np.abs(without.state().xy - runs[0].state().xy).max() > 1e-7


def test_a_law_without_source():
    """It cannot be written into the text of the loop, and is called."""
    scope: dict = {}
    exec("def made_up_joint_of_the_test(bend, k):\n    return -k * bend\n", scope)
    declared = law(
        kind="chain", expression="F_t = -k phi", reference="test",
        parameters=[Parameter("k", "N/rad", "force"), *of_bending("amplitude", "frequency", "phase", "form", "length")],
        refines=("bending",),
    )(scope["made_up_joint_of_the_test"])  # fmt: skip
    ends = []
    for item in (use(declared, k=1e-3), use("nonlinear_bending", k_3=0.0)):
        scene = worm(item)
        if item.law is not declared:  # the same by a stiffer bending
            scene = scene.with_parameter("bending.stiffness", 3e-3)
        run = Simulation(scene)
        run.advance(50)
        ends.append(run.state().xy)
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=1e-14)


def test_what_is_not_needed_is_not_worked_out():
    import inspect

    text = inspect.getsource(lifted(get_law("resting_curvature")).function)
    assert "atan2" not in text and "math.sin" not in text and "sqrt" in text
    for name in ("union", "contact_linear"):
        assert lifted(get_law(name)) is get_law(name)


def test_arrays_and_joints_do_not_mix():
    with pytest.raises(InputError, match="asks for arrays of a swimmer and for what one joint sees"):

        @law(kind="chain", expression="-", reference="test")
        def mixed_of_the_test(x, bend):
            return -bend * x

    with pytest.raises(InputError, match="gets arrays"):

        @law(kind="chain", expression="-", reference="test")
        def mixed_too_of_the_test(fx, fy, rate):
            fx[0] += rate
