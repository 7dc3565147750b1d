"""What recordings of real apparatus have and simulations have not; motions by SciPy's integrator."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import savgol_filter

from granswim_pymunk import api
from granswim_pymunk.inference.candidates import law_terms, named_terms
from granswim_pymunk.inference.data import prepare
from granswim_pymunk.inference.hypothesis import Free, Hypothesis, Predictor, Term, adjustable_terms
from granswim_pymunk.inference.result import Diagnosis
from granswim_pymunk.inference.tracks import model as tracks
from granswim_pymunk.inference.tracks.fit import Fitter
from granswim_pymunk.inference.tracks.kicks import cut_at_kicks, told, unexplained
from granswim_pymunk.inference.tracks.line import strongest_line
from granswim_pymunk.inference.tracks.undeclared import Instead, declared, in_a_lost_scene
from granswim_pymunk.inference.tracks.verdict import as_a_push, as_the_picture
from granswim_pymunk.laws import get_law
from granswim_pymunk.recording import Recording, film
from granswim_pymunk.scene import Adjustable, Body, Scene, use
from granswim_pymunk.walls import Wall

GRAVITY = (0.0, -9.81)


def moved(force, start, t):
    """Places of one coordinate (T,): x'' = force(x, v)."""
    return solve_ivp(lambda _, s: [s[1], force(*s)], (t[0], t[-1]), start, t_eval=t, rtol=1e-9, atol=1e-11).y[0]


def dropped(held: int, noise: float = 1e-3, seed: int = 5) -> tuple[np.ndarray, np.ndarray]:
    """A ball held for some frames, then falling with k v^2, k = 0.12/m: t (T,) and places (T, 1, 2)."""
    t = np.arange(60) / 60
    y = np.full(60, 4.5)
    y[held:] = moved(lambda _, v: -9.81 + 0.12 * v**2, [4.5, 0.0], t[held:] - t[held])
    rng = np.random.default_rng(seed)
    return t, np.stack([0 * t, y], axis=1)[:, None] + rng.normal(0, noise, (60, 1, 2))


def recorded(t, xy, **more):
    return api.make_recording(t, xy, radius=0.02, mass=0.05, **more)


def servo(held: int, seed: int, start: float = 1.56) -> tuple[np.ndarray, np.ndarray]:
    """An arm with dry friction, held for some frames and let go, on an encoder of 4096 steps: t, angle (T,)."""
    rng, step = np.random.default_rng(seed), 2 * np.pi / 4096
    t, fine = np.arange(66) / 50, np.arange(0.0, 1.5, 1e-3)
    friction = 0.1 * start
    q = moved(lambda q, v: -18.0 * np.sin(q) - 18.0 * friction * np.tanh(v / 0.01), [start, 0.0], fine)
    read = np.maximum(t - t[max(held - 1, 0)] + rng.normal(0, 1.5e-3, 66), 0.0)
    read[:held] = 0.0
    return t, np.round(np.round(np.interp(read, fine, q) / step) * step, 6)


# an arm on a servo that lets go after seven frames of 50 a second, in steps of its encoder
SERVO = (
    1018, 1019, 1019, 1019, 1019, 1019, 1019, 1016, 1015, 1011, 1000, 991, 981, 969, 954, 937, 919, 900, 878,
    856, 830, 801, 772, 742, 709, 674, 638, 602, 566, 526, 484, 442, 401, 360, 319, 276, 234, 196, 158, 122,
    87, 56, 29, 3, -22, -47, -67, -81, -92, -102, -106, -108, -107, -106, -107, -107, -107, -107, -107, -106,
    -106, -106, -107, -107, -106, -107,
)


def armed(t, angle) -> Recording:
    laws = (use("gravity"), use("pin", anchor=(0.0, 0.0), length=0.5, bodies=["arm"]))
    scene = Scene((Body("arm", "free", 0.02, 0.1),), laws, gravity=GRAVITY)
    nowhere = np.full((len(t), 1, 2), np.nan)
    return Recording("drop", scene, t, ("arm",), nowhere, angle=angle[:, None], sampling=50.0)


class TestRelease:
    @pytest.mark.parametrize("held", [6, 10, 20])
    def test_frames_in_which_a_ball_is_held_are_left_out(self, held):
        t, xy = dropped(held)
        case = prepare(recorded(t, xy, gravity=GRAVITY), held_out=False, split=True)
        begin = float(case.t[case.training][0])
        assert t[held] - 1e-9 <= begin <= t[held + 3]
        assert any("at rest until" in note for note in case.notes)

    def test_what_starts_from_rest_at_the_first_frame_is_kept(self):
        # at 500 Hz a swing from rest moves less than the noise in many frames
        t = np.arange(1000) / 500
        for rate in (9.81 / 0.25, 9.81 / 5.0):
            angle = moved(lambda q, v, rate=rate: -rate * np.sin(q), [0.4, 0.0], t)
            xy = np.stack([0.25 * np.sin(angle), -0.25 * np.cos(angle)], axis=1)[:, None]
            xy = xy + np.random.default_rng(3).normal(0, 1e-3, xy.shape)
            case = prepare(recorded(t, xy, gravity=GRAVITY), held_out=False, split=True)
            assert case.training[0], rate

    @pytest.mark.parametrize("held", [7, 12])
    def test_frames_in_which_an_arm_on_an_encoder_is_held_are_left_out(self, held):
        """It reads whole steps at moments that jitter: what moves is off by more than what rests, and no filter."""
        for seed in range(3):
            t, angle = servo(held, seed)
            case = prepare(armed(t, angle), held_out=False, split=True)
            assert t[held - 2] <= case.t[case.training][0] <= t[held + 2], seed
            assert len(case.t) == len(t) and not any("smoothed" in note for note in case.notes)

    def test_the_arm_of_a_real_servo_is_held_and_was_not_smoothed(self):
        """Dry friction lets it begin unevenly, and moments at which it was asked jitter."""
        t, steps = np.arange(66) / 50, 2 * np.pi / 4095 * np.array(SERVO)
        case = prepare(armed(t, np.round(steps, 6)), held_out=False, split=True)
        assert t[5] <= case.t[case.training][0] <= t[8] and len(case.t) == len(t)
        assert not any("smoothed" in note for note in case.notes)
        # of what is on a grid neighbours tell of no filter, whoever held it
        loose = prepare(armed(t[7:], np.round(steps[7:], 6)), held_out=False, split=True)
        assert len(loose.t) == len(t) - 7

    def test_an_arm_on_an_encoder_that_starts_from_rest_at_the_first_frame_is_kept(self):
        for seed in range(3):
            for start in (0.05, 0.3, 1.5):
                case = prepare(armed(*servo(1, seed, start)), held_out=False, split=True)
                assert case.training[0], (seed, start)

    def test_of_smoothed_tracks_all_frames_tell_when_a_body_is_let_go(self):
        """One frame in some is used: of those in which it is held fewer than tell of it."""
        t = np.arange(600) / 240
        for seed in range(3):
            noise = np.random.default_rng(seed).normal(0, 1e-4, 600)
            y = 4.5 - 0.5 * 9.81 * np.maximum(t - t[10], 0.0) ** 2 + noise
            xy = np.stack([0 * t, savgol_filter(y, 9, 2)], axis=1)[:, None]
            case = prepare(recorded(t, xy, gravity=GRAVITY), held_out=False, split=True)
            assert case.apart > 2 and any("look smoothed" in note for note in case.notes)
            assert t[7] <= case.t[case.training][0] <= t[10 + 2 * case.apart], seed

    def test_a_puck_that_waits_for_another_is_kept(self):
        t = np.arange(120) / 60
        struck = np.maximum(t - 1.0, 0.0)
        xy = np.stack([np.stack([-0.5 + 0.4 * t - 0.4 * struck, 0 * t], 1), np.stack([0.4 * struck, 0 * t], 1)], 1)
        xy = xy + np.random.default_rng(4).normal(0, 3e-4, xy.shape)
        case = prepare(recorded(t, xy), held_out=False, split=True)
        assert case.training[0]


class TestCaught:
    def thrown(self) -> tuple[np.ndarray, np.ndarray]:
        """A ball in flight that is caught at 0.7 s of 1.6 s: t (T,) and places (T, 1, 2)."""
        t = np.arange(192) / 120
        k = 0.12

        def change(_, s):
            speed = np.hypot(s[2], s[3])
            return [s[2], s[3], -k * speed * s[2], -9.81 - k * speed * s[3]]

        xy = solve_ivp(change, (0, t[-1]), [0, 0, 3.0, 5.0], t_eval=t, rtol=1e-9, atol=1e-11).y[:2].T
        xy[84:] = xy[84]
        return t, (xy + np.random.default_rng(66).normal(0, 1e-3, xy.shape))[:, None]

    def test_frames_in_which_a_ball_was_caught_are_left_out(self):
        t, xy = self.thrown()
        case = prepare(recorded(t, xy, gravity=GRAVITY), held_out=False, split=True)
        used = np.isfinite(case.values).all(axis=1)
        assert t[used][-1] == pytest.approx(0.69, abs=0.015) and used[: used.sum()].all()
        assert t[case.training][-1] == pytest.approx(0.6 * t[used][-1], abs=0.01)
        assert sum("rests from t = 0.7" in note for note in case.notes) == 1

    @pytest.mark.parametrize("sort", ["no gravity", "a floor", "a thread", "a hinge", "friction"])
    def test_what_may_rest_is_kept(self, sort):
        t, xy = self.thrown()
        laws = {
            "a thread": use("spring", anchor=(0.0, 3.0), stiffness=1.0),
            "a hinge": use("hinge", bodies=["ball"], anchor=(0.0, 0.5)),
            "friction": use("coulomb_substrate", mu=0.1),
        }
        scene = Scene(
            bodies=(Body("ball", "free", radius=0.02, mass=0.05),),
            gravity=(0.0, 0.0) if sort == "no gravity" else GRAVITY,
            walls=(Wall((-9.0, -9.0), (9.0, -9.0), id="floor"),) if sort == "a floor" else (),
            laws=(laws[sort],) if sort in laws else (),
        )  # fmt: skip
        case = prepare(api.make_recording(t, xy, scene=scene), held_out=False, split=True)
        assert np.isfinite(case.values[-1]).all() and not any("rests from" in note for note in case.notes)

    @pytest.mark.parametrize("mu", [0.02, 0.3])
    def test_what_friction_stops_on_a_slope_is_kept(self, mu):
        """A block on a slope of which the scene has the gravity along it and not the friction: it stops by itself."""
        t = np.arange(240) / 120
        along = 0.15
        slows = mu * 9.81 + along
        x = np.where(t < 0.6 / slows, 0.6 * t - slows * t**2 / 2, 0.18 / slows)
        xy = np.column_stack([x, np.zeros_like(x)]) + np.random.default_rng(5).normal(0, 2e-4, (len(t), 2))
        case = prepare(recorded(t, xy[:, None], gravity=(-along, 0.0)), held_out=False, split=True)
        assert np.isfinite(case.values[-1]).all() and not any("rests from" in note for note in case.notes)


class TestKicks:
    def test_a_stop_that_the_scene_has_not_is_told(self):
        t = np.arange(240) / 60
        x = np.where(t < 2.0, 0.6 * t, 1.2 - 0.36 * (t - 2.0))
        xy = np.stack([x, 0 * t], 1)[:, None] + np.random.default_rng(1).normal(0, 5e-4, (240, 1, 2))
        case = prepare(recorded(t, xy), held_out=False, split=True)
        (kick,) = unexplained(case)
        assert kick.t == pytest.approx(2.0, abs=0.02)
        assert kick.change[0] == pytest.approx(-0.96, rel=0.1)
        assert re.search(r"t = 2(\.00\d)? s", told(case, [kick])) and "a stop" in told(case, [kick])

    def test_motions_that_are_smooth_have_none(self):
        t = np.arange(600) / 60
        for motion in (
            moved(lambda x, v: -40.0 * x - 800.0 * x**3 - 0.1 * v, [0.2, 0.0], t),  # a spring that hardens
            moved(lambda x, v: -10.0 * x - 0.2 * np.tanh(v / 1e-3), [0.2, 0.0], t),  # dry friction
        ):
            xy = np.stack([motion, 0 * t], 1)[:, None] + np.random.default_rng(2).normal(0, 3e-4, (600, 1, 2))
            assert not unexplained(prepare(recorded(t, xy), held_out=False, split=True))


    def test_stamps_that_are_off_are_no_kicks(self):
        t, late = np.arange(1200) / 60, 1.5e-4
        rng = np.random.default_rng(3)
        at = t + rng.normal(0, late, 1200)
        xy = np.stack([2.0 * at, 3.0 * at], 1)[:, None] + rng.normal(0, 1.5e-4, (1200, 1, 2))
        recording = replace(recorded(t, xy, position_noise=1.5e-4), time_noise=late)
        assert not unexplained(prepare(recording, held_out=False, split=True))

    def test_a_body_near_which_another_one_is_goes_on_in_one(self):
        """Something acts between them: laws are asked for that."""
        t = np.arange(240) / 60
        x = np.where(t < 2.0, 0.6 * t, 1.2 - 0.36 * (t - 2.0))
        touching, row = 1.2 + 0.02 + 0.03, 120
        # of another one that was lost just then the frames about it tell; one that is not seen for long is elsewhere
        for there, lost, cuts in ((touching, slice(0), 0), (touching, slice(row - 1, row + 2), 0), (1.6, slice(0), 1),
                                  (touching, slice(row - 30, None), 1)):  # fmt: skip
            at = np.stack([np.stack([x, 0 * t], 1), np.stack([there + 0 * t, 0 * t], 1)], 1)
            noisy = at + np.random.default_rng(1).normal(0, 5e-4, at.shape)
            noisy[lost, 1] = np.nan
            assert len(cut_at_kicks(prepare(recorded(t, noisy), held_out=False, split=True)).kicks) == cuts

    @pytest.mark.deep
    def test_friction_is_told_on_both_sides_of_a_stop(self):
        """A block slides against a stop at x = 0.8 m that the scene has not, and back at half its speed."""
        t, slow = np.arange(300) / 100, 0.03 * 9.81
        stop = (0.9 - np.sqrt(0.81 - 2 * slow * 0.8)) / slow
        back, since = 0.5 * (0.9 - slow * stop), np.maximum(t - stop, 0.0)
        since = np.minimum(since, back / slow)
        x = np.where(t < stop, 0.9 * t - slow * t**2 / 2, 0.8 - back * since + slow * since**2 / 2)
        xy = np.stack([x, 0 * t], 1)[:, None] + np.random.default_rng(35).normal(0, 5e-4, (300, 1, 2))
        verdict = api.diagnose(t, xy, radius=0.03, mass=0.1, position_noise=5e-4).verdict
        assert [m["name"] for m in verdict["mechanisms"]] == ["coulomb_substrate"]
        mu = verdict["mechanisms"][0]["parameters"]["mu"]
        assert mu["low"] <= 0.03 <= mu["high"] and mu["high"] - mu["low"] < 0.002
        assert not verdict["complete"] and "at once" in verdict["remains"]["looks_like"]
        assert verdict["remains"]["when"]["t"][0] == pytest.approx(stop, abs=0.01)
        assert verdict["heldout"] == "holds"

    @pytest.mark.deep
    def test_a_stop_alone_is_no_match(self):
        t = np.arange(240) / 60
        x = np.where(t < 2.0, 0.6 * t, 1.2 - 0.36 * (t - 2.0))
        xy = np.stack([x, 0 * t], 1)[:, None] + np.random.default_rng(1).normal(0, 5e-4, (240, 1, 2))
        verdict = api.diagnose(t, xy, radius=0.03, mass=0.1, position_noise=5e-4).verdict
        assert verdict["verdict"] == "unmodelled" and not verdict["mechanisms"]
        assert verdict["null"]["p_false_alarm"] < 0.01
        assert "at once" in verdict["remains"]["looks_like"]


@pytest.mark.deep
def test_inertia_is_no_smaller_where_gravity_pulls():
    """A scale that is twice too large makes a throw fall with twice gravity: no body has half its inertia for that."""
    t = np.arange(48) / 60
    xy = 2 * np.stack([1.5 * t, 3.5 * t - 4.905 * t**2], axis=1)[:, None]
    xy = xy + np.random.default_rng(7).normal(0, 2e-3, xy.shape)
    verdict = api.diagnose(t, xy, radius=0.02, mass=0.05, gravity=GRAVITY).verdict
    names = [m["name"] for m in verdict["mechanisms"]]
    assert names == ["uniform_force"], names
    (said,) = (note for note in verdict["notes"] if "lengths times" in note)
    length, rate = map(float, re.findall(r"times ([\d.]+)", said))
    assert length == pytest.approx(0.5, rel=0.02) and rate == pytest.approx(0.5**0.5, rel=0.01)
    assert verdict["mechanisms"][0]["parameters"]["a"]["value"][1] == pytest.approx(-9.81, rel=0.02)


@pytest.mark.deep
def test_a_drop_that_is_held_at_first_has_its_drag():
    t, xy = dropped(10)
    verdict = api.diagnose(t, xy, radius=0.1, mass=0.05, gravity=GRAVITY).verdict
    names = [m["name"] for m in verdict["mechanisms"]]
    same = [r["name"] for r in verdict["rivals"] if r["indistinguishable"]]
    assert "quadratic_drag" in (names + same) and "lens_distortion" not in names, (names, same)


@pytest.mark.deep
def test_a_rod_that_was_taken_for_a_point_keeps_its_bearing_as_a_second_law():
    """Beside inertia that is wrong a bearing shows as a part only of what is left, and far below its spread."""
    t, length = np.arange(600) / 60, 0.6
    inertia, weight = 0.2 * length**2 / 3, 0.2 * 9.81 * length / 2
    angle = moved(lambda q, w: (-weight * np.sin(q) - 6e-4 * w - 3e-4 * np.tanh(w / 0.02)) / inertia, [1.0, 0.0], t)
    angle = angle + np.random.default_rng(7).normal(0, 2e-3, len(t))
    scene = Scene(
        bodies=(Body("bob", "free", radius=0.01, mass=0.2),), gravity=GRAVITY,
        laws=(use("pin", bodies=("bob",), anchor=(0.0, 0.0), length=length),),
    )  # fmt: skip
    xy = np.full((len(t), 1, 2), np.nan)
    verdict = api.diagnose(t, xy, angle=angle[:, None], scene=scene).verdict
    names = {m["name"] for m in verdict["mechanisms"]}
    assert "added_mass" in names and names & {"joint_drag", "joint_friction"}, names
    assert verdict["heldout"] == "holds"
    assert verdict["fit"]["heldout"]["revised"] < 2 * verdict["fit"]["heldout"]["noise_floor"]


@pytest.mark.deep
def test_a_pivot_that_shakes_is_a_force_at_its_frequency():
    """Of small swings x'' = -w^2 (x - d sin rt): the place of the pivot is a force w^2 d along x. It was unmodelled."""
    t, length, rate, size = np.arange(720) / 60, 0.25, 9.0, 4e-3

    def change(time, s):
        push = size * rate**2 * np.sin(rate * time) * np.cos(s[0])
        return [s[1], (-9.81 * np.sin(s[0]) + push) / length - 0.05 * s[1]]

    angle = solve_ivp(change, (0, t[-1]), [0.1, 0.0], t_eval=t, rtol=1e-9, atol=1e-11).y[0]
    xy = np.stack([length * np.sin(angle) + size * np.sin(rate * t), -length * np.cos(angle)], axis=1)[:, None]
    xy = xy + np.random.default_rng(4).normal(0, 4e-4, xy.shape)
    scene = Scene(
        bodies=(Body("bob", "free", radius=0.012, mass=0.05),), gravity=GRAVITY,
        laws=(use("pin", bodies=("bob",), anchor=(0.0, 0.0), length=length), use("linear_drag", c=0.05 * 0.05)),
    )  # fmt: skip
    verdict = api.diagnose(t, xy, scene=scene, position_noise=4e-4).verdict
    assert verdict["verdict"] == "missing_physics"
    # a mismatch is real where nothing is missing less often than that (contract)
    assert verdict["null"]["p_false_alarm"] < 0.01
    (told,) = (m["parameters"] for m in verdict["mechanisms"] if m["name"] == "periodic_force")
    assert told["f"]["value"] == pytest.approx(rate / (2 * np.pi), rel=0.002), told
    along = np.hypot(told["a"]["value"][0], told["b"]["value"][0])
    assert along == pytest.approx(9.81 / length * size, rel=0.1), told


def test_noise_has_no_line_and_a_line_is_found():
    t = np.arange(400) / 60
    for size in (0.0, 0.6):
        white = np.random.default_rng(1).normal(size=(400, 2))
        white[:, 1] += size * np.sin(2 * np.pi * 3.3 * t)
        case = prepare(recorded(t, 1e-3 * white[:, None]), held_out=False, split=False)
        line = strongest_line(SimpleNamespace(white={case.name: white}), [case])
        assert line is not None and (line.paid > 20) == (size > 0)
        if size:
            assert line.frequency == pytest.approx(3.3, rel=0.02)


@pytest.mark.deep
def test_a_number_of_the_scene_that_would_do_is_told():
    """A spring that is a tenth longer at rest moves its mass as a picture a tenth larger does."""
    t, mass, stiffness, length = np.arange(240) / 60, 0.1, 12.0, 0.22

    def change(_, s):
        far = np.hypot(s[0], s[1])
        pull = -stiffness * (far - length) / far / mass
        return [s[2], s[3], pull * s[0], pull * s[1]]

    xy = solve_ivp(change, (0, t[-1]), [0.3, 0.05, 0.1, 0.6], t_eval=t, rtol=1e-9, atol=1e-11).y[:2].T[:, None]
    xy = xy + np.random.default_rng(18).normal(0, 6e-4, xy.shape)
    scene = Scene(
        bodies=(Body("bob", "free", radius=0.015, mass=mass),),
        laws=(use("spring", anchor=(0.0, 0.0), stiffness=stiffness, length=0.2),),
    )  # fmt: skip
    verdict = api.diagnose(t, xy, scene=scene, position_noise=6e-4).verdict
    (said,) = (note for note in verdict["notes"] if "declared adjustable" in note)
    told = re.match(r"spring.length = ([\d.]+) m \(([\d.]+) to ([\d.]+)\), where 0.2 is believed, does as well", said)
    assert told, verdict["notes"]
    value, low, high = map(float, told.groups())
    assert low < length < high and value == pytest.approx(length, rel=0.002)


@pytest.mark.deep
def test_noise_is_slow_though_one_law_alone_leaves_more_than_noise():
    """What two laws leave shows how the noise remembers; white noise of its size would call the numbers too certain."""
    t, mass = np.arange(300) / 50, 0.3
    x = moved(lambda x, v: -(6.0 * x + 40.0 * x**3) / mass - 0.06 * v, [0.25, 0.0], t)
    rng = np.random.default_rng(37)
    slow, memory = rng.normal(size=(300, 2)), np.exp(-1 / 8)
    for k in range(1, 300):
        slow[k] = memory * slow[k - 1] + np.sqrt(1 - memory**2) * slow[k]
    xy = np.stack([x, 0 * t], 1) + rng.normal(0, 6e-4, (300, 2)) + 4e-4 * slow
    scene = Scene(
        bodies=(Body("cart", "free", radius=0.03, mass=mass),),
        laws=(use("spring", anchor=(0.0, 0.0), stiffness=6.0), use("rail", direction=(1.0, 0.0))),
    )  # fmt: skip
    verdict = api.diagnose(t, xy[:, None], scene=scene, position_noise=6e-4).verdict
    named = {m["name"]: m["parameters"] for m in verdict["mechanisms"]}
    assert set(named) == {"nonlinear_spring", "linear_drag"} and verdict["complete"], (named, verdict["notes"])
    assert any("the noise has a slow part" in note for note in verdict["notes"])
    for law, name, true in (("nonlinear_spring", "k_3", 40.0), ("linear_drag", "c", 0.06 * mass)):
        number = named[law][name]
        assert number["low"] < true < number["high"], number


@pytest.mark.deep
def test_pendulums_that_a_spring_couples():
    t, length, apart, mass = np.arange(300) / 50, 0.5, 0.3, 0.1

    def places(a, b):
        return length * np.array([np.sin(a), -np.cos(a)]), length * np.array([np.sin(b), -np.cos(b)]) + [apart, 0.0]

    def change(_, s):
        way = np.subtract(*places(s[1], s[0]))
        far = np.hypot(*way)
        pull = 0.6 * (far - apart) * way / far
        along = [pull @ [np.cos(q), np.sin(q)] / (mass * length) for q in s[:2]]
        rate = 9.81 / length
        return [s[2], s[3], -rate * np.sin(s[0]) + along[0], -rate * np.sin(s[1]) - along[1]]

    a, b = solve_ivp(change, (0, t[-1]), [0.25, 0.0, 0.0, 0.0], t_eval=t, rtol=1e-9, atol=1e-11).y[:2]
    xy = np.stack([length * np.sin(a), -length * np.cos(a), apart + length * np.sin(b), -length * np.cos(b)], 1)
    xy = xy.reshape(-1, 2, 2) + np.random.default_rng(3).normal(0, 5e-4, (300, 2, 2))
    pins = (use("pin", bodies=(n,), anchor=(x, 0.0), length=length) for n, x in (("a", 0.0), ("b", apart)))
    scene = Scene(bodies=tuple(Body(n, "free", radius=0.015, mass=mass) for n in "ab"), gravity=GRAVITY, laws=(*pins,))
    verdict = api.diagnose(t, xy, scene=scene, position_noise=5e-4).verdict
    (entry,) = verdict["mechanisms"]
    assert entry["name"] == "pair_spring" and verdict["complete"], verdict["notes"]
    for name, true in (("k", 0.6), ("f_0", 0.6 * apart)):
        number = entry["parameters"][name]
        assert number["low"] < true < number["high"] and number["value"] == pytest.approx(true, rel=0.02)


class TestLabels:
    """A tracker that takes one body for another."""

    def table(self) -> tuple[np.ndarray, np.ndarray]:
        """Two equal disks that strike each other at 1 s, and a third: t (T,) and places (T, 3, 2)."""
        t = np.arange(180) / 60
        struck = np.maximum(t - 1.0, 0.0)
        xy = [(-0.44 + 0.4 * t - 0.4 * struck, 0 * t), (0.4 * struck, 0 * t), (0.3 - 0.1 * t, 0.3 - 0.15 * t)]
        return t, np.moveaxis(np.array(xy), -1, 0)

    def test_labels_are_put_back(self):
        t, xy = self.table()
        xy = xy + np.random.default_rng(6).normal(0, 3e-4, xy.shape)
        whole = prepare(recorded(t, xy, names=list("abc")), held_out=False, split=True)
        assert not any("change places" in note for note in whole.notes)  # disks that strike keep theirs
        broken = xy.copy()
        broken[100:, [0, 2]] = xy[100:, [2, 0]]
        case = prepare(recorded(t, broken, names=list("abc")), held_out=False, split=True)
        assert np.array_equal(case.values, whole.values, equal_nan=True)
        assert np.array_equal(case.recording.xy, xy)
        (note,) = (note for note in case.notes if "change places" in note)
        assert "tracks of a and c" in note and "t = 1.667 s" in note and "80 frames" in note


@pytest.mark.deep
def test_a_frame_rate_that_would_do_is_told():
    """The stamps of a pendulum run 3 % slow: so does a bob that is lighter than gravity pulls it."""
    t, length, mass = np.arange(240) / 60, 0.4, 0.1
    angle = moved(lambda q, v: -9.81 / length * np.sin(q) - 0.08 * v, [0.5, 0.0], 1.03 * t)
    xy = length * np.stack([np.sin(angle), -np.cos(angle)], axis=1)[:, None]
    xy = xy + np.random.default_rng(4).normal(0, 6e-4, xy.shape)
    scene = Scene(
        bodies=(Body("bob", "free", radius=0.015, mass=mass),), gravity=GRAVITY,
        laws=(use("pin", bodies=["bob"], anchor=(0.0, 0.0), length=length), use("linear_drag", c=0.08 * mass)),
    )  # fmt: skip
    verdict = api.diagnose(t, xy, scene=scene, position_noise=6e-4).verdict
    (said,) = (note for note in verdict["notes"] if note.startswith("frame rate"))
    told = re.match(r"frame rate = ([\d.]+) 1/s \(([\d.]+) to ([\d.]+)\), where 60 is believed, does as well", said)
    assert told, verdict["notes"]
    value, low, high = map(float, told.groups())
    assert low < 60 / 1.03 < high and value == pytest.approx(60 / 1.03, rel=1e-3)


@pytest.mark.parametrize(
    ("a", "held", "said"),
    [
        ((0.0, 19.62), False, "counted the other way"),
        ((0.0, 9.81 * (1 - 1 / 64)), False, "takes gravity away"),
        ((0.0, 9.81 * (1 - 1 / 4)), False, "lengths times 4, or a frame rate times 2 would"),
        ((0.0, 9.81 * 0.75), False, "so would a medium that bears 75 % of the weight"),
        ((0.0, -9.81), False, "a frame rate times 0.707 would make that right as well"),
        ((0.0, 9.81 * (1 - 1 / 16)), True, "a pendulum 6.4 m long in place of 0.4 m, or a frame rate times 4"),
        ((0.0497, -0.0494), True, "gravity is 1.005 times that of the scene, turned by 0.29 degrees"),
        ((9.81, 9.0), False, ""),
    ],
)
def test_a_push_along_gravity_is_told_as_what_the_picture_may_be(a, held, said):
    laws = (use("pin", bodies=["ball"], anchor=(0.0, 0.0), length=0.4),) if held else ()
    scene = Scene(bodies=(Body("ball", "free", radius=0.02, mass=0.1),), gravity=GRAVITY, laws=laws)
    entry = {"name": "uniform_force", "parameters": {"a": {"value": list(a)}}}
    notes = as_the_picture([entry], [SimpleNamespace(recording=SimpleNamespace(scene=scene))])
    assert [said in note for note in notes] == [True] * bool(said)


@pytest.mark.parametrize("mass, flat, says", [(0.05, True, "14 degrees"), (0.05, False, "(2.4, 0)"), (0.08, True, "")])
def test_a_stream_over_bodies_of_one_mass_is_told_as_a_drag_and_a_push_as_well(mass, flat, says):
    """A magnet that slides down a pipe: the stream that it is like would blow with its last speed."""
    bodies = Body("a", "free", 0.02, 0.05), Body("b", "free", 0.02, mass)
    scene = Scene(bodies, (), (0.0, 0.0) if flat else (0.0, -9.81))
    entry = {"name": "ambient_flow", "parameters": {"c": {"value": 0.3}, "u": {"value": [0.4, 0.0]}}}
    cases = [SimpleNamespace(recording=SimpleNamespace(scene=scene))]
    assert not as_a_push([entry], cases, {"quadratic_flow"})  # whose drag is no line
    notes = as_a_push([entry], cases, {"ambient_flow"})
    assert (says in notes[0] and ("leans" in notes[0]) == flat) if says else not notes


@pytest.mark.parametrize(("up", "says"), [(0.0327, True), (-0.0327, False), (0.9, False)])
def test_a_stream_up_along_gravity_is_told_as_the_inertia_of_what_sinks(up, says):
    """g - c u/m = g/(1 + beta): of (5.232, 5.232 - 4.25) m/s^2 a fifth of the weight, an inertia of 1.23 masses."""
    scene = Scene((Body("ball", "free", 0.006, 0.0024),), (), (0.0, -5.232))
    entry = {"name": "ambient_flow", "parameters": {"c": {"value": 0.072}, "u": {"value": [0.0, up]}}}
    (note,) = as_a_push([entry], [SimpleNamespace(recording=SimpleNamespace(scene=scene))], {"ambient_flow"})
    assert ("an inertia of 1.23 masses with c = 0.0886 kg/s" in note) == says


@pytest.mark.deep
def test_a_dead_band_of_a_motor_is_named():
    t = np.arange(300) / 50
    command = 0.35 * np.sin(2.5 * t) * (1 + 0.3 * np.sin(0.9 * t))
    followed = np.sign(command) * np.maximum(np.abs(command) - 0.06, 0.0)
    x = np.concatenate([[0.0], np.cumsum((followed[1:] + followed[:-1]) / 2) / 50])
    xy = np.stack([x, 0 * x], axis=1)[:, None] + np.random.default_rng(6).normal(0, 5e-4, (300, 1, 2))
    scene = Scene(
        bodies=(Body("cart", "free", radius=0.05, mass=0.5),), inputs={"cart": (tuple(t), tuple(command))},
        laws=(use("rail", bodies=("cart",), direction=(1.0, 0.0)), use("drive", bodies=("cart",))),
    )  # fmt: skip
    verdict = api.diagnose(t, xy, scene=scene, position_noise=5e-4).verdict
    (found,) = verdict["mechanisms"]
    assert found["name"] == "actuator_deadband" and verdict["complete"]
    width = found["parameters"]["width"]
    assert width["low"] < 0.06 < width["high"] and width["high"] - width["low"] < 0.01


def test_a_ball_of_another_size_in_another_recording_is_another_body():
    def ball(radius):
        t, xy = dropped(0)
        return prepare(api.make_recording(t, xy, radius=radius, mass=0.05), held_out=False, split=True)

    law = get_law("quadratic_drag")
    assert [t.choices for t in law_terms(law, [ball(0.02), ball(0.02)], each=False)] == [{"p": 0}]
    terms = law_terms(law, [ball(0.02), ball(0.03)], each=False)
    assert [t.choices["p"] for t in terms] == [0, 1, 2]
    scene, _ = terms[2].apply(ball(0.03).recording.scene, {}, [0.4])
    assert scene.parameter("quadratic_drag.c") == pytest.approx(0.4 * (0.03 / 0.025) ** 2)


@pytest.mark.parametrize("adjustable", [True, False])
def test_a_scene_that_is_lost_is_brought_back_by_a_number_far_from_what_is_believed(adjustable):
    """A period read off as half of what it is: a spring four times too stiff, outside the bounds that it was given."""
    rail = use("rail", bodies=["cart"], direction=(1.0, 0.0))
    spring = use("spring", bodies=["cart"], anchor=(0.0, 0.0), stiffness=4.8, length=0.0)
    cart = Body("cart", "free", 0.05, 0.235, initial=(0.09, 0.0, 0.0, 0.0))
    seen = film(
        Scene((cart,), (rail, spring, use("linear_drag", c=0.05))), np.arange(0.0, 4.6, 0.05),
        rng=np.random.default_rng(0), noise=1e-4,
    )  # fmt: skip
    believed = Scene(
        (replace(cart, initial=None),), (rail, use("spring", **{**spring.values, "stiffness": 18.0}, bodies=["cart"])),
        adjustable=(Adjustable("spring", "stiffness", 14.0, 23.0),) if adjustable else (),
    )  # fmt: skip
    case = prepare(replace(seen, scene=believed, position_noise=1e-4), held_out=False, split=True)
    fitter = Fitter([case], Predictor({case.name: 2e-3}))
    plain = fitter.fit_widely(Hypothesis(adjustable_terms([case])), None)
    number = in_a_lost_scene((), plain, plain, fitter)[0]
    assert number.name == "spring.stiffness" and number.value == pytest.approx(4.8, rel=0.02)
    assert number.lost and number.left < 0.01 and number.bounds == ((14.0, 23.0) if adjustable else None)
    assert ("outside its 14 to 23" in str(number)) is adjustable
    (freed,) = declared([case.recording], number)
    (only,) = freed.scene.adjustable
    assert only.low < 4.8 < only.high
    again = Fitter([replace(case, recording=freed)], fitter.predictor)
    found = again.fit(Hypothesis(adjustable_terms(again.cases)), [number.value])
    assert in_a_lost_scene((), found, found, again) == []


@pytest.mark.parametrize("how", ["", "lost", "likelier"])
@pytest.mark.parametrize("complete", [True, False])
def test_a_number_is_set_free_where_nothing_is_complete_without(complete, how, monkeypatch):
    """What is told then is what was found with it; nothing, where that is not complete either, but of a lost scene."""
    t, xy = dropped(0)
    scene = Scene(
        bodies=(Body("bob", "free", radius=0.02, mass=0.05),), gravity=GRAVITY,
        laws=(use("pin", bodies=["bob"], anchor=(0.0, 5.0), length=0.5),),
    )  # fmt: skip
    recording = api.make_recording(t, xy, scene=scene)
    free = Free("pin.length", "m", 0.25, 1.0, 0.5, 1e-3)
    term = Term("adjustable", "", (free,), lambda *given: given[:2])
    number = Instead("pin.length", "m", 0.5, 0.49, 0.48, 0.495, ("added_mass",), 0.1, term, True)
    number = replace(number, **{how: True}) if how else number
    asked = []

    class Asked:
        def __init__(self, training, held, **how):
            asked.append([a.name for a in training[0].scene.adjustable])
            self.undeclared = [] if len(asked) > 1 else [number]
            self.study = SimpleNamespace(late=lambda share: False, cases=[SimpleNamespace(recording=training[0])])

    def found(model, seed):
        # what is likelier is asked though all is explained, and then nothing is named beside it
        passes = complete and (len(asked) > 1 or how == "likelier")
        told = "recalibrate" if how == "likelier" and len(asked) > 1 else "missing_physics"
        verdict = {"verdict": told, "complete": passes, "notes": [f"run {len(asked)}"]}
        return Diagnosis(kind="bodies", verdict=verdict, revised=(), runs=len(asked))

    monkeypatch.setattr(tracks, "Tracks", Asked)
    monkeypatch.setattr(tracks, "diagnose_by", found)
    diagnosis = tracks.diagnose_tracks([recording])
    assert asked == [[], ["pin.length"]]
    if complete or how == "lost":
        assert diagnosis.runs == 3 and diagnosis.verdict["notes"][1] == "run 2"
        said = "pin.length = 0.49 m" if how else "pin.length, which nobody declared adjustable, is fitted"
        assert diagnosis.verdict["notes"][0].startswith(said)
    else:
        assert diagnosis.runs == 1 and diagnosis.verdict["notes"] == ["run 1"]


@pytest.mark.deep
def test_slow_noise_is_not_taken_for_a_force_in_time():
    """A form with many numbers follows the slow part of the noise, and would leave none to be told: a name tells it."""
    rng, noise, memory = np.random.default_rng(3), 3e-4, 8.0
    body = Body("puck", "free", 0.03, 0.05, initial=(0.25, 0.0, -0.02, 0.09))
    t = np.arange(0.0, 3.0, 1 / 120)
    seen = film(Scene((body,), (use("uniform_force", a=(-4e-4, -1.8e-3)),)), t, rng=rng, noise=noise)
    fresh = rng.standard_normal(seen.xy.shape)
    slow, share = fresh.copy(), np.exp(-1 / memory)
    for k in range(1, len(t)):
        slow[k] = share * slow[k - 1] + np.sqrt(1 - share**2) * fresh[k]
    scene = Scene((replace(body, initial=None),), ())
    verdict = api.diagnose(replace(seen, xy=seen.xy + 0.5 * noise * slow, scene=scene), seed=1).verdict
    (entry,) = verdict["mechanisms"]
    assert (entry["name"], verdict["complete"]) == ("uniform_force", True)
    assert any("the noise has a slow part" in note for note in verdict["notes"])


@pytest.mark.deep
def test_a_bent_picture_is_no_explanation_where_a_plainer_force_does_as_well():
    """Of a spinning ball a lens and a stream with six numbers were named, and left 64 times the noise of later data."""
    t, mass, turn = np.arange(0.0, 0.9, 1 / 240), 0.0027, 0.6
    path = solve_ivp(
        lambda _, s: [s[2], s[3], -turn * s[3], -9.81 + turn * s[2]], (0.0, t[-1]), [0.0, 1.0, 2.0, 1.5], t_eval=t,
        rtol=1e-9, atol=1e-11,
    ).y  # fmt: skip
    rng, noise = np.random.default_rng(2), 5e-4
    xy = path[:2].T[:, None] + noise * rng.standard_normal((len(t), 1, 2))
    verdict = api.diagnose(t, xy, radius=0.02, mass=mass, gravity=GRAVITY, position_noise=noise, seed=1).verdict
    (entry,) = verdict["mechanisms"]
    assert (verdict["verdict"], entry["name"]) == ("unmodelled", "unknown")
    s = entry["parameters"]["s"]
    assert s["low"] < turn * mass < s["high"]
    assert verdict["fit"]["heldout"]["revised"] < 1.5 * noise


@pytest.mark.parametrize("kinds", ["y", "xy"])
def test_of_one_coordinate_no_turned_picture_is_asked(kinds):
    t, rng = np.arange(40) / 60, np.random.default_rng(1)
    xy = np.stack([0.0 * t + (0.3 * t if "x" in kinds else 0.0), -4.9 * t**2], axis=1)[:, None]
    xy[..., ["xy".index(k) for k in kinds]] += 1e-3 * rng.normal(size=(40, 1, len(kinds)))
    scene = Scene((Body("ball", "free", 0.02, 0.1),), (use("gravity"),), gravity=GRAVITY)
    case = prepare(Recording("fall", scene, t, ("ball",), xy, sampling=60.0), held_out=False, split=False)
    assert any(term.mechanism == "camera_tilt" for term in named_terms([case])) == (kinds == "xy")
