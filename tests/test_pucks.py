"""Hard disks from event to event, and the films of pucks drawn with them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from granswim_pymunk.proof.world import Effect, World
from granswim_pymunk.recording import read_recording
from granswim_pymunk.scene import Body, Scene, use
from granswim_pymunk.validation import pucks
from granswim_pymunk.validation.hard_disks import Impacts, Physics, Table, run

RADIUS = np.array([0.03, 0.025, 0.02, 0.03])
MASS = np.array([0.06, 0.05, 0.03, 0.05])
START = np.array([[-0.3, 0, 0.6, 0.05], [0.3, 0.02, -0.5, 0], [0, 0.2, 0.1, -0.6], [0, -0.15, 0.2, 0.7]])
BOX = (((-0.4, -0.3), (0.4, -0.3)), ((0.4, -0.3), (0.4, 0.3)), ((0.4, 0.3), (-0.4, 0.3)), ((-0.4, 0.3), (-0.4, -0.3)))
TIMES = np.arange(0, 1.2, 1 / 240)
FREE = Table(RADIUS, MASS, np.zeros(4, bool))


def energy(flight, table=FREE) -> np.ndarray:
    """Kinetic energy of places and spins over time."""
    return 0.5 * (table.mass * (flight.v**2).sum(-1) + table.inertia * flight.spin**2).sum(1)


def repulsive_energy(xy: np.ndarray, s: float, n: float, r_0: float) -> np.ndarray:
    i, j = np.triu_indices(xy.shape[1], 1)
    d = np.hypot(*np.moveaxis(xy[:, i] - xy[:, j], -1, 0))
    return (s * r_0 / (n - 1) * (r_0 / d) ** (n - 1)).sum(1)


class TestHardDisks:
    def test_two_disks_bounce_by_newtons_law(self) -> None:
        table = Table(np.array([0.02, 0.03]), np.array([0.1, 0.3]), np.zeros(2, bool))
        start = np.array([[0.0, 0.0, 1.0, 0.0], [0.25, 0.0, 0.0, 0.0]])
        flight = run(table, Physics(restitution=0.6), start, [0.0, 0.5])
        centre = 0.1 * 1.0 / 0.4
        after = [centre - 0.6 * 0.75, centre + 0.6 * 0.25]  # in the centre's frame they turn by -e
        assert flight.v[-1, :, 0] == pytest.approx(after)
        assert flight.xy[-1, :, 0] == pytest.approx([0.2 + 0.3 * after[0], 0.25 + 0.3 * after[1]])
        assert [touch[:3] for touch in flight.touches] == [pytest.approx((0.2, 0, 1))]

    def test_energy_and_momentum_are_kept(self) -> None:
        flight = run(replace(FREE, walls=BOX), Physics(), START, TIMES)
        assert len(flight.touches) >= 5
        assert energy(flight) == pytest.approx(energy(flight)[0])
        flight = run(FREE, Physics(restitution=0.7, contact_friction=0.3), START, TIMES)
        assert len(flight.touches) >= 2 and energy(flight)[-1] < 0.99 * energy(flight)[0]
        momentum = (MASS[:, None] * flight.v).sum(1)
        assert momentum == pytest.approx(np.broadcast_to(momentum[0], momentum.shape))
        turning = (MASS * (flight.xy[..., 0] * flight.v[..., 1] - flight.xy[..., 1] * flight.v[..., 0])).sum(1)
        turning = turning + (FREE.inertia * flight.spin).sum(1)
        assert turning == pytest.approx(np.full(len(turning), turning[0]), rel=1e-9)

    def test_repulsion_keeps_energy(self) -> None:
        law = (0.03, 3.0, 0.03)
        flight = run(FREE, Physics(repulsion=law), START, TIMES)
        whole = energy(flight) + repulsive_energy(flight.xy, *law)
        assert len(flight.touches) >= 2
        assert whole == pytest.approx(np.full(len(whole), whole[0]), rel=1e-8)

    def test_substrate_stops_a_disk_where_it_should(self) -> None:
        start = START.copy()
        start[0] = [-0.3, 0.0, -0.6, 0.0]
        flight = run(FREE, Physics(substrate=0.05), start, [0.0, 3.0])
        assert flight.xy[-1, 0] == pytest.approx([-0.3 - 0.36 / (2 * 0.05 * 9.81), 0.0])
        assert np.all(flight.v[-1] == 0)

    @pytest.mark.parametrize(
        ("physics", "effect"),
        [
            (Physics(0.8), None),
            (Physics(0.8, drag=0.02), Effect("linear_drag", {"c": 0.02, "p": 0})),
            (Physics(0.8, contact_friction=0.25), Effect("contact_friction", {"mu": 0.25})),
            (Physics(0.8, repulsion=(0.05, 3.0, 0.02625)), Effect("distance_force", {"s": 0.05, "n": 3.0})),
        ],
    )
    def test_agrees_with_the_proofs_simulator(self, physics: Physics, effect: Effect | None) -> None:
        """Two codes that share nothing; the other one's collisions in the field of a force are of its step's order."""
        drawn = zip("abcd", RADIUS, MASS, START, strict=True)
        bodies = tuple(Body(name, "free", r, m, initial=tuple(s)) for name, r, m, s in drawn)
        scene = Scene(bodies, (use("contact_elastic", restitution=0.8),))
        flight = run(FREE, physics, START, TIMES)
        assert len(flight.touches) >= 2
        effects = [] if effect is None else [effect]
        errors = [np.abs(flight.xy - World(scene, effects, dt).sample(TIMES, t0=0.0).xy).max() for dt in (4e-5, 1e-6)]
        exact = effect is None or effect.name == "contact_friction"
        assert errors[1] < (1e-9 if exact else 1e-6)
        assert exact or errors[1] < 0.4 * errors[0]

    @pytest.mark.parametrize("impacts", [Impacts(late=2e-4), Impacts(lasting=4e-4)])
    def test_real_impacts_are_a_little_late(self, impacts: Impacts) -> None:
        ideal = run(FREE, Physics(0.9), START, TIMES)
        real = run(FREE, Physics(0.9), START, TIMES, impacts, np.random.default_rng(1))
        assert [t[1:3] for t in real.touches[:2]] == [t[1:3] for t in ideal.touches[:2]]
        first = np.searchsorted(TIMES, ideal.touches[0][0]) + 1
        pair = list(ideal.touches[0][1:3])
        assert 1e-7 < np.abs(real.xy - ideal.xy)[first, pair].max() < 4e-4
        assert np.array_equal(real.xy[: first - 1], ideal.xy[: first - 1])
        momentum = (MASS[:, None] * real.v[-1]).sum(0)
        assert momentum == pytest.approx((MASS[:, None] * START[:, 2:]).sum(0))


class TestFilms:
    def test_a_film_is_what_was_asked(self) -> None:
        puck = pucks.draw(7, "substrate", True)
        recording, truth = puck.recording, puck.truth
        assert 4 <= len(recording.ids) <= 6 and 3 <= len(truth["impacts"]) <= 10
        assert np.median(np.diff(recording.t)) == pytest.approx(1 / 240, rel=1e-4)
        assert truth["effects"] == [{"name": "coulomb_substrate", "values": {"mu": 0.03}}] and truth["shown"] > 5
        off = [truth["radius"][b.id] / b.radius - 1 for b in recording.scene.bodies]
        assert 0 < np.std(off) < 0.02
        assert [item.name for item in recording.scene.laws] == ["contact_elastic"]
        assert all(b.initial is None for b in recording.scene.bodies if b.mobile)
        again = pucks.draw(7, "substrate", True)
        assert np.array_equal(again.recording.xy, recording.xy)

    def test_noise_is_what_is_stated(self) -> None:
        puck = pucks.draw(3, "nothing", False)
        start = np.array(list(puck.truth["start"].values()))
        moving = [k for k, b in enumerate(puck.recording.scene.bodies) if b.mobile]
        bodies = puck.recording.scene.bodies
        table = Table(np.array([b.radius for b in bodies]), np.array([b.mass for b in bodies]),
                      np.array([not b.mobile for b in bodies]))  # fmt: skip
        flight = run(table, Physics(restitution=pucks.BELIEVED), start, puck.recording.t)
        left = puck.recording.xy - flight.xy[:, moving]
        assert np.std(left) == pytest.approx(pucks.NOISE, rel=0.05) and abs(left.mean()) < 3e-5

    def test_the_command_writes_recordings_and_truth_apart(self, tmp_path: Path, capsys) -> None:
        out = tmp_path / "films"
        assert pucks.main(["--out", str(out), "--seed", "5", "--count", "2", "--layout", "open"]) == 0
        truths = json.loads((tmp_path / "films.json").read_text())
        assert [t["name"] for t in truths] == ["pucks-0005", "pucks-0006"]
        for t in truths:
            recording = read_recording(out / t["name"])
            assert recording.position_noise == pucks.NOISE and set(recording.ids) <= set(t["start"])
            written = "".join(p.read_text() for p in (out / t["name"]).iterdir())
            assert not [e for e in t["effects"] if e["name"] in written]
        assert set(pucks.effects_of(5, 5)) == set(pucks.EFFECTS)

    def test_bad_input_is_one_line(self, tmp_path: Path, capsys) -> None:
        assert pucks.main(["--count", "2"]) == 2
        assert pucks.main(["--truth", str(tmp_path / "none.json"), "--score", str(tmp_path)]) == 2
        assert len(capsys.readouterr().err.strip().splitlines()) == 2


def named(verdict: str, *names: str, alike: str = "") -> dict:
    rivals = [{"name": alike, "gain_heldout": None, "indistinguishable": True}] if alike else []
    return {"verdict": verdict, "mechanisms": [{"name": n} for n in names], "rivals": rivals}


class TestScore:
    @pytest.mark.parametrize(
        ("hidden", "verdict", "how"),
        [
            (["restitution"], named("missing_physics", "restitution"), "right"),
            (["restitution"], named("missing_physics", "pair_lubrication"), "wrong"),
            (["restitution"], named("missing_physics", "restitution", "linear_drag"), "wrong"),
            (["restitution"], named("missing_physics", "pair_lubrication", alike="restitution"), "class"),
            (["restitution"], named("unmodelled", "unknown"), "silent"),
            (["coulomb_substrate"], named("missing_physics", "rolling_resistance"), "class"),
            (["distance_force", "linear_drag"], named("missing_physics", "linear_drag", "distance_force"), "right"),
            (["distance_force", "linear_drag"], named("missing_physics", "quadratic_drag", "distance_force"), "class"),
            (["distance_force", "linear_drag"], named("missing_physics", "distance_force"), "part"),
            (["distance_force", "linear_drag"], named("missing_physics", "distance_force", "cohesion"), "wrong"),
            ([], named("no_mismatch"), "right"),
            ([], named("measurement", "camera_scale"), "wrong"),
            (["restitution"], None, "none"),
        ],
    )
    def test_judged(self, hidden: list[str], verdict: dict | None, how: str) -> None:
        assert pucks.judged({"effects": [{"name": n} for n in hidden]}, verdict) == how

    def test_table_and_sums(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        truths = [{"name": f"f{k}", "effects": [{"name": n, "values": {"restitution": 0.75}}] if n else [],
                   "impacts": [1, 2, 3], "layout": "open"}
                  for k, n in enumerate(["restitution", "", "contact_friction", "restitution"])]  # fmt: skip
        said = [named("missing_physics", "restitution") | {"complete": True, "explained": {"share": 0.97}},
                named("no_mismatch") | {"explained": None}]  # fmt: skip
        said[0]["mechanisms"][0]["parameters"] = {"restitution": {"value": 0.76, "low": 0.74, "high": None}}
        for k, verdict in enumerate(said):
            (tmp_path / f"f{k}").mkdir()
            (tmp_path / f"f{k}" / "verdict.json").write_text(json.dumps(verdict))
            time = {"seconds": 10.0 + k, "core": 50.0 + 20 * k, "failed": ""}
            (tmp_path / f"f{k}" / "time.json").write_text(json.dumps(time))
        (tmp_path / "f2").mkdir()
        (tmp_path / "f2" / "time.json").write_text(json.dumps({"failed": "begun, not finished"}))
        text = pucks.score(truths[:3], tmp_path)
        assert "| f0 | restitution | 3 | open | missing_physics restitution | right | True | 0.97 | 50 | 10 |" in text
        assert "Right name 1 of 2, right name or class 1" in text and "no verdict 1" in text
        assert "Nothing named in nothing: 1 of 1. Seconds: median 10, longest 11." in text
        (tmp_path / "truth.json").write_text(json.dumps(truths))
        table, options = tmp_path / "told.csv", ["--truth", str(tmp_path / "truth.json"), "--score", str(tmp_path)]
        assert pucks.main([*options, "--csv", str(table)]) == 0
        rows = pucks.read_rows(table)
        # what was begun is listed, finished or not, and nothing else
        assert [r.film for r in rows] == ["f0", "f1", "f2"] and rows[2].answer == "begun, not finished"
        assert rows[0].told == "restitution=0.76 (0.74 to )" and rows[0].hold == "1 of 1"
        capsys.readouterr()
        assert pucks.main(["--told", str(table)]) == 0
        told = capsys.readouterr().out
        assert "| ideal | 3 | 1 of 2 | 1 of 2 | 0 | 0 | 1 | 1 of 1 | 1 of 1 | 60, 70 | 1 of 2 |" in told
        assert "- f2 (ideal): contact_friction restitution=0.75: begun, not finished" in told


def test_a_diagnosis_that_was_stopped_is_gone_on_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    done: list[str] = []

    def diagnose(recordings: list[Path], keep: Path, minutes: float | None) -> dict:
        name = recordings[0].name
        assert "begun" in (keep / "time.json").read_text()
        if name == "pucks-0007" and name not in done:
            done.append(name)
            raise KeyboardInterrupt
        done.append(name)
        (keep / "verdict.json").write_text(json.dumps(named("no_mismatch")))
        return {"seconds": 1.0, "verdict": named("no_mismatch"), "failed": ""}

    monkeypatch.setattr(pucks, "diagnose_alone", diagnose)
    films, table = tmp_path / "films", tmp_path / "table.csv"
    assert pucks.main(["--out", str(films), "--seed", "5", "--count", "4", "--layout", "open"]) == 0
    options = ["--out", str(films), "--diagnose", str(tmp_path / "v"), "--csv", str(table)]
    with pytest.raises(KeyboardInterrupt):
        pucks.main([*options, "--slice", "2/2"])
    assert done == ["pucks-0007"] and pucks.main([*options, "--slice", "2/2"]) == 0
    assert [r.film for r in pucks.read_rows(table)] == ["pucks-0007", "pucks-0008"]
    assert pucks.main(options) == 0
    assert done == ["pucks-0007", "pucks-0007", "pucks-0008", "pucks-0005", "pucks-0006"]
    assert len(pucks.read_rows(table)) == 4 and pucks.main([*options, "--slice", "3/2"]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_a_repulsion_is_told_for_the_mean_radius_of_all_that_repel() -> None:
    """As the law tells it: between bodies, posts are among those that it acts on."""
    table = Table(RADIUS, MASS, np.array([False, False, True, False]))
    physics, _ = pucks.physics_of("repulsion", table, 0.5, np.random.default_rng(1))
    assert physics.repulsion is not None
    posts = tuple(Body(f"p{k}", "wall" if table.fixed[k] else "free", float(r), float(m), initial=(k, 0, 0, 0))
                  for k, (r, m) in enumerate(zip(RADIUS, MASS, strict=True)))  # fmt: skip
    scene = Scene(posts, (use("distance_force", s=1.0, n=2.0),))
    acts = scene.rows(scene.laws_named("distance_force")[0])
    assert physics.repulsion[2] == pytest.approx(np.mean([posts[k].radius for k in acts]))
