"""What explains, what passes for noise, where tracks are cut: the steps of a diagnosis one by one."""

import doctest
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from test_diagnosis import SHORT, collision, filmed

import granswim_pymunk.inference.criteria
from granswim_pymunk.inference.candidates import named_terms
from granswim_pymunk.inference.criteria import DEFAULT, current, using
from granswim_pymunk.inference.data import Case, estimate_noise, grid_of, left_out, prepare
from granswim_pymunk.inference.explained import Explained, Scores, explained, spoken_against
from granswim_pymunk.inference.hypothesis import Free, Hypothesis, Predictor
from granswim_pymunk.inference.judge import accepted, completeness, paired
from granswim_pymunk.inference.noise import (
    LikelyNoise,
    Noise,
    Seen,
    averaged,
    coloured,
    fit_noise,
    left_alone,
    outliers,
    single_ones,
    slopes,
    slow_part,
    timing,
    whitened,
)
from granswim_pymunk.inference.significance import after_looks
from granswim_pymunk.inference.simpler import all_absent, by_chance, ended_at_bound, special_cases
from granswim_pymunk.inference.start import first_numbers
from granswim_pymunk.inference.threads import ContextPool
from granswim_pymunk.inference.tracks.fit import Fitter
from granswim_pymunk.inference.tracks.name import InnerSplit
from granswim_pymunk.inference.tracks.segments import cut_by_growth, find_impacts, make_segments
from granswim_pymunk.inference.tracks.solve import Blocks, Problem, descend
from granswim_pymunk.inference.tracks.steps import time_steps
from granswim_pymunk.inference.tracks.study import standing_out
from granswim_pymunk.recording import Recording
from granswim_pymunk.scene import Body, Scene, use
from granswim_pymunk.validation.hard_disks import Physics, Table, run


def share(value: float, low: float = 0.1, left: float | None = None, sure: bool = True) -> Explained:
    return Explained(value, low, 1.0, 1.0 - value if left is None else left, 1.0, sure)


def test_a_law_is_named_by_what_it_explains_and_not_by_what_is_left():
    assert accepted(share(0.84), [share(0.88)], 0.0)[0]
    assert not accepted(share(0.45), [share(0.2)], 0.0)[0]  # less than half
    assert not accepted(share(0.8, low=-0.1), [share(0.2)], 0.0)[0]  # worse on some parts
    assert not accepted(share(0.6), [share(0.85)], 0.0)[0]  # a nameless force leaves less than half of that
    assert accepted(share(0.92), [share(0.97)], 0.0)[0]  # and less than a tenth where most is explained
    assert not accepted(share(0.92), [share(0.995)], 0.0)[0]
    assert accepted(share(0.92), [share(0.995)], 5.0)[0]  # of which training data, its numbers paid for, ask for less
    assert not accepted(share(0.6), [], 0.0)[0] and accepted(share(0.75), [], 0.0)[0]  # no form to hold against
    assert accepted(share(0.1, sure=False), [], 10.0)[0] and not accepted(share(0.1, sure=False), [], -10.0)[0]


def test_criteria_decide_inside_and_nowhere_else():
    strict = replace(DEFAULT, verdict=replace(DEFAULT.verdict, share=0.8))
    sixty = Explained(0.6, 0.5, 0.7, 0.4, 1.0, True)
    form = Explained(0.2, 0.1, 0.3, 0.8, 1.0, True)
    assert accepted(sixty, [form], 0.0)[0]
    with using(strict):
        assert not accepted(sixty, [form], 0.0)[0] and current() is strict
        with pytest.raises(KeyError), using(DEFAULT):
            raise KeyError
        assert current() is strict
        with using(None):
            assert current() is strict
    assert accepted(sixty, [form], 0.0)[0] and current() is DEFAULT
    assert doctest.testmod(granswim_pymunk.inference.criteria) == (0, 3)


def test_the_share_is_of_the_mismatch_beyond_the_floor():
    units = [(k, "a") for k in range(6)]
    counts = dict.fromkeys(units, 100)
    rng = np.random.default_rng(1)
    floor = rng.chisquare(100, size=(60, 6))

    def scores(per_number: float) -> Scores:
        return Scores(dict.fromkeys(units, 100 * per_number), counts, {}, floor)

    found = explained(scores(3.0), scores(11.0), rng)
    assert found.share == pytest.approx(0.8, abs=0.01) and found.low == pytest.approx(0.8, abs=0.02)
    assert found.sure and not explained(scores(1.0), scores(1.01), rng).sure
    assert explained(scores(0.5), scores(11.0), rng).share == 1.0


def test_slow_noise_passes_within_limits_and_a_drift_does_not():
    rng = np.random.default_rng(2)
    white = [rng.normal(size=400) for _ in range(4)]
    slow = [Noise(0.8, 12.0).draw((400,), rng) for _ in range(4)]
    drift = [r + 1.5 * np.sin(np.arange(400) / 60) for r in white]
    assert completeness(white).passes and completeness(white).noise.size <= 0.2
    assert completeness(slow).passes
    assert fit_noise(slow).size == pytest.approx(0.8, abs=0.25)
    assert not completeness(drift).passes
    assert not completeness([Noise(3.0, 12.0).draw((400,), rng) for _ in range(4)]).passes  # larger than the white part


