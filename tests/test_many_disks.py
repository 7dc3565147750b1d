"""Twelve disks in a box: a scene that is caught at an impact is fitted from the tracks again."""

from __future__ import annotations

import numpy as np

from granswim_pymunk.inference.tracks.study import calibrated, study_of
from granswim_pymunk.recording import Recording, read_recording, write_recording
from granswim_pymunk.scene import Body, Scene, use
from granswim_pymunk.validation.hard_disks import Impacts, Physics, Table, run

COUNT, SIDE, RADIUS, MASS, NOISE = 12, 0.4, 0.015, 0.018, 3e-4  # -, m, m, kg, m


def test_recalibration_gets_free_of_where_the_scene_was_caught(tmp_path):
    """Restitution 0.75 for 0.95: with loose joints every scene follows, and the first fit of the naive one did not."""
    rng, places = np.random.default_rng(1), list[np.ndarray]()
    while len(places) < COUNT:
        place = rng.uniform(-SIDE / 2 + 0.025, SIDE / 2 - 0.025, 2)
        if all(np.hypot(*(place - other)) > 0.04 for other in places):
            places.append(place)
    start = np.concatenate([np.round(places, 4), rng.normal(size=(COUNT, 2)) * 0.35], 1)
    corners = [(-SIDE / 2, -SIDE / 2), (SIDE / 2, -SIDE / 2), (SIDE / 2, SIDE / 2), (-SIDE / 2, SIDE / 2)]
    walls = tuple(zip(corners, [*corners[1:], corners[0]], strict=True))
    t = np.arange(360) / 240
    table = Table(np.full(COUNT, RADIUS), np.full(COUNT, MASS), np.zeros(COUNT, bool), walls)
    flight = run(table, Physics(restitution=0.75), start, t, Impacts(), rng)
    assert len(flight.touches) > 30
    ids = tuple(f"d{k}" for k in range(COUNT))
    scene = Scene(tuple(Body(b, "free", RADIUS, MASS) for b in ids), (use("contact_elastic", restitution=0.95),))
    xy = np.round(flight.xy + NOISE * rng.normal(size=flight.xy.shape), 7)
    made = Recording("disks", scene, np.round(t, 7), ids, xy, sampling=240.0, position_noise=NOISE)
    folder = write_recording(made, tmp_path / "disks")
    with (folder / "recording.toml").open("a") as file:
        for a, b in walls:
            file.write(f"\n[[wall]]\nfrom = {list(a)}\nto = {list(b)}\n")
    study = study_of([read_recording(folder)], [], np.random.default_rng(0), lambda *a: None, lambda share: False)
    naive, recalibrated = calibrated(study)  # the first fits of this study: later ones begin where these ended
    assert naive.chi2 < 2 * naive.count and recalibrated.chi2 < 2 * recalibrated.count
