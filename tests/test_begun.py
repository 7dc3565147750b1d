"""Films that begin before the motion does: in a hand that throws, or in a launcher."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

from granswim_pymunk.inference.data import prepare
from granswim_pymunk.inference.entry import diagnose
from granswim_pymunk.inference.hypothesis import Predictor
from granswim_pymunk.inference.tracks import begun
from granswim_pymunk.inference.tracks.begun import without_first_frames
from granswim_pymunk.inference.tracks.study import FittedAlone, Study, calibrated, study_of, tried_alone
from granswim_pymunk.recording import Recording
from granswim_pymunk.scene import Adjustable, Body, Scene, use

RATE, NOISE, MASS, GRAVITY = 60.0, 1e-3, 0.0027, (0.0, -9.81)  # Hz, m, kg, m/s^2
BALL = Body("ball", "free", 0.02, MASS)


def thrown(pushed: int, drag: float = 0.0, seed: int = 3, push=(90.0, 110.0), wind=0.0, slow=0.0) -> Recording:
    """A ball that something pushes for so many frames, with m (push) [N], and that flies from then on.

    drag [kg/m]: of the square of its speed;  wind [N]: what pushes it all along;  slow: noise of as many frames, as
    large as the white part
    """
    t = np.arange(60) / RATE
    until = (pushed - 0.5) / RATE

    def rate(s, y):
        v = y[2:]
        a = np.array(push) * (s < until) - drag / MASS * np.hypot(*v) * v + np.array([wind / MASS, 0.0])
        return [*v, a[0] + GRAVITY[0], a[1] + GRAVITY[1]]

    begin = [0.0, 0.0, 0.3, 0.3] if pushed else [0.0, 0.0, 3.0, 4.0]
    xy = solve_ivp(rate, (0, t[-1]), begin, t_eval=t, max_step=0.2 / RATE, rtol=1e-9, atol=1e-12).y[:2].T
    rng = np.random.default_rng(seed)
    xy = xy + NOISE * rng.normal(size=xy.shape)
    if slow:
        kept = np.exp(-1 / slow)
        xy += lfilter([np.sqrt(1 - kept**2)], [1.0, -kept], NOISE * rng.normal(size=(200, 2)), axis=0)[-len(xy) :]
    return Recording("thrown", Scene((BALL,), (), gravity=GRAVITY), t, ("ball",), xy[:, None, :], sampling=RATE,
                     position_noise=NOISE)  # fmt: skip


def left_out(verdict) -> list[str]:
    return [note for note in verdict["notes"] if "as in a hand or a launcher" in note]


def frames_left_out(verdict) -> int:
    (note,) = left_out(verdict)
    return int(re.search(r"the first (\d+) frames are left out", note).group(1))


@pytest.mark.deep
@pytest.mark.parametrize("pushed", [2, 3])
def test_what_a_hand_does_is_no_law(pushed):
    """It was a stream of air, or a drag that changes with the place, and complete."""
    found = diagnose([thrown(pushed)]).verdict
    assert found["verdict"] == "no_mismatch" and found["mechanisms"] == []
    assert pushed <= frames_left_out(found) <= pushed + 2


@pytest.mark.deep
def test_the_drag_after_a_launcher_is_found():
    """The launcher was told as a drag that is negative where it stands, and held-out data went 5 m astray."""
    found = diagnose([thrown(5, drag=5e-4)]).verdict
    assert 5 <= frames_left_out(found) <= 7
    (entry,) = found["mechanisms"]
    c = entry["parameters"]["c"]
    assert entry["name"] == "quadratic_drag" and c["low"] < 5e-4 < c["high"]


@pytest.mark.deep
@pytest.mark.parametrize(
    "film",
    [{"drag": 5e-4}, {"drag": 5e-4, "wind": 0.004}, {"drag": 3e-5}, {}, {"slow": 8.0}, {"drag": 1e-4, "slow": 8.0}],
)
def test_what_acts_all_along_is_left_in(film):
    """One law, two, a weak one and none: first frames are fitted no better without than the others."""
    assert left_out(diagnose([thrown(0, **film)]).verdict) == []


def pushed_up_a_track(pushed: int, bend: float) -> Recording:
    """A cart that is pushed for so many frames and rolls up a bent slope and back, with friction."""
    t, until = np.arange(120) / 20.0, (pushed - 0.5) / 20.0

    def rate(s, y):
        push = 2.4 if s < until else 0.0
        return [y[1], push - 0.21 * (1 + bend * (y[0] - 0.4)) - 0.03 * np.tanh(y[1] / 1e-3)]

    begin = [0.0, 0.05 if pushed else 0.6]
    x = solve_ivp(rate, (0, t[-1]), begin, t_eval=t, max_step=2e-3, rtol=1e-9, atol=1e-12).y[0]
    x = x + 5e-5 * np.random.default_rng(5).normal(size=x.shape)
    cart = Body("cart", "free", 0.05, 0.5)
    laws = (use("rail", bodies=["cart"], direction=(1.0, 0.0)), use("uniform_force", bodies=["cart"], a=(-0.21, 0.0)))
    xy = np.column_stack([x, np.zeros_like(x)])[:, None, :]
    slope = Adjustable("uniform_force", "a_x", -0.3, -0.1)
    return Recording("track", Scene((cart,), laws, adjustable=(slope,)), t, ("cart",), xy, sampling=20.0,
                     position_noise=5e-5)  # fmt: skip


def looked_at(recording: Recording) -> tuple[Study, FittedAlone]:
    study = study_of([recording], [], np.random.default_rng(0), lambda *said: None, lambda share: False)
    return study, tried_alone(study, *calibrated(study))


@pytest.mark.deep
@pytest.mark.parametrize("bend", [0.3, 0.6])
def test_a_hand_is_seen_though_more_is_missing_all_along(bend):
    """A toy car's first frames were left in, as a bent track leaves more than noise all along."""
    study, tried = looked_at(pushed_up_a_track(5, bend))
    (case,) = without_first_frames(study, tried).cases
    seen = case.training & np.isfinite(case.values).any(axis=1)  # some may be out as single sightings
    assert 4 <= np.flatnonzero(seen)[0] <= 7


