"""Masses and radii that are believed and not known: what they add to intervals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from granswim_pymunk.inference.candidates import named_terms, scaled_like
from granswim_pymunk.inference.data import prepare
from granswim_pymunk.inference.hypothesis import Hypothesis, Predictor
from granswim_pymunk.inference.start import first_numbers
from granswim_pymunk.inference.tracks import diagnose_tracks
from granswim_pymunk.inference.tracks.believed import believed_terms, chance_of_errors
from granswim_pymunk.inference.tracks.fit import Fitter
from granswim_pymunk.inference.tracks.intervals import with_believed_errors
from granswim_pymunk.inference.tracks.segments import make_segments
from granswim_pymunk.inference.tracks.signatures import make_bank
from granswim_pymunk.inference.tracks.study import calibrated, study_of
from granswim_pymunk.recording import film
from granswim_pymunk.scene import Adjustable, Body, Scene, use


def seen(scene: Scene, *laws, seconds=0.6, **errors):
    recording = film(
        scene.with_laws(*laws), np.arange(0.0, seconds, 0.01), rng=np.random.default_rng(4), noise=2e-5
    )
    bodies = tuple(replace(b, initial=None) for b in scene.bodies)
    return replace(recording, scene=replace(scene, bodies=bodies), **errors)


def fitted(recording, label: str):
    case = prepare(recording, held_out=False, split=False)
    fitter = Fitter([case], Predictor({case.name: 5e-4}))
    base = fitter.fit(Hypothesis(), None)
    terms = [t for t in named_terms([case]) if t.label == label]
    (signature,) = make_bank(fitter, base, terms).signatures
    hypothesis = Hypothesis((scaled_like(terms[0], signature.term),))
    return fitter, fitter.fit(hypothesis, [f.first for f in signature.term.free], base.starts)


SLIDING = Scene((Body("a", "free", 0.01, 0.02, initial=(0.0, 0.0, 0.4, 0.1)),))
MEETING = Scene(
    (Body("a", "free", 0.01, 0.02, initial=(0.0, 0.0, 0.5, 0.01)),
     Body("b", "free", 0.015, 0.05, initial=(0.1, 0.010, -0.1, 0.0))),
    (use("contact_elastic", restitution=0.95),),
)  # fmt: skip


@pytest.mark.parametrize(
    ("law", "values", "share"),
    [("linear_drag", {"c": 0.01}, 1.0), ("coulomb_substrate", {"mu": 0.02}, 0.0),
     ("uniform_force", {"a": (0.1, 0)}, 0.0)],
)  # fmt: skip
def test_a_force_per_mass_is_as_unknown_as_the_mass(law, values, share):
    """A drag c shows as c/m alone, so that c is off as m is; friction and a tilt are accelerations."""
    errors = {}
    for error in (None, 0.03):
        fitter, fit = fitted(seen(SLIDING, use(law, **values), mass_error=error), law)
        errors[error] = with_believed_errors(fitter, fit, 1.0).interval(0)
    value, low, high = errors[None]
    added = np.sqrt(max((errors[0.03][2] - errors[0.03][1]) ** 2 - (high - low) ** 2, 0.0)) / (2 * 1.96)
    assert added == pytest.approx(share * 0.03 * value, rel=0.05, abs=1e-3 * abs(value))


def test_radii_count_where_bodies_meet():
    """What an impact that is not central tells of restitution is off as the radii are; a push in flight is not."""
    lossy = replace(MEETING, laws=(use("contact_elastic", restitution=0.75),))
    told = {}
    for label, law in (("restitution", ()), ("uniform_force", (use("uniform_force", a=(0.5, 0.2)),))):
        recording = seen(lossy if not law else MEETING, *law, seconds=0.4, radius_error=0.03)
        fitter, fit = fitted(replace(recording, scene=replace(recording.scene, laws=MEETING.laws)), label)
        believed = with_believed_errors(fitter, fit, 1.0).believed
        assert believed is not None
        told[label] = float(np.max(np.diag(believed) / np.diag(fit.covariance)))
    assert told["restitution"] > 0.02 and told["uniform_force"] < 1e-3


@pytest.mark.deep
def test_what_the_verdict_says_is_wider_by_the_mass():
    """The interval of a drag grows by what the mass is unknown, beside what the data and an unseen slope leave."""
    widths = {}
    for error in (None, 0.02):
        found = diagnose_tracks([seen(SLIDING, use("linear_drag", c=0.01), seconds=0.8, mass_error=error)])
        c = found.verdict["mechanisms"][0]["parameters"]["c"]
        widths[error] = (c["high"] - c["low"]) / (2 * 1.96)
        assert c["low"] < 0.01 < c["high"]
    assert np.sqrt(widths[0.02] ** 2 - widths[None] ** 2) == pytest.approx(0.02 * 0.01, rel=0.2)


@pytest.mark.deep
def test_masses_off_as_stated_are_no_physics():
    """A car on a spring: a mass 2 % off changes the period, and 2 % were stated."""
    body = Body("c", "free", 0.02, 0.3, initial=(0.08, 0.0, 0.0, 0.0))
    laws = (use("rail", direction=(1.0, 0.0)), use("spring", anchor=(0.0, 0.0), stiffness=8.0, bodies=["c"]))
    heavier = Scene((replace(body, mass=0.306),), laws)
    verdicts = {}
    for error in (None, 0.02):
        recording = seen(heavier, seconds=2.0, mass_error=error)
        believed = replace(recording, scene=replace(recording.scene, bodies=(replace(body, initial=None),)))
        verdicts[error] = diagnose_tracks([believed]).verdict
    assert verdicts[None]["verdict"] in ("missing_physics", "measurement")
    assert verdicts[0.02]["verdict"] == "no_mismatch" and not verdicts[0.02]["mechanisms"]
    assert any("as far off as was stated" in note for note in verdicts[0.02]["notes"])


GLIDERS = Scene(
    (Body("a", "free", 0.02, 0.2, initial=(0.25, 0.0, 0.0, 0.0)),
     Body("b", "free", 0.02, 0.25, initial=(0.52, 0.0, 0.1, 0.0))),
    (use("rail", direction=(1.0, 0.0)),
     use("spring", anchor=(0.0, 0.0), stiffness=6.0, length=0.2, bodies=["a"]),
     use("spring", anchor=(0.7, 0.0), stiffness=6.0, length=0.2, bodies=["b"]),
     use("pair_spring", k=4.0, f_0=1.2)),
)  # fmt: skip
HUNG = Body("p", "free", 0.02, 0.15, initial=(0.1, 0.1, 0.0, 0.0))
PIN = use("pin", anchor=(0.0, 0.3), length=float(np.hypot(0.1, 0.2)), bodies=["p"])
CAR = Scene(
    (Body("c", "free", 0.02, 0.3, initial=(0.08, 0.0, 0.0, 0.0)),),
    (use("rail", direction=(1.0, 0.0)), use("spring", anchor=(0.0, 0.0), stiffness=8.0, bodies=["c"])),
)
SOFTER = replace(CAR, adjustable=(Adjustable("spring", "stiffness", 4.0, 16.0),))


@pytest.mark.parametrize(
    ("scene", "shown"),
    [(GLIDERS, ["a", "b"]), (CAR, ["c"]), (SOFTER, []), (SLIDING, []), (replace(SLIDING, gravity=(0.0, -9.81)), []),
     (Scene((HUNG,), (PIN,), (0.0, -9.81)), [])],
    ids=["chain", "spring", "adjustable spring", "table", "fall", "pendulum"],
)  # fmt: skip
def test_masses_that_show_in_motion_are_numbers_of_every_fit(scene, shown):
    """Where their error was stated, and where neither starts nor what may be adjusted do the same."""
    for error in (0.01, None):
        film = seen(scene, seconds=1.0, mass_error=error, radius_error=error)
        study = study_of([film], [], np.random.default_rng(0), lambda *a: None, lambda share: False)
        calibrated(study)
        assert [t.label for t in study.believed] == [f"mass_error[{name}]" for name in shown if error]


@pytest.mark.deep
def test_two_gliders_with_masses_off_as_stated_lack_nothing():
    """A law, as a cubic spring, has to explain what such masses cannot; the first screen tells of the masses alone."""
    heavier = tuple(replace(b, mass=b.mass * r) for b, r in zip(GLIDERS.bodies, (1.008, 0.991), strict=True))
    recording = seen(replace(GLIDERS, bodies=heavier), seconds=1.5, mass_error=0.01)
    bodies = tuple(replace(b, initial=None) for b in GLIDERS.bodies)
    verdict = diagnose_tracks([replace(recording, scene=replace(GLIDERS, bodies=bodies))]).verdict
    assert verdict["verdict"] == "no_mismatch" and verdict["complete"] and not verdict["mechanisms"]
    assert any("as far off as was stated" in note for note in verdict["notes"])


@pytest.mark.deep
def test_a_stream_beside_an_adjustable_drag_is_not_what_masses_do():
    """Of it only products are known, so that the intervals of its numbers hold nought one by one; it is there all the
    same."""
    believed = replace(SLIDING, laws=(*SLIDING.laws, use("linear_drag", c=0.0024)))
    given = replace(believed, adjustable=(Adjustable("linear_drag", "c", 0.0007, 0.0048),))
    recording = seen(believed, use("ambient_flow", c=0.0009, u=(-0.07, 0.037)), seconds=1.6, mass_error=0.02)
    verdict = diagnose_tracks([replace(recording, scene=replace(given, bodies=recording.scene.bodies))]).verdict
    assert verdict["verdict"] == "missing_physics"
    assert not any("masses and radii" in note for note in verdict["notes"])


def met(truth: Scene, **errors):
    """Two disks that meet once, as they really are, with MEETING for what is believed of them."""
    recording = seen(truth, **errors)
    bodies = tuple(replace(b, initial=None) for b in MEETING.bodies)
    return replace(recording, scene=replace(MEETING, bodies=bodies))


@pytest.mark.deep
def test_an_impact_that_loses_a_per_cent_more_is_named():
    """Loose joints at impacts allow for as much; masses and radii are numbers of the fit, and do not do it."""
    verdict = diagnose_tracks([met(replace(MEETING, laws=(use("contact_elastic", restitution=0.93),)))]).verdict
    assert verdict["verdict"] == "missing_physics"
    (found,) = verdict["mechanisms"]
    e = found["parameters"]["restitution"]
    assert found["name"] == "restitution" and e["value"] == pytest.approx(0.93, abs=0.005)
    assert e["high"] - e["low"] < 0.03


@pytest.mark.deep
def test_a_radius_that_is_off_is_no_physics_and_not_complete():
    bodies = tuple(replace(b, radius=b.radius * r) for b, r in zip(MEETING.bodies, (1.02, 1.03), strict=True))
    verdict = diagnose_tracks([met(replace(MEETING, bodies=bodies))]).verdict
    assert verdict["verdict"] in ("no_mismatch", "recalibrate") and verdict["complete"] is False
    assert any("radii are off" in note for note in verdict["notes"])
    right = diagnose_tracks([met(MEETING)]).verdict
    assert right["verdict"] == "no_mismatch" and right["complete"] is True


@pytest.mark.deep
@pytest.mark.parametrize(
    ("off", "errors", "told", "complete"),
    [((1.015, 1.01), {"radius_error": 0.02}, "as far off as was stated", True),
     ((1.008, 1.01), {}, "as far off as is usual", False)],
    ids=["radii stated, masses not", "nothing stated"],
)  # fmt: skip
def test_radii_off_as_is_believed_are_no_physics(off, errors, told, complete):
    """Of disks that met masses are numbers too, whether or not anything was said of them.

    What is stated is free in the scene as it is believed, what is not is a fault of it (contract 2, ``radius_error``).
    """
    bodies = tuple(replace(b, radius=b.radius * r) for b, r in zip(MEETING.bodies, off, strict=True))
    verdict = diagnose_tracks([met(replace(MEETING, bodies=bodies), **errors)]).verdict
    assert verdict["verdict"] == "no_mismatch" and verdict["complete"] is complete
    assert any(told in note for note in verdict["notes"])


def test_errors_are_unlikely_as_often_as_is_said():
    """Of estimates that a prior draws to itself; what nobody saw neither hides nor adds anything."""
    rng, priors = np.random.default_rng(5), np.array([0.01, 0.01, 0.02])
    sees = np.array([[1.0, 1.0, 0.0], [1.0, -0.5, 0.0]]) / 0.002  # two directions of three numbers
    covariance = np.linalg.inv(sees.T @ sees + np.diag(priors**-2))
    drawn = priors * rng.normal(size=(4000, 3))
    found = (drawn @ sees.T + rng.normal(size=(4000, 2))) @ sees @ covariance
    p = np.array([chance_of_errors(one, priors, covariance) for one in found])
    assert np.mean(p < 0.05) == pytest.approx(0.05, abs=0.01) and np.mean(p < 0.5) == pytest.approx(0.5, abs=0.03)
    far, known = np.array([0.035, 0.0]), np.diag([1e-6, 1e-6])
    alone = chance_of_errors(far, priors[:2], known)
    many = np.diag([1e-6, 1e-6, *[0.9e-4] * 20])
    assert alone < 0.005
    assert chance_of_errors(np.r_[far, np.zeros(20)], np.full(22, 0.01), many) == pytest.approx(alone)
    assert chance_of_errors(np.full(2, 0.01), priors[:2], np.diag(priors[:2] ** 2)) == 1.0


@pytest.mark.deep
def test_of_equals_what_laboratories_are_off_by_is_named():
    """A car on a spring whose period is off: half a per cent of mass, or a spring that bends a little."""
    from test_diagnosis import SWING, cart, filmed

    truth = cart()
    heavier = replace(truth, bodies=tuple(replace(b, mass=b.mass * 1.008) for b in truth.bodies))
    verdict = diagnose_tracks([filmed(heavier, truth, SWING[::4], np.random.default_rng(3), noise=3e-4)]).verdict
    (found,) = verdict["mechanisms"]
    assert found["name"] == "added_mass"
    assert found["parameters"]["beta"]["low"] < 0.008 < found["parameters"]["beta"]["high"]


def test_blocks_keep_what_all_data_tell_of_radii_and_those_that_graze_say_nothing():
    from granswim_pymunk.inference.noise import Noise
    from granswim_pymunk.inference.tracks.believed import believed_terms
    from granswim_pymunk.inference.tracks.blocks import make_blocks, score, without

    unheard = {}
    for across in (0.010, 0.0262):  # they pass at 0.008 and 0.0245 m, of a sum of radii of 0.025 m
        a, b = MEETING.bodies
        grazing = replace(MEETING, bodies=(a, replace(b, initial=(0.1, across, -0.1, 0.0))))
        film = seen(grazing, seconds=0.6)
        film = replace(film, xy=film.xy + 1e-3 * np.random.default_rng(1).normal(size=film.xy.shape))
        film = replace(film, position_noise=1e-3)
        case = prepare(film, held_out=False, split=False)
        fitter = Fitter([case], Predictor({case.name: 5e-4}))
        fit = fitter.fit(Hypothesis(believed_terms([case])), None)
        blocks = make_blocks([case])
        assert blocks and all((without(fit, block) == fit.values).all() for block in blocks)
        found = score(fit, blocks, fitter.predictor, Noise(), np.random.default_rng(0))
        seen_of_all = sum(int(np.isfinite(case.values[block.rest]).sum()) for block in blocks)
        unheard[across] = seen_of_all - sum(found.counts.values())
        assert not found.failed and found.mean < found.floors.mean() + 4 * found.floors.std()
    # of those that graze what comes after is left out, where a start does not tell whether they touch
    assert unheard[0.010] == 0 and unheard[0.0262] >= 12


def test_runs_that_differ_in_the_start_alone_share_a_scene(monkeypatch):
    """The segments of a film and the derivatives by starts ask for one scene; its bodies are made once, not each time.

    What is predicted is what a predictor that has never run before predicts.
    """
    case = prepare(seen(MEETING, radius_error=0.005), held_out=False, split=False)
    hypothesis, made = Hypothesis(believed_terms([case])), []
    scene = Hypothesis.scene
    monkeypatch.setattr(Hypothesis, "scene", lambda self, *args: made.append(1) or scene(self, *args))
    (first, *_) = make_segments(case, case.training)
    numbers, values = first_numbers(first.starts), np.zeros(len(hypothesis.free))
    predictor = Predictor({case.name: 5e-4})
    for shift, share, scenes in ((0.0, 0.0, 1), (1e-4, 0.0, 1), (1e-4, 2e-3, 2), (0.0, 2e-3, 2), (2e-4, 0.0, 3)):
        how = hypothesis, case, values + share, first.starts, numbers + shift, float(case.t[0]), case.t
        found = predictor(*how)
        assert len(made) == scenes
        assert np.array_equal(found, Predictor({case.name: 5e-4})(*how))
        del made[scenes:]
