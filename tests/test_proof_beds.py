"""Concealed cases in beds: states from films, standard errors through chaos, and nothing that betrays a case."""

import json
import math

import numpy as np
import pytest

from granswim_pymunk.proof import bed_cases, windows
from granswim_pymunk.proof import kernels as k
from granswim_pymunk.proof.bed_candidates import Plan, acting, draw, resolved, rivals_of, typical
from granswim_pymunk.proof.beds import OUTSIDE_BED, SUSPECTS, draw_bed, packed
from granswim_pymunk.proof.conceal import MOMENT, conceal
from granswim_pymunk.proof.fitting import with_adjusted
from granswim_pymunk.proof.packings import angles, speed
from granswim_pymunk.proof.prove import FULL, full_cases
from granswim_pymunk.proof.score import score_case
from granswim_pymunk.proof.windows import beyond, calibrated, estimated, film_of, product
from granswim_pymunk.proof.world import World
from granswim_pymunk.recording import read_recording
from granswim_pymunk.recording.shipped import resolve_recording

SECRET = b"a secret of the tests"


@pytest.fixture(scope="module")
def small():
    """A small seen bed: its setup, its packed scene and a film without noise."""
    setup = draw_bed(np.random.default_rng(6), "bed", True)
    while not setup.scene.adjustable or setup.scene.adjustable[0].parameter != "stiffness":
        setup = draw_bed(np.random.default_rng(len(setup.t)), "bed", True)
    scene = packed(setup.scene, 3)
    return setup, scene, film_of(setup, scene, ())


@pytest.fixture
def few(monkeypatch):
    """Standard errors from few windows and few rivals, so that a case takes seconds."""
    monkeypatch.setattr(windows, "MOST", {True: 3, False: 3})
    monkeypatch.setattr(bed_cases, "rivals_of", lambda setup: rivals_of(setup)[:3])


def test_beds_are_those_of_the_paper_in_full_and_smaller_in_small():
    for seed in range(6):
        rng = np.random.default_rng(seed)
        full, little = draw_bed(rng, "bed", False), draw_bed(rng, "bed", True)
        assert full.scene.periodic_x == pytest.approx(0.1, rel=0.02)
        assert 0.5 <= full.t[-1] - full.t[0] <= 1.01 and full.t[0] >= 0.06
        assert little.scene.periodic_x < 0.04
        assert full.noise == pytest.approx(2e-5, rel=0.06)
    assert len(draw_bed(rng, "unseen", False).drives) == 4


