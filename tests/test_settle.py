"""Names of the apparatus for one law, two or three, scales of numbers, and entries that earn their place."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from two_arms import two_arms

from granswim_pymunk import make_recording
from granswim_pymunk.inference.candidates import named_terms, scaled_like, with_numbers
from granswim_pymunk.inference.data import Case, prepare, prepare_all
from granswim_pymunk.inference.hypothesis import Hypothesis, Predictor, Term
from granswim_pymunk.inference.judge import Claim, Judgement
from granswim_pymunk.inference.start import describe_starts
from granswim_pymunk.inference.tracks import model
from granswim_pymunk.inference.tracks.blocks import _step
from granswim_pymunk.inference.tracks.experiment import _shortened
from granswim_pymunk.inference.tracks.fit import Fitter
from granswim_pymunk.inference.tracks.fitted import Fit
from granswim_pymunk.inference.tracks.intervals import with_doubt, with_limits, with_none_beyond, with_shape_held
from granswim_pymunk.inference.tracks.name import InnerSplit, Trial, _if_better
from granswim_pymunk.inference.tracks.pairs import _of_typical_shape, two_alike
from granswim_pymunk.inference.tracks.sets import SetSearch
from granswim_pymunk.inference.tracks.settle import (
    _weakest,
    _where_it_is_none,
    apparatus_beside,
    in_names_of_apparatus,
    is_its_special_case,
    that_earn_their_place,
    that_may_be_absent,
    without_idle_numbers,
)
from granswim_pymunk.inference.tracks.signatures import make_bank
from granswim_pymunk.laws import all_laws
from granswim_pymunk.recording import Recording
from granswim_pymunk.scene import Body, Scene, use

G, MASS, LENGTH, ARM = 9.81, 0.15, 0.15, 2e-4  # m/s^2, kg, m, kg m^2: of an arm about its centre


def swing(kind: str, t: np.ndarray, *, quadratic=0.0, mu=0.0, drag=0.0, push=0.0, seed=0) -> Recording:
    """Angles of an arm in a pin or hinge: I w' = -m g l sin(theta) - (c l^3 |w| + mu m g l sign + c_1 l^2) w + push."""
    inertia = MASS * LENGTH**2 + ARM

    def rate(_, y):
        v = LENGTH * y[1]
        force = -quadratic * abs(v) * v - mu * MASS * G * v / math.hypot(v, 1e-3) - drag * v
        force += MASS * push * math.cos(y[0]) - MASS * G * math.sin(y[0])
        return [y[1], force * LENGTH / inertia]

    path = solve_ivp(rate, (t[0], t[-1]), [1.2, 0.0], t_eval=t, rtol=1e-10, atol=1e-12).y[0]
    seen = path + np.random.default_rng(seed).normal(size=len(t)) * 1e-4
    body = Body("arm", "free", 0.02, MASS, inertia=ARM)
    law = (
        use("pin", bodies=["arm"], anchor=(0.0, 0.0), length=LENGTH)
        if kind == "pin"
        else use("hinge", bodies=["arm"], anchor_a=(0.0, LENGTH), anchor=(0.0, 0.0))
    )
    scene = Scene((body,), (use("gravity"), law), gravity=(0.0, -G))
    xy = np.full((len(t), 1, 2), np.nan)
    return Recording("swing", scene, t, ("arm",), xy, seen[:, None], angle_noise=1e-4, sampling=1 / (t[1] - t[0]))


def search_of(base: Fit, fitter: Fitter, terms: list[Term], case: Case) -> SetSearch:
    inner = InnerSplit.make([case], fitter.predictor, lambda: False)
    return SetSearch(base, fitter, terms, [case], inner, {}, np.random.default_rng(0), [])


