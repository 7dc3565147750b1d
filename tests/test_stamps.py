"""What all bodies of a bed tell together: the noise of a sighting, and the moments of the frames."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from granswim_pymunk.inference.hypothesis import Hypothesis
from granswim_pymunk.inference.windows.driver import as_filmed
from granswim_pymunk.inference.windows.stamps import in_order, jitter_of, lateness, sighting_noise
from granswim_pymunk.inference.windows.windows import BedPredictor, bed_case
from granswim_pymunk.recording import read_recording

DATA = Path(__file__).parent / "data"
SIZE = 1.2e-4  # s, a sixteenth of a frame


@pytest.fixture(scope="module")
def bed():
    return bed_case(read_recording(DATA / "small_nothing"))


def uneven(film, size=SIZE):
    """The film with frames taken too early or too late, and by how much."""
    shift = in_order(film.t, size * np.random.default_rng(3).normal(size=len(film.t))) - film.t
    velocity = np.gradient(film.xy, film.t, axis=0)
    return replace(film, xy=film.xy + velocity * shift[:, None, None]), shift


def test_lateness_of_frames_is_found_and_put_right(bed):
    even = lateness(bed.film.t, bed.film.xy, bed.film.sigma)
    film, shift = uneven(bed.film)
    found = lateness(film.t, film.xy, film.sigma)
    jitter = jitter_of(found, even)
    assert jitter is not None and jitter.size == pytest.approx(np.std(shift), rel=0.2)
    told = jitter.put_right(film.t, film.xy, film.sigma) - film.t
    inside = slice(3, -3)
    # of five frames a quadratic takes up half of the variance of what is uneven: so much cannot be told
    assert np.std((told - shift)[inside]) < 0.8 * np.std(shift[inside])
    assert np.corrcoef(told[inside], shift[inside])[0, 1] > 0.6
    assert jitter_of(even, found) is None


def test_stamps_keep_their_order():
    t = np.array([0.0, 0.01, 0.02, 0.021])
    assert np.all(np.diff(in_order(t, np.array([1.0, -1.0, 1.0, -1.0]))) > 0)


def test_a_bed_says_that_its_frames_are_uneven_and_its_replicates_are(bed):
    film, _ = uneven(bed.film)
    notes: list[str] = []
    timed = as_filmed(replace(bed, film=film), Hypothesis(), np.zeros(0), notes)
    assert timed.jitter is not None and len(notes) == 1 and "early or late" in notes[0]
    assert np.all(np.diff(timed.film.t) > 0) and not np.array_equal(timed.film.t, film.t)
    own = BedPredictor(timed).replicate(Hypothesis(), np.zeros(0), 0)
    seen = lateness(film.t, own.xy, own.sigma)
    assert seen.size == pytest.approx(np.hypot(timed.jitter.size, timed.jitter.physics), rel=0.3)
    assert not np.array_equal(own.t, film.t)


def test_even_frames_stay_as_they_are(bed):
    notes: list[str] = []
    assert as_filmed(bed, Hypothesis(), np.zeros(0), notes) is bed and not notes
    exact = replace(bed, given=replace(bed.given, time_noise=0.0))
    assert as_filmed(replace(exact, film=uneven(bed.film)[0]), Hypothesis(), np.zeros(0), notes).jitter is None


def test_noise_is_told_by_what_moves_least(bed):
    """What bends paths adds a little, single sightings far off and lost ones do not."""
    film, rng = bed.film, np.random.default_rng(2)
    assert sighting_noise(film.t, film.xy) == pytest.approx(film.sigma, rel=0.2)
    bad = film.xy + np.where(rng.random(film.xy.shape) < 0.005, 40 * film.sigma, 0.0)
    bad[rng.random(bad.shape[:2]) < 0.02] = np.nan
    assert sighting_noise(film.t, bad) == pytest.approx(sighting_noise(film.t, film.xy), rel=0.1)
    assert sighting_noise(film.t[:10], film.xy[:10]) == 0.0


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_noise_that_is_not_as_it_is_said_is_told(factor):
    recording = read_recording(DATA / "small_nothing")
    true, notes = recording.position_noise, list[str]()
    said = bed_case(replace(recording, position_noise=factor * true))
    found = as_filmed(said, Hypothesis(), np.zeros(0), notes)
    assert found.film.sigma == pytest.approx(true, rel=0.25)
    assert any("the noise of a sighting is" in note and "as is said" in note for note in notes)