def test_chance_of_noise_is_even_where_nothing_is_left():
    rng = np.random.default_rng(3)
    chances = np.array([completeness([rng.normal(size=200) for _ in range(2)]).chance for _ in range(200)])
    assert np.mean(chances < 0.05) < 0.1 and np.mean(chances < 0.005) < 0.02


def test_an_outlier_is_one_sighting_and_a_collision_is_none():
    t = np.arange(80) / 100
    path = np.where(t < 0.4, t, 0.8 - t) * 0.5  # a kink at 0.4 s
    seen = path + np.random.default_rng(4).normal(size=80) * 1e-4
    assert not outliers(t, seen, 1e-4).any()
    seen[[20, 60]] += [5e-3, -3e-3]
    assert np.flatnonzero(outliers(t, seen, 1e-4)).tolist() == [20, 60]
    # two that lie in each other's frames hide one another
    seen[64] += 4e-3
    assert np.flatnonzero(outliers(t, seen, 1e-4)).tolist() == [20, 60, 64]


def test_frames_of_a_contact_that_lasts_are_no_outliers():
    """A body that is turned round within two frames lies on neither line while it is; its places are where it was."""
    t = np.arange(80) / 100
    # the velocity changes by 1 m/s from 0.385 to 0.415 s
    path = 0.5 * t - 0.5 * np.clip(t - 0.385, 0.0, 0.03) ** 2 / 0.03 - np.clip(t - 0.415, 0.0, None)
    seen = path + np.random.default_rng(4).normal(size=80) * 1e-4
    pressed = np.zeros(80, dtype=bool)
    assert np.flatnonzero(outliers(t, seen, 1e-4, None, pressed)).tolist() == [40]
    pressed[38:43] = True
    assert not outliers(t, seen, 1e-4, None, pressed).any()
    seen[[40, 60]] += 0.02  # more than any contact could do in so short a time
    assert np.flatnonzero(outliers(t, seen, 1e-4, None, pressed)).tolist() == [40, 60]


def test_the_ends_of_a_bent_path_are_no_outliers():
    """From one side a line sees a bend as an outlier: a swing filmed in 30 frames a period, near where it turns."""
    for phase in np.linspace(0, 2 * np.pi, 24):
        t = np.arange(60) / 30
        seen = 0.05 * np.cos(2 * np.pi * t + phase) + np.random.default_rng(2).normal(size=60) * 3e-5
        assert not outliers(t, seen, 3e-5).any()
    straight = 0.3 * t + np.random.default_rng(2).normal(size=60) * 3e-5
    straight[[0, 59]] += [2e-3, -2e-3]
    assert np.flatnonzero(outliers(t, straight, 3e-5)).tolist() == [0, 59]


def curved_path(seed):
    """With noise of 1e-4: where the next draws come from, times, places and a mask of where nothing is hit: all."""
    rng = np.random.default_rng(seed)
    t = np.arange(60) / 100
    seen = 0.2 * np.sin(rng.uniform(1, 12) * t + rng.uniform(0, 6)) + 1e-4 * rng.normal(size=60)
    return rng, t, seen, np.ones(60, dtype=bool)


def test_an_outlier_among_the_first_frames_is_told_by_those_about_it():
    """No line reaches it from before, and one from after tells little of a bend; but for the outermost frame."""
    found = 0
    for k in range(40):
        rng, t, seen, smooth = curved_path(k)
        assert not outliers(t, seen, 1e-4, smooth).any()
        at = int(rng.choice([1, 2, 3, 56, 57, 58]))
        seen[at] += 1.6e-3
        told = np.flatnonzero(outliers(t, seen, 1e-4, smooth)).tolist()
        found += told == [at]
    assert found > 30


def test_an_outlier_on_a_curved_path_is_told_from_both_sides():
    t = np.arange(90) / 30
    seen = 0.05 * np.cos(2 * np.pi * t / 0.7) + np.random.default_rng(2).normal(size=90) * 1e-4
    smooth = np.ones(90, dtype=bool)
    assert not outliers(t, seen, 1e-4, smooth).any()
    seen[[31, 65]] += [2e-3, -2e-3]
    assert np.flatnonzero(outliers(t, seen, 1e-4, smooth)).tolist() == [31, 65]
    seen = np.where(t < 1.4, 0.5 * t, 1.4 - 0.5 * t) + np.random.default_rng(2).normal(size=90) * 1e-4
    smooth[36:49] = False  # something was hit there
    assert not outliers(t, seen, 1e-4, smooth).any()


def test_two_outliers_that_are_near_one_another_are_told_on_a_curved_path():
    """The curve through the frames about one of them bends to the other, and hides it, until that is left out."""
    found = 0
    for k in range(40):
        rng, t, seen, smooth = curved_path(k)
        at = int(rng.integers(12, 44)) + np.array([0, rng.integers(2, 5)])
        seen[at] += rng.choice([-1, 1], size=2) * 4e-3
        found += np.flatnonzero(outliers(t, seen, 1e-4, smooth)).tolist() == at.tolist()
    assert found > 35, found