def fitted(recording: Recording, *names: str):
    """A fit of these laws at once, as trials, with all that an exchange needs."""
    case = prepare(recording, held_out=False, split=False)
    fitter = Fitter([case], Predictor({case.name: 1e-3}))
    base = fitter.fit(Hypothesis(), None, stages=(0.3, 1.0))
    terms = named_terms([case])
    bank = make_bank(fitter, base, terms)
    terms = [scaled_like(t, s.term) for t, s in zip(terms, bank.signatures, strict=True)]
    mine = [next(k for k, t in enumerate(terms) if t.label == name) for name in names]
    hypothesis = Hypothesis(tuple(terms[k] for k in mine))
    fit = fitter.fit(hypothesis, None, base.starts, stages=(0.1, 0.3, 1.0), evaluations=60)
    found = [Trial(replace(bank.signatures[k], term=terms[k]), fit, base.chi2 - fit.chi2, 1.0) for k in mine]
    return fitter, case, base, terms, found, fit


def test_scales_follow_the_unit_of_a_number():
    """A tenth of a scale, by which derivatives step, changes the prediction by about a tenth of the noise."""
    t = np.arange(0.0, 3.0, 0.02)
    fitter, case, base, terms, *_ = fitted(swing("pin", t, mu=0.003), "coulomb_substrate")
    for term in terms:
        if term.mechanism not in ("joint_friction", "joint_drag", "linear_drag", "coulomb_substrate"):
            continue
        moved = fitter.vector(case, Hypothesis((term,)), np.array([term.free[0].scale]), base.starts[case.name])
        here = fitter.vector(case, Hypothesis(), np.zeros(0), base.starts[case.name])
        assert 0.5 < float(np.sqrt(np.mean((moved - here) ** 2))) < 2.0, term.label


@pytest.mark.parametrize(
    ("kind", "names", "expected", "amounts"),
    [
        ("pin", ["coulomb_substrate"], ["joint_friction"], {"torque": 0.003 * MASS * G * LENGTH}),
        ("hinge", ["quadratic_drag", "coulomb_substrate"], ["quadratic_drag", "joint_friction"], {}),
        ("pin", ["coulomb_substrate", "linear_drag"], ["joint_friction", "joint_drag"], {}),
        ("hinge", ["linear_drag", "uniform_force"], ["joint_drag", "uniform_force"], {"c": 0.02 * LENGTH**2}),
        ("pin", ["quadratic_drag", "linear_drag", "coulomb_substrate"],
         ["quadratic_drag", "joint_drag", "joint_friction"], {}),
    ],
)  # fmt: skip
def test_laws_of_a_pendulum_are_told_as_those_of_its_joint(kind, names, expected, amounts):
    true = {"coulomb_substrate": {"mu": 0.003}, "linear_drag": {"drag": 0.02}, "quadratic_drag": {"quadratic": 0.05},
            "uniform_force": {"push": 0.05}}  # fmt: skip
    effects = {k: v for name in names for k, v in true[name.split()[0]].items()}
    labels = [name.split()[0] for name in names]
    recording = swing(kind, np.arange(0.0, 6.0, 0.03), **effects)
    fitter, case, base, terms, found, fit = fitted(recording, *labels)
    assert fit.chi2 < 1.4 * fit.count
    now, revised, told = in_names_of_apparatus(search_of(base, fitter, terms, case), found, fit)
    assert [t.mechanism for t in now] == expected
    # the same law in other numbers, or friction that holds, which turns the swing more sharply
    assert fit.chi2 - 5.0 < revised.chi2 < fit.chi2 + 1.0
    assert {e.gave_way.mechanism for e in told} == set(labels) - set(expected)
    # the same law in other numbers: its derivatives are as good, so are its intervals
    for free, value, variance in zip(revised.hypothesis.free, revised.values, np.diag(revised.covariance), strict=True):
        name = free.name.split(".")[1]
        if name in amounts:
            assert abs(value - amounts[name]) < 4 * math.sqrt(variance) and math.sqrt(variance) < 0.05 * value


