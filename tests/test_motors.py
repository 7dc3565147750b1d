"""Motors that answer their commands in another way than any law with a name says."""

from __future__ import annotations

import itertools
import re

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from granswim_pymunk import Body, Scene, diagnose, make_recording, use
from granswim_pymunk.inference.data import prepare_all
from granswim_pymunk.inference.driven_terms import driven_forms, driven_terms, last
from granswim_pymunk.inference.hypothesis import Hypothesis, adjustable_terms
from granswim_pymunk.inference.tracks.experiment import _commanded, _free_start
from granswim_pymunk.laws.actuator_deadband import beyond
from granswim_pymunk.laws.actuator_lag import lagging
from granswim_pymunk.laws.actuator_saturation import clipped
from granswim_pymunk.laws.flexible_gain import LAST as MIDDLE
from granswim_pymunk.laws.flexible_gain import bent
from granswim_pymunk.laws.flexible_response import AT, answering
from granswim_pymunk.recording.importers.adjustables import adjusted


def command(t):
    return 0.3 * np.sin(2.1 * t) + 0.2 * np.sign(np.sin(1.3 * t))


ROWS = np.arange(0.0, 9.0, 0.02)


def test_a_free_answer_is_the_convolution_with_its_steps():
    span = 1.1
    w = -np.exp(-span * AT / 0.2) * np.cos(12.0 * span * AT)
    times, answer = answering(ROWS, command(ROWS), span, *w)
    s = np.linspace(0.0, span, 200_001)
    steps, middle = np.diff(np.interp(s, span * AT, 1 + w)), 0.5 * (s[1:] + s[:-1])
    for t in (0.0, 0.03, 1.7, 4.4, 6.5):
        past = np.interp(t - middle, ROWS, command(ROWS))
        wanted = (1 + w[0]) * np.interp(t, ROWS, command(ROWS)) + steps @ past
        assert np.interp(t, times, answer) == pytest.approx(wanted, abs=4e-3)


def test_a_free_answer_follows_a_step_by_its_knots():
    span, w = 1.2, np.array([-1.0, -0.9, -0.4, 0.1, 0.3, 0.1, 0.0, 0.05])
    t, value = np.array([0.0, 2.0 - 1e-7, 2.0, 5.0]), np.array([0.0, 0.0, 0.4, 0.4])
    times, answer = answering(t, value, span, *w)
    np.testing.assert_allclose(np.interp(2.0 + span * AT[1:], times, answer), 0.4 * (1 + w[1:]), atol=1e-5)
    assert np.interp(1.99, times, answer) == 0.0


def test_a_free_answer_holds_a_lag():
    tau, span = 0.3, 1.5
    found = answering(ROWS, command(ROWS), span, *-np.exp(-span * AT / tau))
    late = lagging(ROWS, command(ROWS), tau)
    grid = np.linspace(0.0, 6.0, 500)
    # between knots it is a line in place of an exponential
    assert np.abs(np.interp(grid, *found) - np.interp(grid, *late)).max() < 0.05
    assert np.ptp(np.interp(grid, *late) - command(grid)) > 0.4


def test_a_free_gain_holds_a_dead_band():
    top, width = 0.8, 0.2  # at a knot
    knots = np.arange(-MIDDLE, MIDDLE + 1) / MIDDLE
    over = np.sign(knots) * np.maximum(np.abs(knots) - width / top, 0.0) - knots
    found = bent(ROWS, command(ROWS), top, **{f"w{k}": v for k, v in enumerate(over)})
    wanted = beyond(ROWS, command(ROWS), width)
    grid = np.linspace(0.0, 5.9, 500)
    np.testing.assert_allclose(np.interp(grid, *found), np.interp(grid, *wanted), atol=1e-12)


