"""The list of what a swimmer may have had that its scene lacks."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from granswim_pymunk.engine import Simulation
from granswim_pymunk.errors import InputError
from granswim_pymunk.inference.swimmer_terms import equation, reported_parameters, swimmer_terms
from granswim_pymunk.scene import Adjustable, Scene, read_scene

POCKET = Path(__file__).parent.parent / "scenarios" / "pocket_swim.toml"


@pytest.fixture(scope="module")
def alone() -> Scene:
    """The swimmer without its bed."""
    return replace(read_scene(POCKET), bed=None)


def test_each_joint_and_direction_has_its_term(alone):
    terms = swimmer_terms([alone])
    ids = [alone.bodies[k].id for k in alone.swimmer]
    by_name: dict[str, list] = {}
    for term in terms:
        by_name.setdefault(term.mechanism, []).append(term)
    assert [t.choices["joint"] for t in by_name["weak_joint"]] == list(range(6))
    assert [t.bodies for t in by_name["weak_joint"]] == [(ids[j],) for j in range(6)]
    assert [t.choices["joint"] for t in by_name["resting_curvature"]] == ["all", *range(6)]
    assert [t.choices["axis"] for t in by_name["head_force"]] == ["head", "fixed"]
    for name in ("actuator_lag", "actuator_delay", "actuator_saturation", "nonlinear_bending", "joint_friction"):
        assert len(by_name[name]) == 1
    assert len({t.label for t in terms}) == len(terms)


def test_every_term_moves_the_swimmer_and_its_neutral_value_does_not(alone):
    t = [0.02, 0.04]
    rows = list(alone.swimmer)
    plain = Simulation(alone, dt=2e-5).sample(t, rows)
    for term in swimmer_terms([alone]):
        absent, camera = term.apply(alone, {"scale": 1.0}, [f.neutral for f in term.free])
        assert camera == {"scale": 1.0}
        assert np.abs(Simulation(absent, dt=2e-5).sample(t, rows) - plain).max() < 1e-9, term.label
        inward = [-1.0 if f.neutral >= f.high or "factor" in f.name else 1.0 for f in term.free]
        values = [f.neutral + s * f.scale for s, f in zip(inward, term.free, strict=True)]
        present, _ = term.apply(alone, {}, values)
        assert np.abs(Simulation(present, dt=2e-5).sample(t, rows) - plain).max() > 1e-6, term.label


def test_a_force_is_reported_with_size_and_angle(alone):
    (term,) = [t for t in swimmer_terms([alone]) if t.label == "head_force fixed"]
    covariance = np.diag([1e-5, 2e-5]) ** 2
    found = reported_parameters(term, [0.0, -3e-4], covariance)
    value, low, high, unit = found["force"]
    assert (value, unit) == (pytest.approx(3e-4), "N")
    assert (low, high) == (pytest.approx(3e-4 - 1.96 * 2e-5), pytest.approx(3e-4 + 1.96 * 2e-5))
    value, low, high, unit = found["angle"]
    assert value == pytest.approx(-math.pi / 2) and high - low == pytest.approx(2 * 1.96 * 1e-5 / 3e-4)
    assert found["axis"] == ("fixed", None, None, "1")
    assert "force = 0.0003 N" in equation(term, found)
    # and the scene gets the same force
    changed, _ = term.apply(alone, {}, [0.0, -3e-4])
    values = changed.laws_named("head_force")[0].values
    assert values["force"] == pytest.approx(3e-4) and values["angle"] == pytest.approx(-math.pi / 2)


def test_intervals_end_at_the_bounds_of_the_number(alone):
    (term,) = [t for t in swimmer_terms([alone]) if t.mechanism == "actuator_lag"]
    assert reported_parameters(term, [1e-3], np.array([[1e-6]]))["tau"][1:3] == (0.0, pytest.approx(2.96e-3))
    assert reported_parameters(term, [1e-3])["tau"] == (1e-3, None, None, "s")


def test_what_is_adjustable_is_no_candidate_and_a_scene_needs_a_swimmer(alone):
    changed, _ = next(t for t in swimmer_terms([alone]) if t.mechanism == "actuator_lag").apply(alone, {}, [1e-3])
    changed = replace(changed, adjustable=(Adjustable("actuator_lag", "tau", 0.0, 1e-2),))
    assert "actuator_lag" not in {t.mechanism for t in swimmer_terms([changed])}
    straight = replace(alone, laws=tuple(i for i in alone.laws if i.name != "bending"))
    assert not swimmer_terms([straight])
    with pytest.raises(InputError, match="no swimmer"):
        swimmer_terms([replace(alone, bodies=())])