@pytest.mark.deep
def test_a_pair_begins_anew_from_shapes_that_are_usual():
    """A repulsion as d^-2 beside a drag, stuck at d^-6: strength and power lie along a valley."""
    radius, mass, s, n, c = 0.02, 0.05, 0.05, 2.0, 0.02

    def rate(_, y):
        x, v = y[:4].reshape(2, 2), y[4:].reshape(2, 2)
        apart = x[1] - x[0]
        d = math.hypot(*apart)
        force = s * (radius / d) ** n * apart / d
        return np.concatenate([y[4:], ((np.array([-force, force]) - c * v) / mass).ravel()])

    t = np.arange(0.0, 1.5, 0.01)
    begin = [0.0, 0.0, 0.2, 0.03, 0.1, 0.0, -0.1, 0.0]
    path = solve_ivp(rate, (t[0], t[-1]), begin, t_eval=t, rtol=1e-10, atol=1e-12).y[:4].T.reshape(-1, 2, 2)
    seen = path + np.random.default_rng(0).normal(size=path.shape) * 1e-4
    scene = Scene(tuple(Body(k, "free", radius, mass) for k in "ab"), ())
    recording = Recording("pucks", scene, t, ("a", "b"), seen, position_noise=1e-4, sampling=100.0)
    case = prepare(recording, held_out=False, split=False)
    fitter = Fitter([case], Predictor({case.name: 1e-3}))
    base = fitter.fit(Hypothesis(), None)
    terms = named_terms([case])
    two = [next(t for t in terms if t.label.startswith(name)) for name in ("distance_force", "linear_drag")]
    stuck = fitter.fit(Hypothesis(tuple(two)), [40.0, 6.0, c], base.starts, stages=())
    bank = {s.term.label: s for s in make_bank(fitter, base, two).signatures}
    pair = [Trial(replace(bank[x.label], term=x), stuck, base.chi2 - stuck.chi2, 1.0) for x in two]
    shaped = _of_typical_shape(search_of(base, fitter, terms, case), pair)
    assert (fit := shaped[0].fit) is not None and fit is shaped[1].fit and fit.chi2 < 1.3 * fit.count
    assert fit.values[1:] == pytest.approx([n, c], rel=0.1)
    again = _of_typical_shape(search_of(base, fitter, terms, case), shaped)
    assert again is shaped  # nothing follows better


def test_starts_of_hinged_bodies_are_told_from_the_frames_of_the_case():
    """A case may hold fewer frames than its recording, as where the next experiment is thought out."""
    recording = swing("hinge", np.arange(0.0, 2.0, 0.01))
    angle = recording.angle[:, 0]
    xy = LENGTH * np.stack([np.sin(angle), -np.cos(angle)], axis=-1)[:, None]
    case = prepare(replace(recording, xy=xy, angle=None, position_noise=2e-5), held_out=False, split=False)
    short = _shortened(case, 60)
    first, whole = (describe_starts(c, np.ones(len(c.t), dtype=bool)) for c in (short, case))
    assert np.array_equal(first[0].first, whole[0].first) and abs(first[0].first[0] - 1.2) < 1e-2


def test_arms_that_hang_from_one_another_rub_on_no_substrate():
    """What rubs by its weight needs a substrate; for one pendulum it is the friction of the joint in other numbers."""
    one = prepare(swing("hinge", np.arange(0.0, 1.0, 0.02)), held_out=False, split=False)
    arm = one.recording.scene.bodies[0]
    second = use("hinge", bodies=["arm", "arm2"], anchor_a=(0.0, -0.05), anchor_b=(0.0, 0.1))
    laws = (*one.recording.scene.laws, second)
    scene = replace(one.recording.scene, bodies=(arm, replace(arm, id="arm2")), laws=laws)
    two = replace(one, recording=replace(one.recording, scene=scene))
    named = {n: {t.mechanism for t in named_terms([c])} for n, c in ((1, one), (2, two))}
    assert {"coulomb_substrate", "joint_friction", "linear_drag"} <= named[1]
    assert {"joint_friction", "joint_drag", "linear_drag"} <= named[2] and "coulomb_substrate" not in named[2]


