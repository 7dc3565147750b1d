"""Scenes put together in Python: a box, adding, a picture."""

import doctest

import numpy as np
import pytest

import granswim_pymunk.scene
from granswim_pymunk.engine import Simulation
from granswim_pymunk.errors import InputError
from granswim_pymunk.scene import Adjustable, Body, Scene, use
from granswim_pymunk.walls import gap_to_wall


def ball(name="a", at=(0.1, 0.05), v=(0.0, 0.0)):
    return Body(name, "free", radius=0.01, mass=0.1, initial=(*at, *v))


def test_examples_in_the_docstrings():
    assert doctest.testmod(granswim_pymunk.scene).failed == 0


@pytest.mark.parametrize("thick", [None, 0.0, 0.004])
def test_a_box_is_closed_and_free_inside(thick):
    scene = Scene.box(0.2, 0.1, wall_radius=thick, gravity=(0.0, -9.81), title="box")
    assert not scene.bodies and scene.title == "box" and scene.gravity == (0.0, -9.81)
    # a disk touches the nearest side just where it should, and every corner is closed
    for x, y, gap in ((0.1, 0.03, 0.03), (0.18, 0.05, 0.02), (0.1, 0.09, 0.01), (0.004, 0.05, 0.004)):
        found = min(float(gap_to_wall(np.array([x, y]), 0.0, wall)) for wall in scene.walls)
        assert found == pytest.approx(gap)
    assert all(a.end == b.begin for a, b in zip(scene.walls, scene.walls[1:] + scene.walls[:1], strict=True))


def test_a_ball_in_a_box_bounces_and_stays():
    scene = Scene.box(0.2, 0.1).add(ball(v=(0.6, 0.35)), use("contact_linear", stiffness=2000.0, damping=0.0))
    simulation = Simulation(scene)
    row = scene.ids.index("a")
    assert row == 0
    xy = simulation.sample(np.linspace(0.05, 1.0, 20), rows=[row])[:, 0]
    assert (xy > 0.005).all() and (xy[:, 0] < 0.195).all() and (xy[:, 1] < 0.095).all()
    assert np.ptp(xy[:, 0]) > 0.1


def test_add_gives_a_new_scene():
    empty = Scene.box(0.2, 0.1)
    full = empty.add(
        ball("a"), use("linear_drag", c=1.0), Adjustable("linear_drag", "c", 0.5, 2.0), ball("b", (0.05, 0.05))
    )
    assert len(full.bodies) == len(empty.bodies) + 2 and not empty.laws
    assert full.laws[0].name == "linear_drag" and full.adjustable[0].name == "linear_drag.c"
    with pytest.raises(InputError, match="should be a Body"):
        empty.add("ball")
    with pytest.raises(InputError, match="used twice"):
        full.add(ball("a"))
    for size in ((0.0, 1.0), (1.0, -1.0)):
        with pytest.raises(InputError, match="above zero"):
            Scene.box(*size)


def test_plot(tmp_path):
    scene = Scene.box(0.2, 0.1).add(ball())
    scene.plot(path=tmp_path / "start.png", width=300)
    assert (tmp_path / "start.png").read_bytes()[:4] == b"\x89PNG"
    with pytest.raises(InputError, match="no initial place"):
        scene.add(Body("lost", "free", radius=0.01, mass=0.1)).plot()


def test_gravity_that_is_said_acts():
    """A size without the law of that name, as a script writes it."""
    scene = Scene((ball(),), gravity=(0.0, -9.81))
    assert Simulation(scene).sample([1.0])[0, 0, 1] == pytest.approx(0.05 - 9.81 / 2, rel=1e-6)
    assert scene == Scene((ball(),), (use("gravity"),), gravity=(0.0, -9.81))
    assert not Scene((ball(),)).laws
