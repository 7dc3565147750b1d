"""Bodies that turn about their own centres, by angles over many turns, and clocks that were read at even stations."""

import numpy as np
import pytest

from granswim_pymunk.errors import InputError
from granswim_pymunk.inference import diagnose
from granswim_pymunk.inference.data import estimate_noise, prepare
from granswim_pymunk.inference.hypothesis import _often_enough
from granswim_pymunk.recording import Recording, grid
from granswim_pymunk.recording.importers import import_recording
from granswim_pymunk.recording.importers.look import look, noise_of, told
from granswim_pymunk.recording.turns import continuous
from granswim_pymunk.scene import Body, Scene, use

RATE = 0.03  # 1/s, of the drag in the bearing over the moment of inertia
TURNING = 4.4  # rad/s, at first


def half_turns(n=40, noise=1e-3):
    """When a rod that coasts passes each half turn: theta = (w/k) (1 - exp(-k t)), off by noise of the clock."""
    angle = np.pi * np.arange(n)
    t = -np.log(1 - angle * RATE / TURNING) / RATE
    return np.round(t + noise * np.random.default_rng(1).standard_normal(n), 4), angle


def table(tmp_path, t, angle):
    path = tmp_path / "coasting.csv"
    path.write_text("t,angle\n" + "".join(f"{a},{b}\n" for a, b in zip(t, angle, strict=True)))
    return path


def test_what_counts_its_turns_is_left_as_it_is():
    _, angle = half_turns()
    assert np.array_equal(continuous(angle), angle)
    fine = np.linspace(0, 30, 400)
    within = (fine + np.pi) % (2 * np.pi) - np.pi
    assert np.allclose(continuous(within), fine)
    assert len(continuous(np.zeros(0))) == 0


def test_stations_are_no_rounding():
    """A runner's splits at each ten metres: the noise is that of the clock at 12 m/s, not 10 m over root twelve."""
    rng = np.random.default_rng(2)
    place = np.arange(0, 110, 10.0)
    t = np.sort(place / 11 + 0.1 * place**0.5 + 0.01 * rng.standard_normal(len(place)))
    assert grid.stations(t, place) and not grid.stations(np.arange(11.0), place)
    assert estimate_noise(t, place) < 0.3
    rounded = np.round(np.cumsum(rng.uniform(0.3, 3.0, 60)))
    assert not grid.stations(np.sort(rng.uniform(0, 6, 60)), rounded)


def test_noise_at_uneven_times():
    """Cubes of the time have third divided differences that are constant, however uneven the times are."""
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.uniform(0.2, 2.0, 300))
    values = 1e-3 * t**2 + 0.05 * rng.standard_normal(len(t))
    assert noise_of(values, t) == pytest.approx(0.05, rel=0.2)
    even = np.arange(300.0)
    values = 1e-3 * even**2 + 0.05 * rng.standard_normal(300)
    assert noise_of(values, even) == pytest.approx(noise_of(values), rel=1e-9)


def test_a_wheel_has_the_inertia_of_a_disk_or_the_one_that_is_said(tmp_path):
    path = table(tmp_path, *half_turns())
    plain = import_recording(path, bodies=["wheel:10cm:250g"], scene="wheel")[0]
    (pin,) = plain.scene.laws_named("pin")
    assert pin.values["length"] == pytest.approx(0.1 / np.sqrt(2), rel=1e-4) and plain.scene.gravity == (0.0, 0.0)
    said = import_recording(path, bodies=["wheel:10cm:250g"], scene="wheel", laws=["pin:wheel,length=0.058"])[0]
    assert said.scene.laws_named("pin")[0].values["length"] == 0.058


def test_a_hinge_at_the_centre_is_refused_with_what_to_do():
    t, angle = half_turns()
    hinge = use("hinge", bodies=["rod"], anchor_a=(0.0, 0.0), anchor_b=(0.0, 0.0), anchor=(0.0, 0.0))
    scene = Scene(bodies=(Body("rod", "free", 0.1, 0.25),), laws=(hinge,))
    nowhere = np.full((len(t), 1, 2), np.nan)
    film = Recording(scene=scene, t=t, xy=nowhere, ids=("rod",), angle=angle[:, None], name="rod")
    with pytest.raises(InputError, match="--scene wheel"):
        prepare(film, held_out=False, split=True)


@pytest.mark.deep
def test_the_bearing_of_a_rod_that_was_seen_each_half_turn_drags(tmp_path):
    """Half a turn between two sightings is as far one way as the other: neither file nor simulation turns it back."""
    (film,) = import_recording(table(tmp_path, *half_turns()), bodies=["rod:10cm:250g"], scene="wheel")
    found = diagnose([film])
    verdict = found.verdict
    assert [m["name"] for m in verdict["mechanisms"]] == ["joint_drag"]
    c = verdict["mechanisms"][0]["parameters"]["c"]
    inertia = 0.25 * film.scene.laws_named("pin")[0].values["length"] ** 2
    assert c["low"] <= RATE * inertia <= c["high"]
    assert c["value"] == pytest.approx(RATE * inertia, rel=0.05)


def test_noise_of_arithmetic_is_no_sensors():
    """Speeds that a log holds for many rows, summed up, lie on straight lines."""
    t = np.arange(200) * 0.005
    speed = np.repeat(np.sqrt(np.arange(10)), 20) * 0.1
    scene = Scene(bodies=(Body("wheel", "free", 0.02, 0.1),))
    for noise, said in ((0.0, True), (1e-5, False)):
        x = np.cumsum(speed) * 0.005 + noise * np.random.default_rng(1).standard_normal(200)
        film = Recording(scene=scene, t=t, xy=np.stack([x, 0 * x], axis=-1)[:, None], ids=("wheel",), name="sums")
        assert any("that of arithmetic" in line for line in told(film, look(film))) == said


def test_one_wrong_angle_makes_no_run_long():
    t, angle = half_turns()
    angle[20] = 1e12
    pin = use("pin", bodies=["rod"], anchor=(0.0, 0.0), length=0.1)
    scene = Scene(bodies=(Body("rod", "free", 0.1, 0.25),), laws=(pin,))
    nowhere = np.full((len(t), 1, 2), np.nan)
    film = Recording(scene=scene, t=t, xy=nowhere, ids=("rod",), angle=angle[:, None], name="rod")
    case = prepare(film, held_out=False, split=True)
    assert case.turning < 10
    times, at = _often_enough(t, 1e15)
    assert len(times) == 39 * 64 + 1 and np.allclose(times[at], t)


def test_a_scene_that_is_none_is_told_what_there_is(tmp_path):
    with pytest.raises(InputError, match=r"wheal is no file, and none of pendulum, wheel, puck"):
        import_recording(table(tmp_path, *half_turns()), bodies=["rod:10cm:250g"], scene="wheal")