def test_a_bob_that_hangs_from_another_by_a_rod_rubs_on_no_substrate_either():
    t = np.arange(0.0, 1.0, 0.02)
    upper = 0.3 * np.stack([np.sin(0.2 * np.cos(5 * t)), -np.cos(0.2 * np.cos(5 * t))], axis=1)
    xy = np.stack([upper, upper - np.array([0.0, 0.25])], axis=1)
    pin = use("pin", bodies=["up"], anchor=(0.0, 0.0), length=0.3)
    rod = use("rod", bodies=["up", "low"], length=0.25)
    bodies = tuple(Body(b, "free", 0.01, 0.1) for b in ("up", "low"))

    def named(laws, bodies, xy):
        scene = Scene(bodies, laws, gravity=(0.0, -9.81))
        return {term.mechanism for term in named_terms(prepare_all([make_recording(t, xy, scene=scene)]))}

    assert "coulomb_substrate" in named((pin,), bodies[:1], xy[:, :1])
    both = named((pin, rod), bodies, xy)
    assert "coulomb_substrate" not in both and "joint_friction" in both
    assert "lift" not in both  # nor does it fly


def test_a_stream_at_rest_beside_another_law_is_told_as_a_drag():
    """In a wind it stays a stream."""
    for wind, expected in ((0.0, "linear_drag"), (0.5, "ambient_flow")):
        film = dropped(4e-3, 0.0, 1.03, wind)
        fitter, case, base, terms, found, revised = fitted(film, "ambient_flow", "camera_scale")
        told, fit = without_idle_numbers(search_of(base, fitter, terms, case), found, revised)
        assert [t.mechanism for t in told] == [expected, "camera_scale"]
        assert told[0].fit is fit and abs(fit.values[0] - 4e-3) < 2e-4
        # those alone are asked of which intervals hold that
        told, _ = without_idle_numbers(search_of(base, fitter, terms, case), found, revised, {found[0].label})
        assert [t.mechanism for t in told] == [expected, "camera_scale"]
        told, _ = without_idle_numbers(search_of(base, fitter, terms, case), found, revised, set())
        assert [t.mechanism for t in told] == ["ambient_flow", "camera_scale"]


def dropped(drag: float, third: float, scale: float, wind: float = 0.0) -> Recording:
    """A ball of 10 g that is thrown: m v' = m g - (drag + third v^2) v, in a picture so many times too large.

    ``wind`` [m/s] along x: v is the velocity against it.
    """

    def rate(_, y):
        pull = (drag + third * (y[2] ** 2 + y[3] ** 2)) / 0.01
        return [y[2], y[3], -pull * (y[2] - wind), -G - pull * y[3]]

    t = np.arange(0, 0.8, 0.01)
    path = solve_ivp(rate, (0, 1), [0, 1, 3, 2], t_eval=t, rtol=1e-10, atol=1e-12).y[:2].T
    seen = scale * path + 2e-4 * np.random.default_rng(1).normal(size=path.shape)
    scene = Scene((Body("ball", "free", 0.02, 0.01),), (), gravity=(0.0, -G))
    return Recording("drop", scene, t, ("ball",), seen[:, None], position_noise=2e-4)


def test_a_scale_beside_a_drag_that_leaves_more_than_noise_is_no_fault_that_was_found():
    """Where the scale leads it stays: its drag is the smaller part."""
    for case, expected in (((0.0, 1e-3, 1.0), ["camera_scale"]), ((2e-4, 1e-5, 1.06), [])):
        fitter, _, base, _, found, revised = fitted(dropped(*case), "linear_drag", "camera_scale")
        assert [t.mechanism for t in apparatus_beside(found, revised, base, fitter)[0]] == expected
        assert apparatus_beside(found[:1], revised, base, fitter) == ([], None)