def test_two_bad_sightings_in_a_row_are_left_out_and_a_kick_is_not():
    """The same curve goes on behind them; where the velocity has changed meanwhile nothing is a bad sighting."""
    t = np.arange(120) / 60
    path, smooth, found, struck = 0.1 * np.sin(5 * t), np.ones(120, dtype=bool), 0, 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        seen = path + 5e-4 * rng.normal(size=120)
        kick = seen + rng.uniform(0.1, 1.0) * np.maximum(t - rng.uniform(0.9, 1.1), 0.0)
        struck += int(outliers(t, kick, 5e-4, smooth).any())
        seen[59:61] += np.array([-0.008, -0.005]) if seed % 2 else 0.007
        found += np.flatnonzero(outliers(t, seen, 5e-4, smooth)).tolist() == [59, 60]
    assert found > 16 and struck == 0, (found, struck)


def test_a_sighting_stands_out_from_what_a_fit_leaves_where_neither_kink_nor_drift_does():
    rng = np.random.default_rng(4)
    k = np.arange(60.0)
    left = rng.normal(size=(60, 4))
    left[:, 0] += 8 * np.sin(k / 9)  # a force that was left out
    left[:, 2] += 3 * np.maximum(k - 30, 0)  # an impact at another time
    who = ("a", "a", "b", "b")
    assert not left_alone(left, who).any()
    left[20, :2] += [6.5, -6.0]  # neither alone is six standard deviations of a prediction off
    left[33, 2:] += [-30.0, 25.0]
    assert np.argwhere(left_alone(left, who)).tolist() == [[20, 0], [20, 1], [33, 2], [33, 3]]
    none = sum(left_alone(rng.normal(size=(200, 2)), ("a", "a")).any() for _ in range(100))
    assert none == 0


def test_where_a_law_follows_a_smaller_fault_stands_out():
    """Stamps that jitter make noise where a body is fast: about a turning point a fault hides in what is beside it."""
    rng, who = np.random.default_rng(8), ("a", "b", "b")
    left = rng.normal(size=(80, 3))
    left[25, 0] += 6.5  # too little to be seen from the eight frames about it
    assert not left_alone(left, who).any()
    assert np.argwhere(single_ones(left, who)).tolist() == [[25, 0]]
    left[50, 1:] += [5.0, -4.5]  # neither alone
    assert np.argwhere(single_ones(left, who)).tolist() == [[25, 0], [50, 1], [50, 2]]
    left[40:48, 0] += 9.0  # something that lasts is no fault of a sighting
    assert np.argwhere(single_ones(left, who)).tolist() == [[25, 0], [50, 1], [50, 2]]
    left[60:62, 0] += [-12.0, 17.0]  # two in a row: what follows is where it was
    assert np.argwhere(single_ones(left, who)[:, 0]).ravel().tolist() == [25, 60, 61]
    left[62, 0] += 5.0  # but not where it comes back slowly
    assert np.argwhere(single_ones(left, who)[:, 0]).ravel().tolist() == [25]
    none = sum(single_ones(rng.normal(size=(200, 2)), ("a", "a")).any() for _ in range(400))
    assert none <= 3  # of 400 films, each with a chance of 1e-3
    assert not single_ones(5 * rng.normal(size=(200, 2)), ("a", "a")).any()  # noise that is larger than was said


def test_what_a_stamp_moved_is_no_fault_of_a_sighting():
    rng = np.random.default_rng(6)
    case = prepare(filmed(collision(0.9), collision(0.9), SHORT, rng), held_out=False, split=True)
    left = rng.normal(size=case.values.shape)
    late = np.tile([8.0, 0.2, 2.0, 0.0], (len(case.t), 1))
    moved = left.copy()
    moved[20] += 1.5 * late[20]  # this one stamp is off
    assert standing_out(case, moved)[20, :2].all()
    assert not standing_out(replace(case, late=late), moved).any()
    moved[30, 2:] += [40.0, 40.0]
    assert np.argwhere(standing_out(replace(case, late=late), moved)).tolist() == [[30, 2], [30, 3]]


def test_a_law_is_looked_for_with_starts_that_made_room_for_it():
    """Beside the starts of a scene without it a law leads astray, however right its numbers are."""
    truth = collision(0.9).with_laws(use("uniform_force", a=(0.05, 0.0)))
    case = prepare(filmed(truth, collision(0.9), SHORT, np.random.default_rng(3)), held_out=False, split=True)
    fitter = Fitter([case], Predictor(time_steps([case])))
    base = fitter.fit(Hypothesis())
    (term,) = (t for t in named_terms([case]) if t.label == "uniform_force")
    hypothesis, law = Hypothesis((term,)), np.array([0.05, 0.0])
    values, starts = fitter.beside(base, hypothesis, law)
    moved = fitter.vector(case, hypothesis, values, starts[case.name])
    stayed = fitter.vector(case, hypothesis, law, base.starts[case.name])
    assert float(moved @ moved) < base.chi2 < 0.1 * float(stayed @ stayed)