def filmed(ids, answers, noise=2e-4, seed=3, adjustable=()):
    """A film of carts whose velocities are given, at 20 frames a second, each of which is told the same command."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.5, 8.5, 1 / 20)
    rows = tuple(map(float, ROWS)), tuple(map(float, command(ROWS)))
    laws = [law for b in ids for law in (use("rail", bodies=[b], direction=(1.0, 0.0)), use("drive", bodies=[b]))]
    scene = Scene(
        tuple(Body(b, "free", radius=0.02, mass=0.3) for b in ids), tuple(laws), inputs=dict.fromkeys(ids, rows)
    )
    scene = adjusted(scene, adjustable)
    xy = np.stack(
        [np.stack([x(t) + noise * rng.normal(size=len(t)), np.full(len(t), 0.1 * k)], axis=1)
         for k, x in enumerate(answers)], axis=1,
    )  # fmt: skip
    return make_recording(t, xy, names=list(ids), scene=scene, position_noise=noise)


def ringing(frequency=12.0, damping=0.35):
    """Way of a motor of second order, at its first command for long before."""
    def rate(t, y):
        c = np.interp(t, ROWS, command(ROWS))
        return y[1], y[2], frequency**2 * (c - y[1]) - 2 * damping * frequency * y[2]

    found = solve_ivp(rate, (0.0, 9.0), [0.0, command(0.0), 0.0], dense_output=True, max_step=0.01, rtol=1e-8)
    return lambda t: found.sol(t)[0]


@pytest.mark.deep
def test_a_motor_that_rings_is_told_by_its_answer_to_a_step():
    recording = filmed(["cart"], [ringing()])
    found = diagnose([recording]).verdict
    assert found["verdict"] == "unmodelled"
    (entry,) = found["mechanisms"]
    assert entry["name"] == "unknown" and "R the answer to a step" in entry["expression"]
    assert found["explained"]["share"] > 0.9 and found["explained"]["best_free_form"] > 0.9
    (told,) = [note for note in found["notes"] if "answer to a step settles" in note]
    # exp(-pi zeta/sqrt(1 - zeta^2)) = 31 % over it, pi/(omega sqrt(1 - zeta^2)) = 0.28 s after a step
    over, at = map(float, re.search(r"goes ([\d.]+) % over it at ([\d.]+) s", told).groups())
    assert 15 < over < 60 and 0.2 < at < 0.4


def late(tau, gain):
    t, value = lagging(ROWS, gain * command(ROWS), tau)
    way = np.concatenate([[0.0], np.cumsum(0.5 * (value[1:] + value[:-1]) * np.diff(t))])
    return lambda at: np.interp(at, t, way)


@pytest.mark.deep
def test_a_dead_band_a_delay_and_a_lag_of_one_motor_are_told():
    """A lag is a delay to first order, which takes the time of both; the dead band is wider than believed commands."""
    gain, width, delay, tau = 2.4, 0.56, 0.07, 0.16
    t, value = beyond(ROWS, gain * command(ROWS), width)
    t, value = lagging(t + delay, value, tau)
    way = np.concatenate([[0.0], np.cumsum(0.5 * (value[1:] + value[:-1]) * np.diff(t))])
    recording = filmed(["cart"], [lambda at: np.interp(at, t, way)], adjustable=["drive.gain=0.2:5"])
    found = diagnose([recording]).verdict
    numbers = {m["name"]: next(iter(m["parameters"].values())) for m in found["mechanisms"]}
    assert set(numbers) == {"actuator_deadband", "actuator_delay", "actuator_lag"} and found["complete"]
    for name, true in (("actuator_deadband", width), ("actuator_delay", delay), ("actuator_lag", tau)):
        assert numbers[name]["low"] < true < numbers[name]["high"], name
    assert numbers["actuator_lag"]["high"] - numbers["actuator_lag"]["low"] < 0.05


@pytest.mark.deep
@pytest.mark.parametrize("clipped_last", [True, False])
def test_a_lag_and_a_limit_are_told_in_the_order_in_which_they_act(clipped_last):
    faults = [lambda t, v: lagging(t, v, 0.15), lambda t, v: clipped(t, v, 0.3)]
    t, value = ROWS, command(ROWS)
    for fault in faults if clipped_last else faults[::-1]:
        t, value = fault(t, value)
    way = np.concatenate([[0.0], np.cumsum(0.5 * (value[1:] + value[:-1]) * np.diff(t))])
    found = diagnose([filmed(["cart"], [lambda at: np.interp(at, t, way)])]).verdict
    lag, limit = sorted(found["mechanisms"], key=lambda m: m["name"])
    assert (lag["name"], limit["name"]) == ("actuator_lag", "actuator_saturation") and found["complete"]
    assert ("of what the other faults make" in limit["expression"]) == clipped_last
    for number, true in ((lag["parameters"]["tau"], 0.15), (limit["parameters"]["limit"], 0.3)):
        assert number["low"] < true < number["high"] and number["high"] - number["low"] < 0.01


def test_faults_act_in_the_same_order_in_whichever_they_are_found():
    """What has no memory acts on the command itself, but where it is last: then on what all others leave."""
    recording = filmed(["cart"], [late(0.1, 1.0)])
    (case,), terms = prepare_all([recording]), {t.label: t for t in driven_terms(prepare_all([recording]))}
    lag, band, limit = (terms[f"actuator_{name}"] for name in ("lag", "deadband", "saturation"))
    sizes = {"actuator_lag": 0.1, "actuator_deadband": 0.02, "actuator_saturation": 0.3}
    for order in itertools.permutations([lag, band, limit]):
        scene, _ = Hypothesis(order).scene(case, [sizes[t.mechanism] for t in order])
        assert [i.law.name for i in scene.laws[-3:]] == ["actuator_deadband", "actuator_saturation", "actuator_lag"]
    assert last(lag) is None
    for order in itertools.permutations([lag, band, last(limit)]):
        scene, _ = Hypothesis(order).scene(case, [sizes[t.mechanism] for t in order])
        assert [i.law.name for i in scene.laws[-3:]] == ["actuator_deadband", "actuator_lag", "actuator_saturation"]
        assert scene.laws[-3].values["width"] == 0.02


def test_the_faults_of_a_motor_know_how_large_its_gain_may_be():
    given = {t.label: t.free[0] for t in driven_terms(prepare_all([filmed(["cart"], [late(0.1, 1.0)])]))}
    wide = filmed(["cart"], [late(0.1, 1.0)], adjustable=["drive.gain=0.5:3"])
    free = {t.label: t.free[0] for t in driven_terms(prepare_all([wide]))}
    top = float(np.abs(command(ROWS)).max())
    assert given["actuator_deadband"].high == pytest.approx(top)
    assert given["actuator_saturation"].neutral == given["actuator_saturation"].high
    for name in ("actuator_deadband", "actuator_saturation"):
        assert free[name].high == pytest.approx(3 * top) and free[name].span == pytest.approx(top)


def test_two_motors_have_a_lag_and_a_gain_each():
    recording = filmed(["left", "right"], [late(0.12, 1.06), late(0.2, 0.99)], adjustable=["drive.gain=0.5:2"])
    assert [a.per for a in recording.scene.adjustable] == ["body"]
    terms = {t.label: t for t in driven_terms(prepare_all([recording]))}
    assert "actuator_lag" in terms
    scene, term = recording.scene, terms["actuator_lag (each body)"]
    assert [f.name for f in term.free] == ["actuator_lag.tau[left]", "actuator_lag.tau[right]"]
    commands = term.apply(scene, {}, [0.12, 0.2])[0].commands
    for body, tau in (("left", 0.12), ("right", 0.2)):
        wanted = lagging(*scene.inputs[body], tau)
        np.testing.assert_allclose(commands[body], wanted, rtol=1e-12)
    case = prepare_all([recording])[0]
    gains = [t.free[0].name for t in adjustable_terms([case])]
    assert gains == ["drive.gain[left]", "drive.gain[right]"]


def test_forms_of_motors_are_asked_where_something_is_driven_alone():
    recording = filmed(["cart"], [late(0.1, 1.0)])
    assert {t.law for t in driven_forms(prepare_all([recording]))} == {"flexible_response", "flexible_gain"}


def test_the_next_experiment_with_a_motor_is_another_command():
    """Where everything is commanded, nobody chooses how fast it starts."""
    case = prepare_all([filmed(["cart"], [late(0.1, 1.0)])])[0]
    assert not _free_start(case)
    larger, faster = _commanded(case, 2.0, 1.0), _commanded(case, 1.0, 2.0)
    before, begin = case.recording.scene.inputs["cart"], case.t[0]
    np.testing.assert_allclose(larger.recording.scene.inputs["cart"][1], 2 * np.array(before[1]))
    twice = faster.recording.scene.inputs["cart"]
    assert np.all(np.diff(twice[0]) > 0) and twice[0][-1] == pytest.approx(before[0][-1], abs=0.03)
    for passed in (0.4, 1.7, 3.9):
        wanted = np.interp(begin + 2 * passed, *before)
        assert np.interp(begin + passed, *twice) == pytest.approx(wanted, abs=1e-9)
