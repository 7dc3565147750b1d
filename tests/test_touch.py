"""How far from each other bodies turn away, and what their radii say of that."""

from __future__ import annotations

import numpy as np
import pytest

from granswim_pymunk import Body, Scene, make_recording, use
from granswim_pymunk.inference.data import prepare_all
from granswim_pymunk.inference.tracks.touch import away_from_radii, nearer_than_radii

RADIUS, NOISE = 0.03, 1e-4


def two_pucks(restitution=0.9, offset=0.02, rate=120.0, noise=NOISE, seconds=0.5):
    """Places (T, 2, 2) of two equal pucks: the first comes at 0.8 m/s, ``offset`` off the centre of the second."""
    t = np.arange(0.0, seconds, 1 / rate)
    speed, start = np.array([0.8, 0.0]), np.array([-0.22, offset])
    # |start + speed t| = 2 r
    met = (0.22 - np.sqrt(max(4 * RADIUS**2 - offset**2, 0.0))) / speed[0]
    normal = -(start + speed * met) / (2 * RADIUS)
    impulse = 0.5 * (1 + restitution) * (speed @ normal) * normal
    after = np.maximum(t - met, 0.0)[:, None]
    xy = np.stack([start + speed * t[:, None] - impulse * after, impulse * after], axis=1)
    return t, xy + np.random.default_rng(4).normal(0.0, noise, xy.shape)


def case_of(t, xy, radius, laws, noise=NOISE):
    bodies = tuple(Body(b, "free", radius, 0.05) for b in "ab")
    recording = make_recording(t, xy, names=["a", "b"], scene=Scene(bodies, laws), position_noise=noise)
    (case,) = prepare_all([recording])
    return case


BOUNCE = (use("contact_elastic", restitution=1.0),)


@pytest.mark.parametrize("offset", [0.0, 0.02, 0.035])
@pytest.mark.parametrize(("share", "says"), [(1.0, False), (1.004, False), (1.04, True), (0.96, True)])
def test_pucks_whose_radii_are_off_are_told_by_where_they_turn_away(offset, share, says):
    case = case_of(*two_pucks(offset=offset), share * RADIUS, BOUNCE)
    notes = away_from_radii(case)
    assert len(notes) == says
    if says:
        seen, believed = (float(part.split()[-1]) for part in notes[0].replace(" mm", "@").split("@")[:2])
        assert believed == pytest.approx(2000 * share * RADIUS, rel=1e-3)
        assert seen == pytest.approx(2000 * RADIUS, rel=0.01)


def test_what_does_not_meet_or_turns_away_before_is_not_told():
    t, xy = two_pucks()
    assert not away_from_radii(case_of(t, xy, 1.04 * RADIUS, ()))  # no law says that they meet
    repelled = (*BOUNCE, use("distance_force", s=1e-4, n=2.0))
    assert not away_from_radii(case_of(t, xy, 1.04 * RADIUS, repelled))
    assert not away_from_radii(case_of(*two_pucks(seconds=0.2), 1.04 * RADIUS, BOUNCE))  # has not met yet


@pytest.mark.parametrize(("share", "says"), [(1.0, False), (1.05, False), (1.3, True)])
def test_centres_that_come_much_nearer_than_radii_allow_are_told(share, says):
    notes = nearer_than_radii(case_of(*two_pucks(), share * RADIUS, ()))
    assert len(notes) == says
    if says:
        assert "a and b come as near as 6" in notes[0] and "their radii make 78 mm" in notes[0]


def test_a_track_that_goes_over_to_another_body_is_no_impact():
    t, xy = two_pucks()
    xy[40:, 1] = xy[40:, 0]
    case = case_of(t, xy, RADIUS, BOUNCE)
    assert not away_from_radii(case) and "come as near as 0 mm" in nearer_than_radii(case)[0]


def test_a_rest_of_magnets_is_no_impact():
    """Two gliders that repel each other turn within many frames, wherever their ends are."""
    t = np.arange(0.0, 2.0, 1 / 100)
    apart = np.sqrt(0.065**2 + (0.2 * (t - 1.0)) ** 2)
    xy = np.zeros((len(t), 2, 2))
    xy[:, 0, 0], xy[:, 1, 0] = -apart / 2, apart / 2
    xy += np.random.default_rng(1).normal(0.0, NOISE, xy.shape)
    assert not away_from_radii(case_of(t, xy, RADIUS, BOUNCE))