def test_a_size_that_is_off_by_two_is_refuted_by_a_single_short_channel():
    rng = np.random.default_rng(5)
    body = Body("a", "free", 0.01, 0.1)
    scene = Scene((body,), (), gravity=(0.0, 0.0))
    t = np.arange(70) / 50
    xy = np.stack([0.1 * t, np.zeros(70)], axis=1)[:, None] + 1e-4 * rng.normal(size=(70, 1, 2))
    xy[:, :, 1] = 0.0  # one coordinate was measured
    film = Recording("short", scene, t, ("a",), xy, position_noise=2e-4)
    case = prepare(film, held_out=False, split=True)
    assert not case.sigma_known and case.sigma[0] == pytest.approx(1e-4, rel=0.25)
    right = prepare(replace(film, position_noise=1.1e-4), held_out=False, split=True)
    assert right.sigma_known


def test_a_stated_noise_is_held_against_neighbouring_frames():
    from dataclasses import replace

    film = filmed(collision(0.9), collision(0.9), np.arange(0, 1.2, 0.01), np.random.default_rng(5), noise=1e-4)
    right, wrong = (prepare(replace(film, position_noise=s), held_out=False, split=True) for s in (1e-4, 3e-5))
    assert right.sigma_known and right.sigma[0] == 1e-4 and not right.notes
    assert not wrong.sigma_known and wrong.sigma[0] == pytest.approx(1e-4, rel=0.25)
    assert "was stated" in wrong.notes[0]


def test_tracks_are_cut_where_bodies_met_and_joined_there():
    film = filmed(collision(0.75), collision(1.0), SHORT, np.random.default_rng(6))
    case = prepare(film, held_out=False, split=True)
    (impact,) = find_impacts(case)
    # kept with the recording that it was found in, and with no other one
    assert find_impacts(case)[0] is impact
    assert not find_impacts(replace(case, values=np.full_like(case.values, np.nan)))
    assert impact.bodies == ("a", "b") and 0.1 < case.t[impact.row] < 0.2
    first, second = make_segments(case, case.training)
    assert first.until == pytest.approx(case.t[second.frames][0])
    # what met may step, and nothing else could
    assert np.isfinite(second.limit).all() and len(second.tie) == 8
    fitter = Fitter([case], Predictor({case.name: 5e-4}))
    fit = fitter.fit(Hypothesis())
    # with the wrong restitution each flight is followed, and the step in velocity tells of the loss
    used = fit.innovations[case.name]
    assert np.sqrt(np.nanmean(used**2)) < 3
    assert np.abs(fit.steps[case.name]).max() > 4


def _table(start: list[list[float]], radius: float = 0.025) -> tuple[Table, np.ndarray]:
    n = len(start)
    return Table(np.full(n, radius), np.full(n, 0.1), np.zeros(n, dtype=bool)), np.array(start)


def _film_of(table: Table, start: np.ndarray, t: np.ndarray, noise: float, seed: int) -> Case:
    flight = run(table, Physics(restitution=0.95), start, t)
    ids = tuple("abcdef"[: len(start)])
    bodies = tuple(Body(b, "free", r, m) for b, r, m in zip(ids, table.radius, table.mass, strict=True))
    seen = flight.xy + noise * np.random.default_rng(seed).normal(size=flight.xy.shape)
    scene = Scene(bodies, (use("contact_elastic", restitution=0.95),))
    film = Recording("film", scene, t, ids, seen, position_noise=noise)
    return prepare(film, held_out=False, split=False)


def test_a_graze_is_an_impact_and_the_right_scene_leaves_noise():
    """A graze of 0.06 m/s changes velocities by less than six frames show; the fit that misses it is far off later."""
    t = np.arange(120) / 240
    table, start = _table([[-0.1, 0.0497, 0.5, 0.0], [0.0, 0.0, 0.0, 0.0]])
    case = _film_of(table, start, t, 3e-4, 3)
    (impact,) = find_impacts(case)
    assert max(impact.kick.values()) < 0.1
    # how deep it strikes is known to some tenth of a millimetre: a quarter of the kick may be otherwise
    assert impact.speed["a"] > 0.2 * impact.kick["a"]
    fit = Fitter([case], Predictor({case.name: 1 / 4800})).fit(Hypothesis())
    assert fit.chi2 < fit.count + 3 * np.sqrt(2 * fit.count)


def test_a_body_thrown_back_at_once_is_one_meeting_and_a_start_is_told_before_the_next_one():
    """b goes to and fro between a and c within three frames: the cut comes after the last of it."""
    t = np.arange(100) / 240
    table, start = _table([[-0.1, 0.0, 0.5, 0.0], [0.0, 0.002, 0.0, 0.0], [0.1, 0.006, -0.5, 0.0]])
    case = _film_of(table, start, t, 3e-4, 4)
    touches = run(table, Physics(restitution=0.95), start, t).touches
    assert len(touches) >= 3 and np.ptp([touch[0] for touch in touches]) < 4 / 240
    segments = make_segments(case, case.training)
    assert segments[0].until is not None and segments[0].until > max(touch[0] for touch in touches)
    fit = Fitter([case], Predictor({case.name: 1 / 4800})).fit(Hypothesis())
    assert fit.chi2 < fit.count + 3 * np.sqrt(2 * fit.count)