def test_states_come_from_parabolas_and_are_as_unsure_as_they_say():
    rng = np.random.default_rng(1)
    t = np.arange(9) / 500
    n = 4000
    x, v, a = rng.normal(size=(3, n, 2)) * np.array([1e-2, 0.1, 4.0])[:, None, None]
    s = (t - t[4])[:, None, None]
    true = x + v * s + a * s**2
    place, rate, _ = estimated(t, true, 4, 2e-5)
    assert np.allclose(place, x, atol=1e-13) and np.allclose(rate, v, atol=1e-10)
    noisy = true + rng.normal(size=true.shape) * 2e-5
    noisy[3, : n // 2] = np.nan  # half of them are lost in a frame
    noisy[:, 0] = np.nan
    noisy[1, 0] = 0.5  # one is hardly ever seen
    place, rate, root = estimated(t, noisy, 4, 2e-5)
    assert place[0].tolist() == [0.5, 0.5] and rate[0].tolist() == [0, 0]
    for mine in (slice(1, n // 2), slice(n // 2, n)):
        wrong = np.stack([place - x, rate - v], axis=1)[mine]
        assert np.linalg.solve(root[mine], wrong).std(axis=(0, 2)) == pytest.approx(1.0, abs=0.06)


def test_overlaps_are_pushed_apart_and_joints_put_right(small):
    _, scene, film = small
    rng = np.random.default_rng(2)
    radius = np.array([b.radius for b in scene.bodies])
    wall = np.array([b.role == "wall" for b in scene.bodies])
    chain = np.array(scene.swimmer)
    in_chain = np.isin(np.arange(len(radius)), chain)
    xy = film[0] + rng.normal(size=film[0].shape) * 2e-5 * ~wall[:, None]
    before = xy.copy()
    kind = np.where(wall, k.WALL, k.FREE)
    worst = k.separate(xy, kind, radius, in_chain, chain, 2 * radius[chain[0]], scene.periodic_x, 5e-7, 2000)
    assert worst <= 5e-7
    joints = np.hypot(*np.diff(xy[chain], axis=0).T)
    assert np.abs(joints - 2 * radius[chain[0]]).max() < 2e-6
    assert np.array_equal(xy[wall], before[wall])
    assert np.sqrt(np.mean((xy - before)[~wall] ** 2)) < 3e-5


def test_products_of_different_members_see_through_chaos():
    rng = np.random.default_rng(3)
    n = 400
    effect, other = rng.normal(size=(2, n)) * 0.3

    def members(mean, count=4):
        return mean + rng.normal(size=(count, n))

    sizes = [product(members(effect), members(effect)) for _ in range(40)]
    # members of one change share a simulation with members of the same number of another
    own = [product(m, m) for m in (members(effect) for _ in range(200))]
    assert np.mean(own) == pytest.approx(effect @ effect, rel=0.15)
    assert np.mean(sizes) == pytest.approx(effect @ effect, rel=0.15)
    assert np.square(members(effect).mean(axis=0)).sum() > 2 * (effect @ effect)  # what a square would say
    strong = 10 * effect
    left, amounts = beyond(members(strong + 5 * other), [members(5 * other), members(strong)])
    assert left < 12 and amounts == pytest.approx([1.0, 1.0], abs=0.1)
    left, _ = beyond(members(strong), [members(5 * other)])
    assert left == pytest.approx(np.linalg.norm(strong), rel=0.1)


@pytest.mark.parametrize("name", [*SUSPECTS, *OUTSIDE_BED])
def test_every_effect_moves_a_bed(small, name):
    setup, scene, _ = small
    t = np.array([0.0, 0.004])
    still = World(scene, [], 6e-6).sample(t + 0.03, t0=0.03).xy[-1]
    rng = np.random.default_rng(5)
    for other in (False, True):
        plan = draw(name, setup, rng, other)
        effect = plan.at(2.0)
        if name == "actuator_saturation":
            effect = plan.at(4.0)
        moved = World(scene, [resolved(effect, scene)], 6e-6).sample(t + 0.03, t0=0.03).xy[-1]
        assert np.isfinite(moved).all() and np.abs(moved - still).max() > 1e-10
        whom = acting(effect, setup.swimmer)
        assert whom and set(whom) <= {*setup.swimmer, "grains"}
        if other and not plan.other:
            assert name in ("uniform_force", "actuator_delay", "weak_joint", "resting_curvature", "head_force",
                            *OUTSIDE_BED)  # fmt: skip
    assert typical(name, setup).at(0.0).name == name


def test_calibration_finds_a_stiffness_that_was_off(small):
    setup, scene, _ = small
    name = setup.scene.adjustable[0].name
    true = 1.2 * float(scene.laws_named("bending")[0].values["stiffness"])
    film = film_of(setup, with_adjusted(scene, {name: true}), ())
    film = film + np.random.default_rng(1).normal(size=film.shape) * setup.noise
    guess = {a.name: float(scene.laws_named(a.law)[0].values[a.parameter]) for a in setup.scene.adjustable}
    assert calibrated(setup, scene, setup.t, film, guess)[name] == pytest.approx(true, rel=0.06)


def test_numbers_of_unseen_beds():
    t = np.arange(300) / 500
    f, phase = 9.0, 0.4
    angle = 0.2 + 0.5 * np.cos(2 * np.pi * f * t + phase) - 0.3 * np.sin(2 * np.pi * f * t + phase)
    step = 3e-3 * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    xy = np.stack([np.zeros_like(step), step, 2 * step], axis=1) + np.array([-0.02, 0.01]) * t[:, None, None]
    xy[40, 1] = np.nan
    found = angles(t, xy, f, phase)
    assert found[:6] == pytest.approx([0.2, 0.5, -0.3] * 2, abs=1e-9)
    assert found[6:] == pytest.approx([-0.02, 0.01], abs=2e-3)
    setup = draw_bed(np.random.default_rng(1), "curve", True)
    disks = np.zeros((2, 7, 2))
    disks[1, :, 0] = -6e-3
    assert speed(setup.scene, disks) == pytest.approx(0.01)  # head first is towards -x


@pytest.mark.parametrize(
    ("kind", "effect"),
    [
        ("small-bed", "weak_joint"),
        pytest.param("small-curve", "coulomb_substrate", marks=pytest.mark.long),
        pytest.param("small-unseen", "actuator_lag", marks=pytest.mark.long),
    ],
)
def test_cases_that_differ_in_the_sealed_part_differ_in_what_was_seen_only(kind, effect, tmp_path, few, monkeypatch):
    monkeypatch.setattr(bed_cases, "LADDER", (20.0,))
    folders, truths = [], []
    for name in ("none", effect):
        out = tmp_path / name
        folders.append(conceal(4, out / "open", SECRET, out / "sealed", kind=kind, effect=name))
        truths.append(json.loads((out / "sealed" / f"{kind}-4.json").read_text())["truth"])
    assert [t["category"] for t in truths] == ["null", "mechanism"]
    assert truths[1]["sigma"] > 8 and truths[1]["rivals_computed"] == (kind != "small-curve")
    files = [sorted(p.relative_to(f) for p in f.rglob("*") if p.is_file()) for f in folders]
    assert files[0] == files[1]
    differ = set()
    for file in files[0]:
        a, b = (f / file for f in folders)
        assert a.stat().st_mtime == b.stat().st_mtime == MOMENT and a.stat().st_mode == b.stat().st_mode
        if a.read_bytes() != b.read_bytes():
            differ.add(file.name)
    assert differ <= {"tracks.csv", "tracks.npz", "curve.csv", "recording.toml"} and differ - {"recording.toml"}
    # numbers that may be adjusted were fitted to what was seen; all else of the belief is the same
    scenes = [read_recording(f).scene for f in folders]
    adjusted = {a.name for a in scenes[0].adjustable}
    for a, b in zip(scenes[0].laws, scenes[1].laws, strict=True):
        for key in a.values:
            assert f"{a.name}.{key}" in adjusted or a.values[key] == b.values[key]
    assert [(b.id, b.radius, b.mass) for b in scenes[0].bodies] == [(b.id, b.radius, b.mass) for b in scenes[1].bodies]


@pytest.mark.long
def test_films_of_an_unseen_bed_lie_in_one_folder_that_a_diagnosis_takes(tmp_path, few):
    folder = conceal(2, tmp_path / "open", SECRET, tmp_path / "sealed", kind="small-unseen", effect="none")
    parts = resolve_recording(folder)
    assert [p.name for p in parts] == ["film-1", "film-2"]
    films = [read_recording(p) for p in parts]
    assert len({float(f.scene.laws_named("bending")[0].values["frequency"]) for f in films}) == 2
    assert all(f.scene.bed is not None and not any(b.role == "grain" for b in f.scene.bodies) for f in films)
    assert "seed" not in (parts[0] / "recording.toml").read_text()


def test_scores_of_beds_count_classes_of_bodies():
    truth = {
        "setup": "full bed", "category": "mechanism", "bodies": ["3"], "swimmer": [str(n) for n in range(7)],
        "effects": [{"name": "weak_joint", "values": {"joint": 3, "factor": 0.5}, "bodies": None, "other": {}}],
        "sigma": 20.0, "own": 0.0, "rivals": {"actuator_lag": 9.0}, "rivals_computed": True,
    }  # fmt: skip
    entry = {
        "name": "weak_joint", "bodies": ["3"],
        "parameters": {"joint": {"value": 3}, "factor": {"value": 0.52, "low": 0.45, "high": 0.6}},
    }  # fmt: skip
    verdict = {"verdict": "missing_physics", "mechanisms": [entry], "mismatch": [{"bodies": ["3"]}]}
    result = {"case": "bed-1", "truth": truth, "verdict": verdict, "seconds": 1.0}
    row = score_case(result)
    assert (row.right_name, row.located, row.covered, row.eligible) == (True, True, (True,), True)
    truth["rivals_computed"] = False
    assert score_case(result).eligible is False and math.isnan(score_case(result).d_prime)
    truth |= {"bodies": [*truth["swimmer"], "grains"], "effects": [{**truth["effects"][0], "values": {"joint": 2}}]}
    row = score_case(result)
    assert row.located is False and row.covered == ()
    entry["bodies"] = ["swimmer", "g17"]
    assert score_case(result).located is True


def test_the_full_form_has_the_beds_that_are_asked_for():
    cases = full_cases()
    assert len(set(cases)) == len(cases) and len(FULL["bed"]) >= 30
    assert full_cases("bed") == [("bed", s) for s in FULL["bed"]]
    assert all(s >= 1000 for _, s in cases)


class Bending:
    """A sensitivity whose changes bend with the amount: (4 members, 3 numbers), the same for all members."""

    def __init__(self):
        self.columns = {}

    def adjustable(self, few=False):
        return []

    def change(self, effects, few=False):
        total = np.zeros(3)
        for effect in effects:
            a = sum(effect.values.values())
            total += {"linear_drag": np.array([a, 0.04 * a**2, 0.0]), "quadratic_drag": np.array([a, 0.0, 3.0 * a])}[
                effect.name
            ]
        return np.tile(total, (4, 1))


def test_a_rival_that_comes_near_is_looked_at_where_it_does(monkeypatch):
    truth = Plan("linear_drag", {"c": 1.0}, other={"power": 0.0})
    alike, unlike = Plan("linear_drag", {"c": 2.0}), Plan("quadratic_drag", {"c": 1.0})
    monkeypatch.setattr(
        bed_cases, "rivals_of", lambda setup: [("another drag", (alike,)), ("quadratic_drag", (unlike,))]
    )
    own, found = bed_cases.rivals(None, Bending(), truth, 20.0)
    # at their usual amounts both bend by much less, and would leave about 14 of 26
    assert own < 2 and found["another drag"] < 2
    assert found["quadratic_drag"] > 15