@pytest.mark.deep
def test_more_that_is_missing_all_along_is_no_hand():
    study, tried = looked_at(pushed_up_a_track(0, 0.6))
    assert without_first_frames(study, tried) is None


@pytest.mark.deep
def test_a_held_out_throw_is_followed_from_where_the_hand_lets_go():
    """Its start was fitted to frames in the hand, and held-out data turned the right law down."""
    found = diagnose([thrown(4, drag=5e-4)], hold_out=[replace(thrown(5, drag=5e-4, seed=9), name="again")]).verdict
    assert [note.split(":")[0] for note in left_out(found)] == ["thrown", "again"]
    assert [m["name"] for m in found["mechanisms"]] == ["quadratic_drag"] and found["heldout"] == "holds"
    assert found["complete"] and found["fit"]["heldout"]["revised"] < 0.02 * found["fit"]["heldout"]["naive"]


def test_held_out_frames_that_do_not_count_stay_out(monkeypatch):
    """First frames are counted from where bodies are free, and what is not scored, as behind a jump, stays unscored."""
    case = prepare(replace(thrown(0), name="again"), held_out=True, split=False)
    counts = np.arange(len(case.t))
    case = replace(case, start=case.start & (counts >= 3), scored=case.scored & (counts < 50))
    monkeypatch.setattr(begun, "_first_free_held_out", lambda *given: 4)
    (later,), (note,) = begun.held_out_later([case], [], Predictor({}), lambda: False)
    both = later.start | later.scored
    assert np.flatnonzero(both).tolist() == list(range(7, 50)) and not (later.start & later.scored).any()
    assert "the first 4 frames are left out" in note and f"t = {case.t[7]:.4g} s" in note