def test_a_track_is_cut_where_small_errors_of_a_start_are_no_longer_small():
    t = np.arange(600) / 240
    table, start = _table([[-0.5, 0.0, 0.1, 0.0], [0.5, 0.0, 0.1, 0.0]])
    case = _film_of(table, start, t, 3e-4, 7)

    def regular(starts, numbers, t):
        x, y, vx, vy = numbers.reshape(-1, 4).T
        s = (t - t[0])[:, None]
        return np.stack([x + vx * s, y + vy * s], axis=2).reshape(len(t), -1)

    def chaotic(starts, numbers, t):
        grown = np.exp(6 * (t - t[0]))[:, None] * (numbers - first_numbers(starts))[[2, 3, 6, 7]]
        return regular(starts, numbers, t) + 0.1 * (np.sin(grown) + 1 - np.cos(grown))

    (whole,) = cut_by_growth(case, case.training, regular)
    assert (whole.frames == case.training).all() and whole.until is None and not len(whole.tie)
    segments = cut_by_growth(case, case.training, chaotic)
    assert len(segments) > 1 and (np.sum([s.frames for s in segments], axis=0) == case.training).all()
    # exp(6 t) 0.02 sigma_v is a quarter after a second or so
    assert 0.7 < segments[0].frames.sum() / 240 < 1.8
    assert segments[0].until == case.t[segments[1].frames][0] and len(segments[1].tie) == 8


def test_spin_goes_on_from_segment_to_segment():
    """b is set spinning by a, and rubs against c with that spin: a start without it would have too small a friction."""
    t = np.arange(200) / 240
    table, start = _table([[-0.1, 0.03, 0.7, 0.0], [0.0, 0.0, 0.0, 0.0], [0.11, -0.07, 0.0, 0.0]])
    flight = run(table, Physics(restitution=0.95, contact_friction=0.25), start, t)
    assert [touch[1:3] for touch in flight.touches] == [(0, 1), (1, 2)] and abs(flight.spin[-1, 2]) > 1.0
    ids = ("a", "b", "c")
    bodies = tuple(Body(b, "free", 0.025, 0.1) for b in ids)
    laws = (use("contact_elastic", restitution=0.95), use("contact_friction", mu=0.25))
    seen = flight.xy + 1e-5 * np.random.default_rng(6).normal(size=flight.xy.shape)
    film = Recording("film", Scene(bodies, laws), t, ids, seen, position_noise=1e-5)
    case = prepare(film, held_out=False, split=False)
    fitter = Fitter([case], Predictor({case.name: 1 / 4800}))
    assert len(fitter.segments[case.name]) == 3
    fit = fitter.fit(Hypothesis())
    assert fit.chi2 < fit.count + 3 * np.sqrt(2 * fit.count)
    # what joins them is far closer than an impact without the spin would leave it
    assert np.abs(fit.steps[case.name]).max() < 0.3


def test_later_data_that_test_a_law_hold_impacts_too():
    t = np.arange(240) / 240
    table, start = _table([[-0.1, 0.01, 0.5, 0.0], [0.0, 0.0, 0.0, 0.0], [0.12, -0.005, 0.0, 0.0]])
    case = _film_of(table, start, t, 3e-4, 5)
    rows = [impact.row for impact in find_impacts(case)]
    assert len(rows) == 2 and max(rows) < 0.6 * 240
    inner = InnerSplit.make([case], Predictor({case.name: 1 / 4800}), lambda: False)
    assert [bool(inner.rest[case.name][row]) for row in rows] == [False, True]


def test_least_squares_finds_shared_and_own_numbers_within_bounds():
    rng = np.random.default_rng(7)
    truth, own = np.array([2.0, -1.0]), [np.array([0.5, 0.1, 0.0]), np.array([-0.3, 0.2, 1.0])]
    a, b = [rng.normal(size=(50, 2)) for _ in own], [rng.normal(size=(50, 3)) for _ in own]
    data = [x @ truth + y @ s for x, y, s in zip(a, b, own, strict=True)]

    def evaluate(values, starts):
        return [d - x @ values - y @ s for d, x, y, s in zip(data, a, b, starts, strict=True)]

    def differentiate(values, starts, residuals, anew):
        return [Blocks(r, x, y) for r, x, y in zip(residuals, a, b, strict=True)]

    def solve(low, high):
        begin = (np.zeros(2), [np.zeros(3), np.zeros(3)])
        loss = lambda vectors: sum(float(v @ v) for v in vectors)  # noqa: E731
        return descend(Problem(evaluate, differentiate, loss), begin, (low, high), stale=False, evaluations=20)

    values, starts, _ = solve(np.full(2, -np.inf), np.full(2, np.inf))
    np.testing.assert_allclose(values, truth, atol=1e-3)
    np.testing.assert_allclose(starts[1], own[1], atol=1e-3)
    values, *_ = solve(np.array([-9.0, -9.0]), np.array([1.5, 9.0]))
    assert values[0] == 1.5


