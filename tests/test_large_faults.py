"""Faults of the picture that no laboratory has, and noise that a grid hides."""

from types import SimpleNamespace

import numpy as np
import pytest

from granswim_pymunk.inference.data import prepare
from granswim_pymunk.inference.judge import paired
from granswim_pymunk.inference.model import HeldOut
from granswim_pymunk.inference.pipeline import _as_far_off
from granswim_pymunk.inference.tracks import choose
from granswim_pymunk.recording import Recording
from granswim_pymunk.scene import Body, Scene, use


def trial(name, excess, large=False):
    return SimpleNamespace(name=name, fit=SimpleNamespace(excess=excess), apparatus=large, large=large)


@pytest.mark.parametrize(
    ("excess", "kept"), [(30.0, ["drag"]), (12.0, ["drag", "turned"])], ids=["no better", "takes most of it away"]
)
def test_a_fault_larger_than_any_has_to_remove_most_of_what_others_leave(excess, kept, monkeypatch):
    """A track that is no circle was a camera that hangs askew by 25 degrees, with 29 times the noise left."""
    monkeypatch.setattr(choose, "extraordinary", lambda t: t.large)
    near = [trial("drag", 31.0), trial("turned", excess, large=True)]
    assert [t.name for t in choose._without_large_faults(near)] == kept
    alone = [trial("turned", 31.0, large=True)]
    assert choose._without_large_faults(alone) == alone


def test_an_encoder_at_rest_shows_no_noise_and_its_clock_is_not_blamed():
    """What rests on a grid tells one number again and again: the noise is that of rounding, in motion as at rest."""
    t = np.arange(140) * 0.005
    s = np.maximum(t - 0.165, 0.0)
    x = np.round(2.0 * (s - 0.09 * (1 - np.exp(-s / 0.09))), 3)
    rail = use("rail", bodies=["cart"], direction=(1.0, 0.0))
    scene = Scene((Body("cart", "free", 0.02, 0.1),), (rail,))
    xy = np.stack([x, np.zeros(140)], axis=-1)[:, None]
    film = Recording(name="m", scene=scene, t=t, ids=("cart",), xy=xy, sampling=200.0)
    case = prepare(film, held_out=False, split=True)
    assert case.late is None
    assert case.sigma.min() == pytest.approx(1e-3 / np.sqrt(12), rel=0.05)


def test_errors_that_are_one_in_two_digits_tell_no_law_from_another():
    def held(error):
        return HeldOut({}, {"revised": error}, "holds", 1.0, None)

    assert _as_far_off(held(0.00467), held(0.00475)) and not _as_far_off(held(0.0040), held(0.00475))
    assert not _as_far_off(held(None), held(0.1))


def test_held_out_data_that_change_by_nothing_decide_nothing():
    """Of bodies that do not meet there a law of contact changes rounding, each frame the same way."""
    before = [np.full(5, 30.0) for _ in range(8)]
    rng = np.random.default_rng(0)
    assert paired(before, [b - 1e-9 for b in before], rng) == "undecided"
    assert paired(before, [b - 0.1 for b in before], rng) == "holds"
    assert paired(before, [b + 0.1 for b in before], rng) == "fails"
