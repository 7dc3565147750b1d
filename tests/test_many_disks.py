"""Twelve disks in a box: a scene that is caught, how closely it is joined, and what is predicted through impacts."""

from __future__ import annotations

import numpy as np
import pytest

from granswim_pymunk.inference.candidates import named_terms
from granswim_pymunk.inference.criteria import current
from granswim_pymunk.inference.hypothesis import Hypothesis
from granswim_pymunk.inference.noise import Noise
from granswim_pymunk.inference.tracks.blocks import make_blocks, score
from granswim_pymunk.inference.tracks.closer import joined_closely
from granswim_pymunk.inference.tracks.segments import find_impacts
from granswim_pymunk.inference.tracks.study import calibrated, study_of
from granswim_pymunk.recording import Recording, read_recording, write_recording
from granswim_pymunk.scene import Body, Scene, use
from granswim_pymunk.validation.hard_disks import Impacts, Physics, Table, run

COUNT, SIDE, RADIUS, MASS, NOISE = 12, 0.4, 0.015, 0.018, 3e-4  # -, m, m, kg, m


def study_in(folder, seed, restitution, frames, substrate=0.0, skipped=0):
    """Of a film of twelve disks that are believed to have a restitution of 0.95."""
    rng, places = np.random.default_rng(seed), list[np.ndarray]()
    while len(places) < COUNT:
        place = rng.uniform(-SIDE / 2 + 0.025, SIDE / 2 - 0.025, 2)
        if all(np.hypot(*(place - other)) > 0.04 for other in places):
            places.append(place)
    start = np.concatenate([np.round(places, 4), rng.normal(size=(COUNT, 2)) * 0.35], 1)
    corners = [(-SIDE / 2, -SIDE / 2), (SIDE / 2, -SIDE / 2), (SIDE / 2, SIDE / 2), (-SIDE / 2, SIDE / 2)]
    walls = tuple(zip(corners, [*corners[1:], corners[0]], strict=True))
    t = np.arange(frames) / 240
    table = Table(np.full(COUNT, RADIUS), np.full(COUNT, MASS), np.zeros(COUNT, bool), walls)
    flight = run(table, Physics(restitution=restitution, substrate=substrate), start, t, Impacts(), rng)
    assert len(flight.touches) > 30
    ids = tuple(f"d{k}" for k in range(COUNT))
    scene = Scene(tuple(Body(b, "free", RADIUS, MASS) for b in ids), (use("contact_elastic", restitution=0.95),))
    rng.normal(size=skipped)  # other noise
    xy = np.round(flight.xy + NOISE * rng.normal(size=flight.xy.shape), 7)
    made = Recording("disks", scene, np.round(t, 7), ids, xy, sampling=240.0, position_noise=NOISE)
    folder = write_recording(made, folder / "disks")
    with (folder / "recording.toml").open("a") as file:
        for a, b in walls:
            file.write(f"\n[[wall]]\nfrom = {list(a)}\nto = {list(b)}\n")
    return study_of([read_recording(folder)], [], np.random.default_rng(0), lambda *a: None, lambda share: False)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return study_in(tmp_path_factory.mktemp("disks"), 1, 0.75, 360)


@pytest.fixture(scope="module")
def fits(study):
    return calibrated(study)  # the first fits of this study: later ones begin where these ended


def test_recalibration_gets_free_of_where_the_scene_was_caught(fits):
    """With loose joints every scene follows, and the first fit of the naive one did not."""
    naive, recalibrated = fits
    assert naive.chi2 < 2 * naive.count and recalibrated.chi2 < 2 * recalibrated.count


@pytest.mark.deep
def test_starts_that_missed_an_impact_are_found_from_the_flights_before_it(tmp_path):
    """Nothing is missing: from the first frames the fit ended beside an impact, and left 1.3 of the noise."""
    naive, recalibrated = calibrated(study_in(tmp_path, 12, 0.95, 360))
    assert naive.excess == 0 and recalibrated.excess == 0


def test_impacts_that_follow_at_once_are_seen_as_in_a_corner(tmp_path):
    """Disk d1 was seen in four frames between two walls: neither impact was told, and 13 times the noise was left."""
    study = study_in(tmp_path, 4, 0.95, 360)
    (case,) = study.cases
    at_walls = [float(case.t[i.row]) for i in find_impacts(case) if i.bodies == ("d1",) and i.row < 100]
    assert at_walls == pytest.approx([0.3418, 0.3597], abs=0.005)
    naive = study.fitter.fit(Hypothesis(), None)
    assert naive.excess == 0


@pytest.mark.deep
def test_segments_join_no_more_closely_than_the_scene_without_a_law_follows(study, fits):
    """With the law impacts could be joined to 0.008 of what they give; without, thirty times the noise was left."""
    fitter, fit = joined_closely(study.fitter, fits[1], named_terms(study.cases))
    assert fitter.closeness < 1
    assert fits[1].chi2 < fit.chi2 < current().signatures.far ** 2 * fit.count


@pytest.mark.deep
def test_what_is_not_followed_from_a_start_says_nothing_against_the_right_law(study, fits):
    """From five frames before an impact two disks were struck or not: the right law seemed to leave 1.43 of 1."""
    law = next(t for t in named_terms(study.cases) if t.mechanism == "restitution")
    fit = study.fitter.fit(Hypothesis((law,)), [0.75], fits[0].starts)
    found = score(fit, make_blocks(study.cases), study.predictor, Noise(), np.random.default_rng(0))
    naive = score(fits[0], make_blocks(study.cases), study.predictor, Noise(), np.random.default_rng(0))
    floor, spread = found.floors.mean(), found.floors.std()
    assert found.mean < floor + 4 * spread < naive.mean
    assert sum(found.counts.values()) > 0.7 * sum(int(b.rest.sum()) * 2 * COUNT for b in make_blocks(study.cases))


@pytest.mark.deep
def test_starts_are_drawn_where_the_flight_leaves_open_how_bodies_meet(tmp_path):
    """Of dry friction: two disks meet slowly, and the flights before lead to the wrong side of what comes of it."""
    study = study_in(tmp_path, 2, 0.95, 480, substrate=0.03, skipped=12)
    law = next(t for t in named_terms(study.cases) if t.label == "coulomb_substrate")
    _, plain = calibrated(study)
    fit = study.fitter.fit(plain.hypothesis.with_term(law), [*plain.values, 0.03], plain.starts)
    assert fit.excess == 0 and fit.values[-1] == pytest.approx(0.03, abs=1e-3)
