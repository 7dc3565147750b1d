"""What is said of many grains at once, and where innovations of them are beyond chance."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from granswim_pymunk.inference.criteria import current
from granswim_pymunk.inference.windows.places import Map, _of_one, locate_law
from granswim_pymunk.inference.windows.sums import MOMENTS, Sums, size_of, sums_of

SIGMA = 2.0e-5
AT = {name: k for k, name in enumerate(MOMENTS)}


def scattered(rng: np.random.Generator, grains: int = 60, disks: int = 3) -> Sums:
    """Grains about a short swimmer, half of them near, moving at random."""
    place = rng.uniform(-0.01, 0.01, (grains, 2))
    angle = rng.uniform(0, 2 * np.pi, grains)
    along = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    near = np.arange(grains) % 2 == 0
    speed = rng.uniform(0.01, 0.1, grains)
    return Sums(
        place, along, speed, speed > 0.02, near, rng.integers(0, disks, grains), disks, place, np.ones((2, grains))
    )


def parts(row: np.ndarray, disks: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """Moments (2, m) of near and far grains; means (2, disks, 2) about each disk."""
    moments, cells = np.split(row, [2 * len(MOMENTS)])
    return moments.reshape(2, len(MOMENTS)), cells.reshape(2, disks, 2)


def test_grains_that_all_move_alike_move_so_in_every_mean():
    sums = scattered(np.random.default_rng(1))
    moved = np.tile([3e-5, -1e-5], (2, 60, 1))
    rows = sums.of(moved)
    assert rows.shape == (2, size_of(3)) and sums.size == size_of(3)
    moments, cells = parts(rows[0])
    assert moments[:, AT["mean dx"]] == pytest.approx(3e-5) and moments[:, AT["mean dy"]] == pytest.approx(-1e-5)
    assert cells.reshape(-1, 2) == pytest.approx(np.tile([3e-5, -1e-5], (6, 1)))
    assert moments[:, AT["spread"]] == pytest.approx(0.0, abs=1e-12)


def test_a_drag_shows_along_the_motion_and_a_turn_across_it():
    sums = scattered(np.random.default_rng(2))
    back = -1e-3 * sums.speed[:, None] * sums.along
    side = 1e-3 * sums.speed[:, None] * np.stack([-sums.along[:, 1], sums.along[:, 0]], axis=1)
    dragged, turned = (parts(sums.of(np.stack([d, d]))[0])[0] for d in (back, side))
    fast = np.array([np.sum(sums.speed[g] ** 2) / np.sum(sums.speed[g]) for g in (sums.near, ~sums.near)])
    assert dragged[:, AT["along"]] == pytest.approx(-1e-3 * fast)
    assert dragged[:, AT["across"]] == pytest.approx(0.0, abs=1e-12)
    assert turned[:, AT["across"]] == pytest.approx(1e-3 * fast)
    assert turned[:, AT["along"]] == pytest.approx(0.0, abs=1e-12)


def test_what_members_do_not_agree_on_counts_little():
    """One grain in five is thrown about; the weighted mean is about as sure as the mean of the others."""
    rng = np.random.default_rng(3)
    sums = scattered(rng)
    scatter = np.where(np.arange(60) % 10 < 2, 100.0, 1.0)[None, None, :, None] * SIGMA
    q = sums.sure(scatter * rng.normal(size=(200, 2, 60, 2)), SIGMA)
    assert q.shape == (2, 60) and q.max() <= 1 / (2 * SIGMA) ** 2
    weighed = replace(sums, q=q)
    films = scatter * rng.normal(size=(300, 2, 60, 2))

    def spread(of: Sums) -> float:
        return float(np.std([parts(of.of(f)[0])[0][:, AT["mean dx"]] for f in films]))

    assert spread(weighed) < 1.1 * SIGMA / np.sqrt(24)
    assert spread(sums) > 5 * spread(weighed)


def test_too_few_grains_say_nothing():
    sums = scattered(np.random.default_rng(4))
    moved = np.full((2, 60, 2), np.nan)
    seen = np.flatnonzero(sums.near)[:2]
    moved[:, seen] = 1e-5
    moments, cells = parts(sums.of(moved)[0])
    assert np.isnan(moments).all()
    two_about_one = sums.disk[seen[0]] == sums.disk[seen[1]]
    assert np.isfinite(cells).sum() == (2 if two_about_one else 0)


def test_grains_are_near_across_the_ends_of_a_periodic_bed():
    period, radius = 0.1, 1.5e-3
    grains = np.array([[0.0995, 0.01], [0.05, 0.01], [np.nan, np.nan]])
    mean = np.zeros((4, 2, 2))
    mean[0, 0] = [0.001 + 3 * period, 0.01]  # the disk has gone round three times
    mean[1:3, 0] = grains[:2]
    mean[1:, 1] = [0.01, 0.0]
    posterior = SimpleNamespace(mean=mean, root=np.full((4, 2, 2), 1e-4))
    seen = np.array([True, True, True, False])
    args = seen, np.array([0]), np.array([1, 2, 3]), np.full(4, radius)
    around, open_ended = sums_of(posterior, *args, period), sums_of(posterior, *args, 0.0)  # type: ignore[arg-type]
    assert around.near.tolist() == [True, False, False]
    assert not open_ended.near.any()
    assert np.isnan(around.start[2]).all() and around.place[0, 0] == pytest.approx(-0.0015)


def test_places_among_grains_do_not_stand_out_by_chance_though_some_are_thrown_far():
    """Squares with the tails of a few violent grains: replicates tell how much chance there is in them."""
    criteria = current().windows.places
    rng = np.random.default_rng(5)
    replicates, windows, disks = 8, 26, 7
    bodies = [SimpleNamespace(id=str(k)) for k in range(disks)]
    bed = SimpleNamespace(
        scene=SimpleNamespace(bodies=bodies), rows=np.arange(disks), grains=np.arange(9), phases=lambda: None,
        times=np.arange(windows) * 0.016, span=0.016,
    )  # fmt: skip

    def heavy(*shape: int) -> np.ndarray:
        return np.minimum(rng.standard_t(4.0, (*shape, 2, 2)) ** 2 / 2, criteria.farthest**2).mean(axis=(-2, -1))

    alarms = 0
    for _ in range(60):
        found = Map(
            bed, rng.chisquare(6, (windows, disks)) / 6, heavy(windows, 2), heavy(windows, disks),  # type: ignore[arg-type]
            rng.chisquare(6, (replicates, windows, disks)) / 6, heavy(replicates, windows, 2), heavy(replicates,
            windows, disks),
            rng.uniform(0.01, 0.1, windows),
        )  # fmt: skip
        looked = _of_one(found, np.arange(windows))
        among = [p for place, p in looked if place.region and "grains" in place.region]
        assert len(among) == 2 + disks
        alarms += min(among) * len(among) < 0.01
    assert alarms <= 3


def test_a_law_is_placed_where_it_shows_and_nowhere_else():
    """Seven disks and grains near and far; a law that moves the last disk and the grains near it a little."""
    rng = np.random.default_rng(6)
    windows, disks, looks = 20, 7, 3
    ids = [SimpleNamespace(id=str(k)) for k in range(disks)]
    size = 2 * disks * looks + (looks - 1) * size_of(disks)
    bed = SimpleNamespace(
        scene=SimpleNamespace(bodies=ids), rows=np.arange(disks), grains=np.arange(9), looks=np.arange(looks),
        swimmer_size=2 * disks * looks, size=size, phases=lambda: np.linspace(0, 4, windows, endpoint=False) % 1.0,
    )  # fmt: skip
    change = np.zeros((windows, size))
    change[:, 2 * disks * (looks - 1) + 12] = 1.5  # x of the last disk, at the last look
    change[:, bed.swimmer_size + 2 * len(MOMENTS) + 12] = 1.2  # of the near grains about it, at the first
    used = [np.arange(windows)]
    noise = rng.normal(size=(30, windows * size))
    tops = []
    for k in range(30):
        found = locate_law([bed], used, change.ravel(), change.ravel() + noise[k], {"6"})  # type: ignore[list-item]
        first = [(q.bodies, q.region) for q in found if q.phase is None]
        assert set(first) <= {(("6",), "tail"), ((), "grains within two diameters of the swimmer")}
        assert all(q.z > 2.32 and q.p < 0.01 for q in found)  # one and the same
        assert all(q.bodies == ("6",) and q.region == "swimmer" for q in found if q.phase is not None)
        tops.append(len(first))
    assert np.mean(tops) > 1.8
    nothing = [locate_law([bed], used, change.ravel(), n, ()) for n in noise]  # type: ignore[list-item]
    assert sum(map(bool, nothing)) <= 2
