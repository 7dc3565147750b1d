"""A lens that bends the picture: as a camera shows it, and as the diagnosis finds it."""

import numpy as np
import pytest

import granswim_pymunk as gs
from granswim_pymunk.errors import InputError
from granswim_pymunk.recording import film, see
from granswim_pymunk.recording.camera import bent
from granswim_pymunk.scene import Body, Scene, read_scene


def sliding(*laws):
    """Three disks that slide across each other's ways and do not meet."""
    starts = ((0.0, 0.0, 0.35, 0.2), (0.35, 0.05, -0.3, 0.25), (0.1, 0.3, 0.2, -0.3))
    bodies = tuple(Body(name, "free", 0.01, 0.02, initial=start) for name, start in zip("abc", starts, strict=True))
    return Scene(bodies, laws)


def test_as_the_contract_says():
    """seen = o + (true - o)(1 + k |true - o|^2): along a ray from o, with the cube of the distance."""
    o, k = np.array([0.1, -0.2]), 0.3
    ray = np.array([0.6, 0.8])
    away = np.linspace(0.0, 2.0, 9)
    seen = see(o + away[:, None] * ray, distortion=k, middle=o)
    np.testing.assert_allclose(seen, o + (away + k * away**3)[:, None] * ray, atol=1e-14)
    np.testing.assert_array_equal(see(o[None], distortion=k, middle=o), o[None])
    both = see(o + ray, distortion=k, middle=o, scale=2.0, bias=(1.0, 0.0))
    np.testing.assert_allclose(both, 2 * (o + 1.3 * ray) + [1.0, 0.0])


def test_film_through_a_lens():
    scene, t = sliding(), np.arange(0.0, 0.5, 0.01)
    true = film(scene, t).xy
    about_mean = film(scene, t, distortion=0.2)
    np.testing.assert_allclose(
        about_mean.xy, see(true, distortion=0.2, middle=true.reshape(-1, 2).mean(axis=0)), atol=1e-12
    )
    told = film(scene, t, distortion=0.2, middle=(0.1, 0.1))
    np.testing.assert_allclose(told.xy, see(true, distortion=0.2, middle=(0.1, 0.1)), atol=1e-12)
    folded = Scene(scene.bodies, (), periodic_x=1.0)
    with pytest.raises(InputError, match="lens"):
        film(folded, t, distortion=0.2)


@pytest.mark.deep
def test_lens_is_named(tmp_path):
    """Straight ways that look bent: the lens, how strong it is and about which place, and not a force."""
    scene = sliding()
    seen = film(
        scene, np.arange(0.0, 0.8, 0.01), rng=np.random.default_rng(4), noise=2e-5, distortion=0.15, middle=(0.1, 0.12)
    )
    result = gs.diagnose(seen, out=tmp_path / "out", seed=1)
    verdict = result.verdict
    assert verdict["verdict"] == "measurement"
    (entry,) = verdict["mechanisms"]
    assert entry["name"] == "lens_distortion"
    k, o = entry["parameters"]["k"], entry["parameters"]["o"]
    assert k["unit"] == "1/m^2" and o["unit"] == "m"
    width = k["high"] - k["low"]
    assert k["low"] - width / 2 < 0.15 < k["high"] + width / 2 and width < 0.05
    np.testing.assert_allclose(o["value"], (0.1, 0.12), atol=0.02)
    camera = read_scene(tmp_path / "out" / "revised.toml").camera
    assert camera["distortion"] == k["value"] and camera["middle"] == o["value"]
    assert "lens" in (tmp_path / "out" / "report.html").read_text()


def test_no_lens_turns_the_picture_back():
    """What is farther away is never seen nearer to the middle, however strong a lens is sought."""
    k, far = -2.0, np.linspace(0.0, 3.0, 301)[:, None] * [0.6, 0.8]
    middle = np.array([0.1, 0.2])
    seen = np.hypot(*(bent(far + middle, k, tuple(middle)) - middle).T)
    rim = 1 / np.sqrt(6.0)
    assert (np.diff(seen) >= -1e-15).all() and seen[-1] == pytest.approx(2 * rim / 3)
    near = np.linspace(0.0, 0.99 * rim, 50)
    np.testing.assert_allclose(bent(near[:, None] * [1.0, 0.0], k, (0, 0))[:, 0], near * (1 + k * near**2), atol=1e-15)