def test_held_out_errors_are_compared_in_pairs():
    rng = np.random.default_rng(8)
    before = [rng.chisquare(5, size=20) for _ in range(8)]
    assert paired(before, [b / 2 for b in before], rng) == "holds"
    assert paired(before, [2 * b for b in before], rng) == "fails"
    mixed = [b * (0.9 if k % 2 else 1.1) for k, b in enumerate(before)]
    assert paired(before, mixed, rng) == "undecided"


def test_p_and_z_of_a_place_count_all_looks():
    rng = np.random.default_rng(9)
    largest = stats.norm.sf(rng.normal(size=(4000, 20)).max(axis=1))
    z = np.array([after_looks(float(p), 20)[0] for p in largest])
    assert abs(z.mean()) < 0.05 and z.std() == pytest.approx(1.0, abs=0.05)  # standard normal where nothing is missing
    assert after_looks(1e-9, 20)[1] == pytest.approx(2e-8)


def test_the_arm_of_a_body_is_that_of_its_pin_or_of_the_hinge_it_hangs_from():
    from granswim_pymunk.joints import arm_of
    from granswim_pymunk.recording import read_recording, resolve_recording

    (folder,) = resolve_recording("double_pendulum")
    scene = read_recording(folder).scene
    upper, lower = scene.ids
    assert arm_of(scene, upper) == pytest.approx(0.1086) and arm_of(scene, lower) == pytest.approx(0.1168)
    (folder,) = resolve_recording("pendulum")
    scene = read_recording(folder).scene
    assert arm_of(scene, scene.ids[0]) == scene.laws_named("pin")[0].values["length"]
    assert arm_of(collision(0.9), "a") == 1.0


def slow_and_white(frames: np.ndarray, noise: Noise) -> np.ndarray:
    return np.eye(len(frames)) + noise.size**2 * np.exp(-np.abs(frames[:, None] - frames) / noise.memory)


def test_squares_of_whitened_residuals_are_those_of_the_full_covariance():
    rng = np.random.default_rng(4)
    noise, frames = Noise(0.7, 12.0), np.concatenate([np.arange(40), np.arange(55, 120)])  # a burst of lost frames
    r = noise.draw((len(frames), 3), rng)
    r[rng.random(r.shape) < 0.1] = np.nan
    white, half = whitened(r, frames, noise)
    squares, logarithm = 0.0, 0.0
    for c in range(3):
        seen = np.isfinite(r[:, c])
        covariance = slow_and_white(frames[seen], noise)
        squares += r[seen, c] @ np.linalg.solve(covariance, r[seen, c])
        logarithm += np.linalg.slogdet(covariance)[1]
    assert np.nansum(white**2) == pytest.approx(squares, rel=1e-10)
    assert 2 * half == pytest.approx(logarithm, rel=1e-10)
    assert np.allclose(coloured(white, frames, noise), r, equal_nan=True, atol=1e-12)


def left_by_a_fit(r: np.ndarray) -> Seen:
    """What a quadratic in time leaves of two channels: a start and a steady force."""
    count = len(r)
    t = np.linspace(-1, 1, count)
    by_start, by_value = np.zeros((count, 2, 4)), np.zeros((count, 2, 2))
    for c in range(2):
        by_start[:, c, 2 * c], by_start[:, c, 2 * c + 1], by_value[:, c, c] = 1.0, t, t**2
    whole = np.concatenate([by_value, by_start], axis=-1).reshape(2 * count, 6)
    rest = r.ravel() - whole @ np.linalg.lstsq(whole, r.ravel(), rcond=None)[0]
    return Seen(rest.reshape(count, 2), np.arange(count), by_value, by_start, np.zeros((0, 6)), np.zeros(0))


def test_a_weak_law_that_unseen_data_speak_against_is_no_explanation():
    """What is too weak for a share is decided by chi2, but not where prediction is worse by more than chance."""
    weak = Explained(-0.5, -3.0, 1.0, 0.45, 0.3, False, 0.2)
    assert spoken_against(weak) is weak and accepted(weak, [], 5.0)[0]
    against = replace(weak, share=-2.7, left=1.1)
    good, why = accepted(spoken_against(against), [], 5.0)
    assert not good and why == "it explains nothing of the mismatch"


def test_replicates_have_the_slow_noise_that_a_short_film_cannot_rule_out():
    """A fit of its start takes most of it away there; what is predicted from such a start shows it."""
    rng = np.random.default_rng(3)
    short, long = (LikelyNoise.of([left_by_a_fit(rng.normal(size=(n, 2)))]) for n in (60, 1000))
    slow = LikelyNoise.of([left_by_a_fit(Noise(1.0, 20.0).draw((1000, 2), rng))])
    assert long.weights[0] > 0.9 > short.weights[0] > 0.1 > slow.weights[0]
    # variance of the mean over 20 frames, in units of white noise
    means = [20 * np.var(n.draw((20, 1, 4000), rng).mean(axis=0)) for n in (long, short, slow)]
    assert means[0] < 1.5 < means[1] < means[2]
    assert LikelyNoise.of([]).noises == (Noise(),)


