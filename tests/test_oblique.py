"""A camera that looks at the plane of motion at an angle: as it shows it, and as the diagnosis finds it."""

import math
from dataclasses import replace

import numpy as np
import pytest

import granswim_pymunk as gs
from granswim_pymunk.inference.camera_terms import camera_terms
from granswim_pymunk.inference.data import prepare_all
from granswim_pymunk.inference.hypothesis import Hypothesis, Predictor
from granswim_pymunk.inference.tracks import choose, signatures
from granswim_pymunk.inference.tracks.fit import Fitter
from granswim_pymunk.inference.tracks.name import try_candidates
from granswim_pymunk.inference.tracks.steps import time_steps
from granswim_pymunk.recording import film, see
from granswim_pymunk.scene import Body, Scene, read_scene, use


def pendulum(**camera):
    """A bob on a rod of 0.4 m, filmed for 2 s with 0.2 mm of noise."""
    bob = Body("bob", "free", 0.02, 0.1, initial=(0.4 * math.sin(0.7), -0.4 * math.cos(0.7), 0.0, 0.0))
    scene = Scene((bob,), (use("pin", bodies=["bob"], anchor=(0.0, 0.0), length=0.4),), gravity=(0.0, -9.81))
    seen = film(scene, np.arange(0.0, 2.0, 1 / 60), rng=np.random.default_rng(3), noise=2e-4, **camera)
    return replace(seen, angle=None)  # a camera alone


def test_lengths_along_one_direction():
    """Along e they are f of what they were, across it as they were, whichever way e points."""
    for direction in (0.0, math.pi / 2, 0.7):
        e = np.array([math.cos(direction), math.sin(direction)])
        across = np.array([-e[1], e[0]])
        seen = see(2.0 * e + 3.0 * across, foreshortening=0.9, direction=direction)
        np.testing.assert_allclose(seen, 1.8 * e + 3.0 * across, atol=1e-14)
    both = see(np.array([1.0, 1.0]), foreshortening=0.5, direction=math.pi / 2, scale=2.0, bias=(0.1, 0.0))
    np.testing.assert_allclose(both, [2.1, 1.0], atol=1e-14)


@pytest.mark.deep
def test_oblique_picture_is_named(tmp_path):
    """A pendulum whose picture is narrower by cos 14 degrees: no lens, no bias and no force."""
    f = math.cos(math.radians(14))
    verdict = gs.diagnose(pendulum(foreshortening=f), out=tmp_path / "out", seed=1).verdict
    assert verdict["verdict"] == "measurement" and verdict["complete"]
    (entry,) = verdict["mechanisms"]
    assert entry["name"] == "camera_foreshortening"
    factor, axis = entry["parameters"]["f"], entry["parameters"]["axis"]
    assert axis["value"] == "x" and axis["low"] is None
    assert factor["low"] - 1e-3 < f < factor["high"] + 1e-3 and factor["high"] - factor["low"] < 5e-3
    camera = read_scene(tmp_path / "out" / "revised.toml").camera
    assert camera == {"foreshortening": factor["value"]}
    assert "angle" in (tmp_path / "out" / "report.html").read_text()


def test_a_picture_is_too_large_about_the_place_from_which_bodies_hang():
    """Where the pivot was read off the picture, its scale leaves that where it is, and turns no rod."""
    bob = Body("bob", "free", 0.02, 0.1, initial=(0.5, 0.4, 0.0, 0.0))
    pin = use("pin", bodies=["bob"], anchor=(0.3, 0.8), length=math.hypot(0.2, 0.4))
    seen = film(Scene((bob,), (pin,), gravity=(0.0, -9.81)), np.arange(0.0, 1.0, 0.02), rng=np.random.default_rng(3))
    cases = prepare_all([replace(seen, angle=None)], ())
    terms = {t.label: t for t in camera_terms(cases)}
    term = terms["camera_scale about the anchor"]
    scene, camera = term.apply(cases[0].recording.scene, {}, [1.01])
    rod, pivot = np.array([0.2, -0.4]), np.array([0.3, 0.8])
    np.testing.assert_allclose(see(pivot, **camera), pivot, atol=1e-15)
    np.testing.assert_allclose(see(pivot + rod, bias=(0.1, 0.0), **camera), pivot + 1.01 * rod + [0.1, 0.0], atol=1e-15)
    turned = terms["camera_tilt about the anchor"].apply(scene, {}, [0.1])[1]
    np.testing.assert_allclose(see(pivot, **turned), pivot, atol=1e-15)
    assert "camera_scale about the anchor" not in {t.label for t in camera_terms(prepare_all([pendulum()], ()))}


def test_any_direction():
    """A picture shortened along 0.5 rad: the form whose direction is sought finds both numbers."""
    (case,) = cases = prepare_all([pendulum(foreshortening=0.95, direction=0.5)], ())
    fitter = Fitter(cases, Predictor(time_steps(cases)))
    naive = fitter.fit(Hypothesis(), (), None)
    terms = [t for t in camera_terms(cases) if t.mechanism == "camera_foreshortening"]
    best = try_candidates(fitter, naive, signatures.make_bank(fitter, naive, terms), (1.0,), lambda *a: None)[0]
    assert "sought" in best.label
    f, direction = best.fit.values
    assert abs(f - 0.95) < 2e-3 and abs(math.remainder(direction - 0.5, math.pi)) < 0.05
    assert best.fit.chi2 < 1.2 * best.fit.count and case.channels


def test_what_is_the_same_as_a_scale_is_a_scale():
    """Of a body that falls freely only lengths along y show: the plain scale is named, the angle stays its equal."""
    ball = Body("ball", "free", 0.02, 0.1, initial=(0.0, 1.0, 0.3, 1.0))
    seen = film(
        Scene((ball,), (), gravity=(0.0, -9.81)), np.arange(0.0, 0.6, 0.01), rng=np.random.default_rng(4), noise=1e-4,
        scale=1.03,
    )  # fmt: skip
    cases = prepare_all([seen], ())
    fitter = Fitter(cases, Predictor(time_steps(cases)))
    naive = fitter.fit(Hypothesis(), (), None)
    terms = [t for t in camera_terms(cases) if t.mechanism in ("camera_scale", "camera_foreshortening")]
    trials = try_candidates(fitter, naive, signatures.make_bank(fitter, naive, terms), (1.0,), lambda *a: None)
    fitted = [t for t in trials if t.fit is not None]
    equal = [t for t in fitted if t.gain > fitted[0].gain - 1.0]
    assert {t.mechanism for t in equal} == {"camera_scale", "camera_foreshortening"}
    chosen = choose.choose([scored(t) for t in fitted], 1.0, math.inf, len(fitted))
    assert chosen is not None and chosen.mechanism == "camera_scale"


def scored(trial):
    """A trial that predicts what it was not fitted to as well as any."""
    return replace(trial, inner=1.0)