def test_a_law_whose_interval_holds_none_may_be_absent():
    """With doubts added to its interval one of two is not sure any more. Components of a push may each be none."""
    _, _, _, _, found, revised = fitted(dropped(2e-3, 0.0, 1.0), "linear_drag", "uniform_force")
    drag, push = found
    rows = {f.name: k for k, f in enumerate(revised.hypothesis.free)}

    def doubted(law: str):
        wide = {k: (-1.0, 1.0) for name, k in rows.items() if name.startswith(law)}
        fit = replace(revised, limits={**revised.limits, **wide})
        return that_may_be_absent([drag, push], fit, 1.0, lambda fit: fit)

    assert that_may_be_absent(found, revised, 1.0, lambda fit: fit) == []
    assert doubted("linear_drag") == [drag] and doubted("uniform_force") == []


def test_a_stream_that_may_as_well_rest_is_the_drag_that_it_is_then():
    """Also where it shows along a rail alone, and its one number goes by the name of the vector."""
    for case, expected in (((2e-3, 0.0, 1.0), True), ((2e-3, 0.0, 1.0, 0.5), False)):
        *_, found, _ = fitted(dropped(*case), "ambient_flow")
        assert is_its_special_case(found[0], 1.0) == expected
    *_, found, _ = fitted(dropped(2e-3, 0.0, 1.0), "linear_drag")
    assert not is_its_special_case(found[0], 1.0)
    law = all_laws()["quadratic_flow"]
    assert [_where_it_is_none(law, f"quadratic_flow.{n}") for n in ("u_x", "u_y[a.1]", "u", "c")] == [0.0] * 4


def drawn_together(attraction: float) -> Recording:
    """Two pucks that pass each other at a distance that hardly changes, and attract as s (r/d)^2 (radius r)."""
    r, mass = 0.02, 0.05

    def rate(_, y):
        d = y[2:4] - y[:2]
        size = math.hypot(*d)
        a = attraction * (r / size) ** 2 * d / size / mass
        return np.concatenate([y[4:], a, -a])

    t = np.arange(0.0, 3.0, 1 / 60)
    path = solve_ivp(rate, (0, 3), [-0.15, 0, 0.15, 0, 0, 0.02, 0, -0.02], t_eval=t, rtol=1e-10, atol=1e-12).y[:4].T
    seen = path.reshape(-1, 2, 2) + 2e-4 * np.random.default_rng(3).normal(size=(len(t), 2, 2))
    scene = Scene(tuple(Body(k, "free", r, mass) for k in "ab"), ())
    return Recording("pucks", scene, t, ("a", "b"), seen, position_noise=2e-4)


@pytest.mark.deep
def test_a_force_whose_power_nobody_can_tell_is_no_less_there():
    """At one distance a strength may be anything with a power to match, and its interval crossed none."""
    for attraction, expected in ((0.05, []), (0.0, ["distance_force"])):
        fitter, case, _, _, found, fit = fitted(drawn_together(attraction), "distance_force")
        loose = with_limits(fitter, fit, 0, 1.0)
        absent = that_may_be_absent(found, loose, 1.0, partial(with_doubt, fitter, first=0, spread=1.0))
        assert [t.mechanism for t in absent] == expected
        held = with_shape_held(loose, "distance_force")
        assert [f.name for f in held.hypothesis.free] == ["distance_force.s"]
        np.testing.assert_allclose(
            fitter.vector(case, held.hypothesis, held.values, held.starts[case.name]),
            fitter.vector(case, fit.hypothesis, fit.values, fit.starts[case.name]), atol=1e-9,
        )  # fmt: skip
    wide = replace(loose, limits={0: (-1e3, 1e3), 1: (0.0, 20.0)}, values=np.array([-2.0, 3.0]))
    assert with_none_beyond(wide, ["distance_force"], 1.0).limits == {0: (-1e3, 0.0), 1: (0.0, 20.0)}
    assert with_none_beyond(wide, [], 1.0).limits == wide.limits