def test_a_slow_part_is_found_that_a_fit_has_partly_taken_away():
    rng = np.random.default_rng(5)
    found = [slow_part([left_by_a_fit(Noise(1.0, 20.0).draw((300, 2), rng))]) for _ in range(6)]
    assert np.median([n.size for n in found]) >= 0.8 and np.median([n.memory for n in found]) >= 10
    nothing = [slow_part([left_by_a_fit(rng.normal(size=(300, 2)))]) for _ in range(10)]
    assert sum(n.size > 0 for n in nothing) <= 2


@pytest.mark.parametrize(("noise", "wider"), [(Noise(), 1.3), (Noise(0.7, 16.0), 3.0)])
def test_numbers_are_as_unknown_as_the_noise(noise, wider):
    """Of 80 frames nobody can tell whether the noise is slow: intervals hold nought with either, and are no wider."""
    rng = np.random.default_rng(1)
    t = np.linspace(-1, 1, 80)
    line = np.column_stack([t**2, np.ones(80), t])
    inverse = np.linalg.inv(line.T @ line)
    held, plainly, widths = [], [], []
    for _ in range(20):
        r = noise.draw((80, 2), rng)
        found = (inverse @ line.T @ r)[0]
        moved, covariance = averaged([left_by_a_fit(r)])
        half = 1.96 * np.sqrt(np.diag(covariance))
        held += list(np.abs(found + moved) < half)
        plainly += list(np.abs(found) < 1.96 * np.sqrt(inverse[0, 0]))
        widths += list(half / (1.96 * np.sqrt(inverse[0, 0])))
    assert np.mean(held) > 0.85 and np.median(widths) < wider
    assert (np.mean(plainly) < 0.7) == (noise.size > 0)


def test_a_start_that_no_frame_shows_is_known_by_its_ties():
    seen = left_by_a_fit(np.random.default_rng(2).normal(size=(80, 2)))
    hidden = np.concatenate([seen.by_start, np.zeros((80, 2, 1))], axis=-1)
    ties = np.eye(1, 7, 6) * 3e5  # one row, of the last start alone
    moved, covariance = averaged([replace(seen, by_start=hidden, ties=ties, steps=np.zeros(1))])
    without, narrow = averaged([seen])
    assert moved == pytest.approx(without) and covariance == pytest.approx(narrow)


def test_errors_of_the_stamps_are_told_from_white_noise():
    rng = np.random.default_rng(6)
    t = np.arange(0.0, 3.0, 0.02)

    def film(jitter: float) -> np.ndarray:
        moments = t + jitter * rng.normal(size=len(t))
        way = np.column_stack([0.2 * np.sin(4 * moments), 0.3 * moments, 0.1 * np.cos(4 * moments), 0.02 * moments])
        return way + 1e-4 * rng.normal(size=way.shape)

    sigma = np.full(4, 1e-4)
    tau, larger = timing(t, film(1e-3), sigma)
    assert tau == pytest.approx(1e-3, rel=0.3) and larger == pytest.approx(1.0, abs=0.2)
    assert timing(t, film(1e-3), sigma, stated=1e-3)[0] == 1e-3
    assert timing(t, film(0.0), sigma)[0] == 0.0
    kinked = film(0.0)
    kinked[60:] += 3.0 * np.maximum(t[60:] - t[60], 0.0)[:, None]  # a collision is no error of a stamp
    assert timing(t, kinked, sigma)[0] == 0.0


@pytest.mark.parametrize("axes", [slice(0, 1), slice(0, 2)])
def test_late_stamps_do_not_enlarge_the_white_part(axes):
    """A pendulum: where it turns the middle of nine frames stands still, and its neighbours are late all the same."""
    ratios = []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        t = np.arange(0.0, 4.0, 0.025)
        moments = t + 1.2e-3 * rng.normal(size=len(t))
        angle = 0.3 * np.cos(4 * moments)
        way = np.column_stack([np.sin(angle), -np.cos(angle)])[:, axes] + 4e-5 * rng.normal(size=(len(t), 2))[:, axes]
        tau, larger = timing(t, way, np.full(way.shape[1], 4e-5), stated=1.2e-3)
        assert tau == 1.2e-3
        ratios.append(larger)
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.3)


