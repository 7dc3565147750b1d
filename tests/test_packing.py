"""Beds: as dense as asked for, without overlaps that matter, the same for the same seed."""

import dataclasses
import hashlib
import math

import numpy as np
import pytest

from granswim_pymunk import packing
from granswim_pymunk.engine import Simulation
from granswim_pymunk.errors import InputError
from granswim_pymunk.packing import cache_file, pack, quality
from granswim_pymunk.scene import Bed, Body, Scene, swimmer, use


def bare(fraction=0.80, width=0.03, height=0.02, seed=0, **more):
    return Scene(
        bodies=tuple(swimmer(head=(0.006, height / 2))),
        periodic_x=width,
        bed=Bed(height, fraction, (1e-3, 2e-3), 1004.0),
        seed=seed,
        **more,
    )


def all_overlaps(scene):
    """Overlaps in radii of the smaller disk of every pair that can touch, by brute force."""
    xy = np.array([b.initial[:2] for b in scene.bodies])
    radius = np.array([b.radius for b in scene.bodies])
    role = np.array([b.role for b in scene.bodies])
    i, j = np.triu_indices(len(xy), 1)
    kept = (role[i] == "grain") | (role[j] == "grain")
    i, j = i[kept], j[kept]
    d = xy[j] - xy[i]
    d[:, 0] -= scene.periodic_x * np.round(d[:, 0] / scene.periodic_x)
    return (radius[i] + radius[j] - np.hypot(*d.T)) / np.minimum(radius[i], radius[j])


@pytest.fixture(scope="module")
def bed():
    return pack(bare(), cache=False)


def test_fraction_counts_the_swimmer(bed):
    area = math.pi * sum(b.radius**2 for b in bed.bodies if b.mobile)
    half_a_grain = math.pi * 1e-3**2 / 2
    assert abs(area - 0.80 * 0.03 * 0.02) <= half_a_grain
    assert quality(bed).packing_fraction == pytest.approx(area / (0.03 * 0.02), rel=1e-12)


def test_unjammed_bed_has_no_overlap(bed):
    assert all_overlaps(bed).max() <= 0.0
    assert quality(bed).overlap == 0.0


def test_grains_are_spheres_of_the_given_sizes(bed):
    grains = [b for b in bed.bodies if b.role == "grain"]
    diameter = np.array([2 * b.radius for b in grains])
    assert diameter.min() >= 1e-3 and diameter.max() <= 2e-3
    assert diameter.mean() == pytest.approx(1.5e-3, abs=5 * 1e-3 / math.sqrt(12 * len(grains)))
    for b in grains:
        assert b.mass == pytest.approx(1004 * 4 / 3 * math.pi * b.radius**3, rel=1e-12)
    assert [b.id for b in grains] == [f"g{k}" for k in range(len(grains))]


def test_walls_touch_each_other_and_close_the_box(bed):
    walls = [b for b in bed.bodies if b.role == "wall"]
    assert [b.id for b in walls] == [f"w{k}" for k in range(len(walls))]
    for sign, y in ((-1, 0.0), (1, 0.02)):
        row = [b for b in walls if math.isclose(b.initial[1], y + sign * b.radius)]
        assert len(row) == 20
        x = np.sort([b.initial[0] for b in row])
        assert np.diff(x) == pytest.approx(2 * row[0].radius)
        assert x[0] + 0.03 - x[-1] == pytest.approx(2 * row[0].radius)  # across the seam
    grains = np.array([b.initial[:2] for b in bed.bodies if b.role == "grain"])
    assert grains[:, 1].min() > 0 and grains[:, 1].max() < 0.02
    assert grains[:, 0].min() >= 0 and grains[:, 0].max() < 0.03


def test_swimmer_is_held(bed):
    assert bed.bodies[:7] == bare().bodies


def test_bed_stays_at_rest():
    scene = pack(bare(laws=(use("contact_linear", stiffness=2.2e3, damping=1e4),)), cache=False)
    sim = Simulation(scene, dt=2e-6)
    sim.advance(200)
    assert np.abs(sim.state().v).max() == 0.0


def test_seed_fixes_it_bit_for_bit(bed):
    again, other = pack(bare(), cache=False), pack(bare(seed=1), cache=False)
    assert again.bodies == bed.bodies
    assert again.hash == bed.hash
    assert other.bodies[7].initial != bed.bodies[7].initial