def test_a_number_is_as_far_from_none_as_its_profile_says():
    """Through impacts the curvature at a place may be a hundred times that of the valley it lies in."""
    _, _, base, _, found, revised = fitted(dropped(2e-3, 0.0, 1.0), "linear_drag", "camera_scale")
    first, k = len(base.values), len(revised.values) - 1
    value = float(revised.values[k])
    profiled = {k: (min(value, 1.0) - 0.1, max(value, 1.0) + 0.1)}
    loose = replace(revised, profiles=profiled, limits=profiled)
    sure = {k: (value - 1e-9, value + 1e-9)}
    weakest = _weakest(found, loose, first, 1.0)
    assert weakest is not None and weakest[0] == 1
    assert _weakest(found, replace(revised, profiles=sure, limits=sure), first, 1.0) is None


def test_another_beginning_may_show_fewer_numbers_of_a_law():
    """On a rail what pushes across it moved nothing from where the law was found, and had a number before."""
    fitter, _, base, _, found, revised = fitted(dropped(0.0, 0.0, 1.0), "uniform_force")
    (push,) = found
    term = with_numbers(push.term, [1])
    fit = fitter.fit(base.hypothesis.with_term(term), [*base.values, revised.values[-1]], revised.starts)
    (better,) = _if_better(fitter, base, [replace(push, fit=None)], [0], lambda k, own: fit)
    assert len(better.values) == len(better.term.free) == better.used == 1


def test_a_joint_that_does_not_drag_gets_no_entry():
    """Two arms hung from one another; only the first axle drags, and both are fitted."""
    seen = two_arms(np.arange(0.0, 2.0, 0.02))
    fitter, case, base, terms, found, fit = fitted(seen, "joint_drag (each body)")
    assert len(fit.values) == 2
    now, revised, dropped = that_earn_their_place(search_of(base, fitter, terms, case), found, fit)
    assert list(dropped) == ["arm2"] and [f.name for f in revised.hypothesis.free] == ["joint_drag.c[arm1]"]
    assert abs(revised.values[0] - 6e-4) < 4 * math.sqrt(revised.covariance[0, 0])
    # what is needed stays
    again = that_earn_their_place(search_of(base, fitter, terms, case), now, revised)
    assert again[1] is revised and not again[2]


def test_numbers_without_a_block_stop_at_their_bounds_together():
    """Where one of two numbers that make up for each other cannot go on, the other does not make up for its way."""
    rng = np.random.default_rng(3)
    columns = rng.normal(size=(200, 2))
    columns[:, 1] += 3 * columns[:, 0]
    wanted = columns @ [-1.0, 2.0]
    free = _step(columns.T @ columns, columns.T @ wanted, np.full(2, -9.0), np.full(2, 9.0))
    np.testing.assert_allclose(free, [-1.0, 2.0], rtol=1e-9)
    stopped = _step(columns.T @ columns, columns.T @ wanted, np.array([0.0, -9.0]), np.full(2, 9.0))
    best = columns[:, 1] @ wanted / (columns[:, 1] @ columns[:, 1])
    assert 1.0 < best < 1.9  # and not the 2 of the step that is cut off
    np.testing.assert_allclose(stopped, [0.0, best], atol=1e-6)
    fixed = _step(columns.T @ columns, columns.T @ wanted, np.zeros(2), np.array([0.0, 9.0]))
    np.testing.assert_allclose(fixed, [0.0, best], atol=1e-6)


def test_a_claim_is_settled_with_its_own_segments(monkeypatch):
    """What was found may be followed from one start, and another law of its class in the segments as they were."""
    asked = []

    def limits(fitter, *_):
        asked.append(fitter)
        raise StopIteration

    monkeypatch.setattr(model, "with_limits", limits)
    one, cut = object.__new__(Fitter), object.__new__(Fitter)
    one.segments, cut.segments = {"r": [0]}, {"r": [0, 1]}
    tracks = object.__new__(model.Tracks)
    tracks.fitter, tracks.study = one, SimpleNamespace(fitter=cut, late=lambda share: False)
    tracks.tried, tracks.spread = SimpleNamespace(recalibrated=SimpleNamespace(values=())), 1.0
    for own in (one, cut):
        claim = SimpleNamespace(fit=SimpleNamespace(segments=own.segments), laws=(), nameless=False)
        with pytest.raises(StopIteration):
            tracks.settle(SimpleNamespace(verdict="missing_physics", claim=claim))
    assert asked == [one, cut]