def test_a_start_is_fitted_by_the_noise_as_it_is():
    """Slow noise and late stamps: chi2 is that of the numbers, and intervals are wide enough."""
    rng = np.random.default_rng(7)
    case = prepare(filmed(collision(1.0), collision(1.0), SHORT, rng), held_out=False, split=False)
    quiet = replace(case, late=None, noise=Noise())
    slow = replace(quiet, noise=Noise(1.0, 15.0), late=2.0 * slopes(case.t, case.values))
    rows = np.ones(len(case.t), dtype=bool)
    drawn = slow.draw(rng) / slow.sigma
    assert np.allclose(slow.raw(slow.white(drawn, rows), rows), drawn, equal_nan=True)
    squares = [np.nanmean(slow.white(slow.draw(rng) / slow.sigma, rows) ** 2) for _ in range(50)]
    assert np.mean(squares) == pytest.approx(1.0, abs=0.03)
    assert np.nanmean((slow.draw(rng) / slow.sigma) ** 2) > 1.5
    noisy = replace(slow, values=case.values + slow.draw(rng))
    fit = Fitter([noisy], Predictor({case.name: 1e-3}), {case.name: rows}, whole=True).fit(Hypothesis())
    assert np.allclose(fit.innovations[case.name], noisy.raw(fit.white[case.name], rows), equal_nan=True)
    assert fit.chi2 == pytest.approx(float(np.nansum(fit.white[case.name] ** 2)))


def test_a_form_that_could_not_be_run_is_no_better_explanation():
    rng = np.random.default_rng(8)
    floor = rng.chisquare(100, size=(60, 2))
    before = Scores({(0, "a", 0): 900.0, (0, "b", 0): 900.0}, {(0, "a", 0): 100, (0, "b", 0): 100}, {}, floor)
    failed = explained(Scores({}, {}, {}, np.zeros((60, 0)), ("r: a body escaped",)), before, rng)
    assert not failed.sure and accepted(share(0.9), [failed], 0.0)[0]


def test_criteria_decide_in_the_threads_of_a_diagnosis_too():
    strict = replace(DEFAULT, verdict=replace(DEFAULT.verdict, share=0.8))
    with ContextPool(2) as pool, using(strict):
        assert list(pool.map(lambda k: (k, current().verdict.share), range(3))) == [(0, 0.8), (1, 0.8), (2, 0.8)]


def test_a_number_that_ended_at_its_bound_was_not_found():
    """Not where the law is absent there, nor where the bound is one of nature."""
    scale = Free("camera.scale", "1", 0.7, 1.3, 1.0, 1e-3, None, 1.0)
    lost = Free("contact.restitution", "1", 0.0, 1.0, 0.9, 1e-2, None, 0.9, natural=True)
    drag = Free("linear_drag.c", "kg/s", 0.0, math.inf, 0.0, 1.0)
    assert ended_at_bound([(drag, 0.0), (lost, 1.0), (scale, 1.2999)]) == ("camera.scale", 1.3)
    assert ended_at_bound([(drag, 0.0), (lost, 1.0), (scale, 1.29)]) is None


def test_numbers_that_chance_explains_are_as_good_as_absent():
    """chi2 of one number exceeds 3.84, of two 5.99, once in twenty times."""
    assert [by_chance(rise, n) for rise, n in ((3.8, 1), (3.9, 1), (5.9, 2), (6.1, 2))] == [True, False, True, False]
    assert all_absent([(0.0, -1.0, 1.0), (1.0, 1.0, 2.0)]) and not all_absent([(0.0, -1.0, 1.0), (0.0, 0.1, 1.0)])
    assert special_cases("ambient_flow") == ("linear_drag",) and special_cases("camera_scale") == ()
    assert special_cases("quadratic_flow") == ("quadratic_drag",)  # a form of ambient_flow, and another special case


def test_a_coordinate_that_hardly_moves_has_the_noise_of_its_pixels():
    """On whole pixels most frames of a rail's other coordinate have one value, and the others were no 1e9 sigma off."""
    rng, t, pixel = np.random.default_rng(6), np.arange(300) / 25, 8e-4
    across = np.round(rng.normal(0.0, 2e-4, 300) / pixel) * pixel
    assert 0 < np.mean(across != 0) < 0.2
    assert estimate_noise(t, across) == pytest.approx(pixel / math.sqrt(12))
    assert grid_of(rng.normal(size=300)) == 0.0 and grid_of(np.full(9, 0.1)) == 0.0
    along = 0.2 * np.sin(2 * t) + rng.normal(0.0, 1e-3, 300)
    assert grid_of(np.round(along / pixel) * pixel) == pytest.approx(pixel)
    assert estimate_noise(t, np.round(along / pixel) * pixel) == pytest.approx(1e-3, rel=0.2)


def test_a_grid_is_found_where_its_levels_are_written_to_few_digits():
    """A turn of an encoder of 4096 steps, to a microradian: the least difference is off by 2e-4 of a step, and 2000
    times that far off at the other end."""
    step = 2 * math.pi / 4096
    angle = np.round(np.round(1.6 * np.cos(np.arange(200) / 20) / step) * step, 6)
    assert grid_of(angle) == pytest.approx(step, rel=1e-6)
    assert grid_of(np.round(np.random.default_rng(1).normal(size=300), 6)) <= 1e-6


def test_one_sighting_is_one():
    assert left_out(1, "off by more than noise") == "1 single sighting, off by more than noise, is left out"
    assert left_out(5, "off by more than noise") == "5 single sightings, off by more than noise, are left out"
