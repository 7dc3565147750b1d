"""A blow in a film of few sightings."""

import numpy as np

from granswim_pymunk.inference.data import prepare
from granswim_pymunk.inference.tracks.kicks import told_of_few
from granswim_pymunk.recording import Recording
from granswim_pymunk.scene import Body, Scene


def notes(t: np.ndarray, x: np.ndarray, rng: np.random.Generator) -> list[str]:
    xy = np.stack([x, 0.0 * x], axis=1) + 5e-4 * rng.normal(size=(len(t), 2))
    film = Recording("ball", Scene((Body("ball", "free", 0.01, 0.02),), ()), t, ("ball",), xy[:, None], sampling=3.0)
    return told_of_few(prepare(film, held_out=False, split=True))


def test_two_even_motions_in_few_sightings_are_told_as_a_blow():
    """A ball rolls on, strikes what is not in the film, slides and rolls on with two sevenths of its speed."""
    t = np.array([0.0, 0.2, 0.6, 0.9, 1.3, 1.64, 2.34, 2.86, 3.38, 4.0, 4.62, 5.26, 5.6, 6.12, 6.5, 6.9, 7.16])
    for seed in range(10):
        rng = np.random.default_rng(seed)
        (note,) = notes(t, np.where(t < 2.0, 0.057 * t, 0.057 + 0.0172 * t), rng)
        assert "until t = 1.64 s" in note and "from t = 2.34 s on" in note
        for rate in (0.0, 0.2, 0.6, 1.5):
            assert not notes(t, 0.057 * t if not rate else 0.057 / rate * (1 - np.exp(-rate * t)), rng)
        assert not notes(t, 0.057 * t - 0.004 * t**2, rng) and not notes(t, 0.05 * np.sin(2 * t), rng)