@pytest.mark.parametrize(
    ("fraction", "width", "height", "seed", "known"),
    [
        (0.80, 0.03, 0.02, 0, "9b9a5964c1d5f6b3"),
        (0.84, 0.02, 0.012, 3, "6699758855758d6c"),  # grains change places
        (0.80, 0.009, 0.03, 2, "2f29956f09854d05"),  # too narrow for three columns of cells
    ],
)
def test_beds_stay_what_they_were(fraction, width, height, seed, known):
    """However the working arrays are laid out: what was measured in a bed holds for the bed of its seed."""
    radius, xy = packing._make(bare(fraction, width, height, seed), None)
    assert hashlib.sha256(radius.tobytes() + xy.tobytes()).hexdigest().startswith(known)


@pytest.mark.parametrize("seed", [0, 2])
def test_dense(seed):
    scene = pack(bare(0.84, 0.04, 0.02, seed), cache=False)
    assert quality(scene).packing_fraction == pytest.approx(0.84, abs=0.002)
    assert all_overlaps(scene).max() < 0.02


def test_dense_bed_is_in_equilibrium():
    law = use("contact_linear", stiffness=2.2e3, damping=1e4)
    scene = pack(bare(0.84, 0.04, 0.02, laws=(law,)), cache=False)
    sim = Simulation(scene)
    grains = np.array([b.role == "grain" for b in scene.bodies])
    contacts = sim.contacts()
    assert contacts.force.max() > 0
    # what holds a grain are the contacts; the packing keeps a distance of MARGIN more than they do
    net = np.hypot(*sim.forces()[grains].T)
    assert net.max() < 0.1 * contacts.force.max()


def test_cache(tmp_path, monkeypatch, caplog):
    monkeypatch.setenv("GRANSWIM_CACHE", str(tmp_path))
    scene = bare(0.7, 0.03, 0.01)
    first = pack(scene)
    file = cache_file(scene)
    assert file.is_file() and [p.name for p in file.parent.iterdir()] == [file.name]

    made = []
    make = packing._make
    monkeypatch.setattr(packing, "_make", lambda *a: made.append(1) or make(*a))
    assert pack(scene).bodies == first.bodies
    assert not made, "it was there already"
    assert cache_file(dataclasses.replace(scene, seed=5)) != file

    file.write_bytes(file.read_bytes()[:200])
    assert pack(scene).bodies == first.bodies
    assert len(made) == 1 and "cannot be read" in caplog.text
    np.savez(file, radius=np.ones(3), xy=np.full((3, 2), np.nan))
    assert pack(scene).bodies == first.bodies
    assert len(made) == 2
    assert pack(scene).bodies == first.bodies
    assert len(made) == 2, "the good bed is kept"


def test_a_packed_scene_comes_back(bed):
    assert pack(bed) is bed
    free = Scene(bodies=(Body("a", "free", 1e-3, 1e-3, initial=(0, 0, 0, 0)),))
    assert pack(free) is free


def test_progress_ends_at_one():
    parts = []
    pack(bare(0.7, 0.03, 0.01), cache=False, progress=parts.append)
    assert parts[0] == 0.0 and parts[-1] == 1.0
    assert parts == sorted(parts)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"periodic_x": None}, "periodic_x"),
        ({"bed": Bed(0.02, 0.86, (1e-3, 2e-3), 1004.0)}, "too dense"),
        ({"bed": Bed(0.002, 0.8, (1e-3, 2e-3), 1004.0)}, "narrower"),
        ({"bed": Bed(0.02, 0.05, (1e-3, 2e-3), 1004.0)}, "fill the box"),
        ({"bodies": tuple(swimmer(head=(0.006, 0.03)))}, "not inside the bed"),
        ({"bodies": (Body("w", "wall", 1e-3, 1.0, initial=(0.0, 0.01, 0, 0)),)}, "wall"),
        ({"bodies": (Body("a", "free", 1e-3, 1.0),)}, "place"),
    ],
)
def test_beds_that_cannot_be_made(change, words):
    with pytest.raises(InputError, match=words):
        pack(dataclasses.replace(bare(), **change), cache=False)