def test_a_drag_in_a_picture_whose_scale_is_off_stands_in_place_of_a_wind_up_along_a_fall():
    """Both leave noise. Neither a drag nor a scale alone is near: they are no leaders, and are found nevertheless."""
    t, scale, c, noise = np.arange(0.0, 1.0, 1 / 60), 0.92, 0.1, 3e-4
    fall = solve_ivp(lambda _, s: [s[1], -G - c / MASS * s[1]], (0, 1), [0.0, 0.0], t_eval=t, rtol=1e-10).y[0]
    y = scale * fall + np.random.default_rng(1).normal(size=len(t)) * noise
    scene = Scene((Body("ball", "free", 0.03, MASS),), (use("gravity"),), gravity=(0.0, -G))
    xy, angle = np.stack([np.zeros_like(y), y], axis=1)[:, None], np.full((len(t), 1), np.nan)
    recording = Recording("fall", scene, t, ("ball",), xy, angle, position_noise=noise, sampling=60.0)
    fitter, case, base, terms, (flow,), fit = fitted(recording, "ambient_flow")
    assert fit.excess == 0 and base.chi2 > 1e3 * base.count
    pairs = two_alike(search_of(base, fitter, terms, case), [flow], flow, flow.used)
    both = next(p for p in pairs if {trial.mechanism for trial in p} == {"linear_drag", "camera_scale"})
    found = {f.name: float(v) for f, v in zip(both[0].fit.hypothesis.free, both[0].fit.values, strict=True)}
    assert found["camera.scale"] == pytest.approx(scale, abs=0.02)
    assert found["linear_drag.c"] == pytest.approx(c, abs=0.02)


@pytest.mark.parametrize(
    ("special", "verdict", "named"),
    [
        (False, "unmodelled", ["quadratic_drag", "camera_tilt"]),  # needed: it is kept
        (True, "unmodelled", None),  # what bends a picture looks like a little of anything
        (False, "missing_physics", ["quadratic_drag"]),  # not needed: in the scene, and not named
    ],
)
def test_a_tilt_without_which_the_names_explain_too_little_is_named(monkeypatch, special, verdict, named):
    @dataclass(frozen=True)
    class Law:
        label: str
        special: bool = False
        fit: object = None
        gain: float = 0.0

    laws = (Law("quadratic_drag"), Law("camera_tilt", special))
    fit, without = SimpleNamespace(chi2=10.0), SimpleNamespace(chi2=50.0)
    told = Judgement(verdict, Claim((), None))

    def judged(of, claim):
        of.notes.append("quadratic_drag is not named: it explains 30 % of the mismatch, 50 % are asked")
        return told

    monkeypatch.setattr(model, "apparatus_beside", lambda *a: ([laws[1]], without))
    monkeypatch.setattr(model, "judged_by_training", judged)
    monkeypatch.setattr(model, "absurd", lambda trial: "")
    of = SimpleNamespace(
        tried=SimpleNamespace(recalibrated=SimpleNamespace(chi2=100.0, values=[])), notes=[], spread=1.0,
        _fitter_of=lambda fit: None, completeness=lambda fit: SimpleNamespace(passes=False),
        _unnamed=lambda laws, those, fit, why: tuple(t for t in laws if t not in those),
    )  # fmt: skip
    found = model.Tracks._without_faults(of, laws, fit)
    if named is None:
        assert found is told
    else:
        assert [t.label for t in found[0]] == named and found[1] is fit
        assert bool(of.notes) == (verdict != "unmodelled")
