"""What a constant acceleration is called: gravity, the tilt of a table, or a push (contract 2)."""

from __future__ import annotations

import math

import numpy as np
import pytest

from granswim_pymunk import Body, Scene, diagnose
from granswim_pymunk.inference.pushes import degrees_of_tilt, form_of_push, told_as, with_form

TABLE = Scene((Body("a", "free", 0.02, 0.1), Body("b", "free", 0.02, 0.2)))
WALL = Scene(TABLE.bodies, (), (0.0, -9.81))


@pytest.mark.parametrize(
    ("a", "on_all", "scenes", "form"),
    [
        ((0.005, -0.003), True, [TABLE], "tilt"),
        ((0.3, -9.7), True, [TABLE], "gravity"),
        ((0.005, -0.003), False, [TABLE], "push"),
        ((0.02, 0.4), True, [WALL], "gravity"),
        ((0.4, 0.1), True, [WALL], "push"),
        ((0.0, 0.4), True, [WALL, TABLE], "push"),
    ],
)
def test_the_form_of_a_push_goes_with_the_apparatus(a, on_all, scenes, form):
    assert form_of_push(a, on_all, scenes) == form
    told = with_form("uniform_force", {"a": (list(a), None, None, "m/s^2")}, on_all, scenes)
    assert told["form"] == (form, None, None, "")
    assert ("degrees" in told_as(told)) == (form == "tilt")


def test_other_laws_have_no_form():
    numbers = {"c": (0.1, 0.05, 0.15, "kg/s")}
    assert with_form("linear_drag", numbers, True, [TABLE]) == numbers
    assert told_as(numbers) == ""


@pytest.mark.deep
def test_a_table_that_leans_is_told_in_degrees():
    assert degrees_of_tilt((9.81 * math.sin(math.radians(2.0)), 0.0)) == pytest.approx(2.0)
    t = np.arange(60) / 30
    way = 0.5 * 0.02 * t**2
    xy = np.stack([np.stack([0.2 * t + way, 0 * t], 1), np.stack([0.1 + way, 0.1 * t], 1)], axis=1)
    xy += np.random.default_rng(1).normal(0.0, 3e-4, xy.shape)
    result = diagnose(t, xy, names=["a", "b"], scene=TABLE, position_noise=3e-4)
    (found,) = result.verdict["mechanisms"]
    assert found["name"] == "uniform_force" and found["parameters"]["form"]["value"] == "tilt"
    # asin(0.02/9.81)
    assert "a table that leans by 0.12 degrees" in found["expression"]
    assert "leans by 0.12 degrees" in result.summary()
