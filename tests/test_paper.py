"""Claims of the paper: plans, statistics, calibration, and a small run of the whole command."""

import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from granswim_pymunk.analysis.resonance import second_resonance
from granswim_pymunk.cli import main
from granswim_pymunk.errors import InputError
from granswim_pymunk.paper import compare, driver, f4, f9, pages, plans, t1
from granswim_pymunk.paper.calibrate import calibrate, fit_curve, third_of_free
from granswim_pymunk.paper.claim import CALIBRATED, FAILS, HOLDS, OPEN, Finding, Verdict, above, number, peak, within
from granswim_pymunk.paper.f9 import HEIGHTS, at, interface
from granswim_pymunk.paper.measure import Plan
from granswim_pymunk.paper.plans import PAPER, POCKET, Setting, blocks, complete, points_of
from granswim_pymunk.paper.results import Results, jobs_of, summarise
from granswim_pymunk.paper.scenes import MU_EFF, paper_scene
from granswim_pymunk.recording.folder import read_curve
from granswim_pymunk.recording.recording import CURVE
from granswim_pymunk.sweep import read_dataset

# a bed of a few hundred grains, short runs: what comes out is no physics, but everything is used
TINY = Setting(
    "tiny", (("free", (1, 2)),), Plan(duration=0.64, settle=0.1, spacing=1e-3), 25.0,
    usual={"width": 0.036, "height": 0.024},
)  # fmt: skip


def synthetic(values: dict[tuple[float, float, float], list[float]], **more: float) -> Results:
    """Results with given speeds for (frequency, layers, mu_eff)."""
    results = Results(POCKET, Path("."))
    for (f, layers, mu), speeds in values.items():
        for seed, speed in enumerate(speeds):
            point = complete({"frequency": f, "layers": layers, "mu_eff": mu, **more}, POCKET, seed)
            results.runs.append((point, xr.Dataset({"speed": speed})))
    return results


# ---- plans ------------------------------------------------------------------------------------


@pytest.mark.parametrize("setting", [POCKET, PAPER], ids=lambda s: s.name)
def test_plans(setting: Setting) -> None:
    points = points_of(setting)
    assert len({tuple(p.values()) for p in points}) == len(points)
    assert len(setting.seeds) == (8 if setting is POCKET else 20)
    # every block has every packing, and every point builds
    assert [p["seed"] for p in points_of(setting, ["stored"])] == [1, 1]
    for name in plans.BLOCKS:
        block = blocks(setting)[name]
        mine = points_of(setting, [name])
        assert {p["seed"] for p in mine} == set(setting.seeds)
        assert len(mine) == len({tuple(complete(b, setting, 1).values()) for b in block}) * len(setting.seeds)
    # fields are kept of the free swimmer only
    with_fields = [p for p in points if setting.plan_of(p).spacing > 0]
    assert {p["frequency"] for p in with_fields} == set(plans.FREE[100.0])
    assert len(with_fields) == len(plans.FREE[100.0]) * len(setting.seeds)
    assert all(paper_scene(**p).seed == p["seed"] for p in points[:: len(points) // 20])
    assert {c for claim in driver.CLAIMS.values() for c in claim.blocks} == {*plans.BLOCKS, "stored"}


def test_paper_scene_is_the_papers() -> None:
    scene = paper_scene(softness=1.0, layers=11, mu_eff=0.22)
    law = {item.name: item.values for item in scene.laws}
    assert law["contact_linear"]["stiffness"] == 2.2e3 and law["contact_linear"]["damping"] == 1e4
    assert law["union"]["stiffness"] == 1e3 and law["bending"]["stiffness"] == 1.36e-3
    assert law["confinement"]["mu_eff"] == 0.22 and scene.bed is not None
    assert scene.bed.grain_diameter == pytest.approx((1e-3, 2e-3))
    assert scene.bodies[0].mass == pytest.approx(7 * scene.bodies[1].mass)
    # the k_B first taken is that number exactly, so that its runs are found again
    first = paper_scene(**plans.FIRST, softness=1.0)
    assert {item.name: item.values for item in first.laws}["bending"]["stiffness"] == 2e-3
    # softer contacts keep the restitution: gamma^2 m/k stays
    soft = {item.name: item.values for item in paper_scene(softness=25.0).laws}["contact_linear"]
    assert soft["damping"] ** 2 / soft["stiffness"] == pytest.approx(1e8 / 2.2e3)


# ---- statistics -------------------------------------------------------------------------------


def test_verdicts() -> None:
    assert [above(2, 1), above(-2, 1), above(0.5, 1), above(np.nan, 1), above(2, np.nan)] == [
        HOLDS, FAILS, OPEN, OPEN, OPEN,
    ]  # fmt: skip
    assert [within(0, 1, -2, 2), within(4, 1, -2, 2), within(2, 1, -2, 2)] == [HOLDS, FAILS, OPEN]
    assert number(8.021e-3, 4.1e-4, "mm/s", 1e3) == "8.02 ± 0.41 mm/s"

    def worst(*verdicts: str) -> str:
        return Verdict(t1.CLAIM, [Finding("", "", v) for v in verdicts]).verdict

    assert worst(HOLDS, HOLDS) == HOLDS and worst(FAILS, FAILS) == FAILS and worst(OPEN) == OPEN
    assert worst(HOLDS, FAILS) == "holds in part" and worst(HOLDS, OPEN) == "holds as far as decided"


def test_peak_of_a_parabola_and_its_interval() -> None:
    frequency = np.array([4.0, 6.0, 9.0, 11.0, 15.0])
    rng = np.random.default_rng(0)
    exact = [np.full(3, 10 - (f - 9.6) ** 2) for f in frequency]
    assert peak(frequency, exact, rng) == pytest.approx((9.6, 9.6, 9.6), abs=1e-9)
    inside = 0
    for _ in range(60):
        noisy = [s + rng.normal(0, 4.0, 3) for s in exact]
        _, low, high = peak(frequency, noisy, rng, draws=300)
        inside += low <= 9.6 <= high
    assert inside >= 54
    rising = [np.full(2, f) for f in frequency]
    assert peak(frequency, rising, rng)[0] == 15.0


def test_interface_of_a_profile() -> None:
    profile = 1e-3 * 10 ** (2.0 - np.abs(HEIGHTS))  # crosses 1e-3 at two diameters
    assert at(profile, 5.0) == pytest.approx(1e-6)
    assert interface(profile) == pytest.approx(2.0)
    assert np.isnan(interface(np.full(len(HEIGHTS), 1.0)))


def test_optima_against_each_other() -> None:
    """Parabolas whose tops go as the table's second resonance, all 1.2 times it: the ratios hold, the scale is told."""
    rng = np.random.default_rng(4)
    results = Results(POCKET, Path("."))
    for label in f4.LABELS:
        top = 1.2 * second_resonance(label)
        for f in top * np.array([0.7, 0.9, 1.1, 1.4]):
            for seed in range(1, 9):
                point = complete({"frequency": float(f), "k_B": label}, POCKET, seed)
                speed = 0.01 - 0.04 * (f / top - 1) ** 2 + rng.normal(0, 2e-4)
                results.runs.append((point, xr.Dataset({"speed": speed})))
    *ratios, scale = f4.relative(results)
    assert [f.verdict for f in ratios] == [HOLDS] * 3 and all(f.packings == 8 for f in ratios)
    assert ratios[0].value == pytest.approx(second_resonance(150.0) / second_resonance(100.0), rel=0.02)
    assert scale.value is not None and scale.error is not None
    assert scale.value == pytest.approx((1 / 1.2) ** (1 / 0.55), abs=2 * scale.error) and scale.error < 0.1
    absolute = f4.judge(results)[:4]
    assert [f.verdict for f in absolute] == [CALIBRATED, FAILS, FAILS, FAILS]
    # optima that do not move with k_B refute it
    still = Results(POCKET, Path("."))
    for point, run in results.runs:
        f = point["frequency"] / second_resonance(point["k_B"]) * second_resonance(100.0)
        still.runs.append(({**point, "frequency": f}, run))
    assert [f.verdict for f in f4.relative(still)[:3]] == [FAILS] * 3


def test_inertial_number_peaks_where_it_was_measured() -> None:
    """A frequency without fields says nothing about them."""
    results = Results(POCKET, Path("."))
    for f, level in ((4.0, 0.1), (9.0, 0.3), (11.0, np.nan), (15.0, 0.2), (20.0, None)):
        for seed in range(1, 5):
            run = xr.Dataset({"anisotropy": 0.1 + 0.001 * seed})
            if level is not None:
                run["profile_inertial"] = ("height", np.full(len(HEIGHTS), level * (1 + 0.01 * seed)))
            results.runs.append((complete({"frequency": f}, POCKET, seed), run))
    findings = f9.judge(results)
    (found,) = [f for f in findings if "peaks" in f.says]
    assert found.verdict == HOLDS and found.measured.startswith("largest mean at 9 Hz of 4, 9, 15: ")
    assert all(f.packings == 4 for f in findings)


def test_free_speed_section() -> None:
    three = {(f, 0.0, MU_EFF): list(1e-3 * np.array([9.0, 11.0, 13.0])) for f in (4.0, 9.0, 11.0, 15.0)}
    results = synthetic(three, **plans.FIRST)
    text = "\n".join(pages.free_speed_section(results))
    assert "11.0 ± 5.0 (n = 3)" in text and "2.00 mN per radian for label 100" in text
    assert "1.5 at 9 Hz" in text and "area to spare" not in text
    # what an independent code found with another k_B is not set against the default's speeds
    alone = "\n".join(pages.free_speed_section(synthetic(three)))
    assert "11.0 ± 5.0 (n = 3)" in alone and "standard deviations:" not in alone
    assert "tail first" not in alone
    slow = {(15.0, 0.0, MU_EFF): [-3e-3, -4e-3, -5e-3], (20.0, 0.0, MU_EFF): [-9e-3, 1e-3, 9e-3]}
    assert "goes tail first at 15 Hz" in "\n".join(pages.free_speed_section(synthetic(slow)))
    results.runs += synthetic(three).runs
    for seed in range(3):
        point = complete({**plans.LOOSE, "frequency": 9.0}, POCKET, seed)
        results.runs.append((point, xr.Dataset({"speed": 1e-3 * (3.0 + 2 * seed)})))
    text = "\n".join(pages.free_speed_section(results))
    assert "slower by 6.00 ± 0.00 mm/s at 9 Hz (n = 3), so that the 3.0 mm/s" in text and "are 0.005 of" in text


def test_claims_of_two_runs_side_by_side(tmp_path: Path) -> None:
    def verdict(*found: tuple[str, str]) -> Verdict:
        return Verdict(t1.CLAIM, [Finding("as printed", measured, v) for measured, v in found])

    out = tmp_path / "other"
    out.mkdir()
    record = {
        "format": compare.FORMAT, "setting": "pocket", **plans.FIRST,
        "claims": [verdict(("1", HOLDS), ("2", HOLDS), ("3", FAILS)).to_dict()],
    }  # fmt: skip
    (out / "claims.json").write_text(json.dumps(record))
    other = compare.read_other(out / "claims.json")
    # the k-th of equal words is the same statement; what only one of them has is left out
    mine = [verdict(("4", HOLDS), ("5", FAILS))]
    assert compare.differing(mine, other) == [("T1", "as printed", "5", FAILS, "2", HOLDS)]
    assert compare.differing([verdict(("4", HOLDS))], other) == []
    text = pages.page(mine, POCKET, tmp_path, tmp_path, other)
    assert "k_B 1.36 mN per radian" in text and "with k_B 2.00 mN per radian" in text
    assert "[numbers](other/claims.json)" in text
    assert "| T1 | as printed | **does not hold**: 5 | **holds**: 2 |" in text
    assert "Every statement has the same verdict" in pages.page([verdict(("4", HOLDS))], POCKET, tmp_path, out, other)


# ---- calibration ------------------------------------------------------------------------------


def test_a_third_of_the_free_speed() -> None:
    # 9 mm/s falling by 40 mm/s for each s/m: a third at mu = 0.15
    rng = np.random.default_rng(2)
    values = {(9.0, 0.0, MU_EFF): list(9e-3 + rng.normal(0, 1e-4, 6))}
    for mu in POCKET.friction:
        values[9.0, 11.0, mu] = list(9e-3 - 40e-3 * mu + rng.normal(0, 1e-4, 6))
    found = third_of_free(synthetic(values))
    assert found.mu_eff == pytest.approx(0.15, abs=3 * found.error) and 0 < found.error < 0.02
    assert found.packings == 6 and found.ratio == pytest.approx(9 / (9 - 40 * MU_EFF), rel=0.1)
    assert np.isnan(third_of_free(synthetic({(9.0, 0.0, MU_EFF): [1.0, 2.0]})).mu_eff)


def test_a_curve_is_fitted() -> None:
    mu = np.array([0.0, 0.055, 0.11, 0.22])
    curve = np.zeros(3, dtype=CURVE)
    curve["frequency"], curve["layers"] = [4.0, 9.0, 15.0], 11.0
    top = np.array([6e-3, 9e-3, 4e-3])
    curve["speed"], curve["speed_sem"] = top - 0.03 * 0.08, np.nan
    rng = np.random.default_rng(3)
    speeds = [[v - 0.03 * m + rng.normal(0, 2e-4, 8) for v in top] for m in mu]
    found = fit_curve(curve, mu, speeds)
    assert found.mu_eff == pytest.approx(0.08, abs=2 * found.error) and found.error < 0.02 and found.packings == 8
    # a row that is known much better decides
    curve["speed"][0], curve["speed_sem"] = top[0] - 0.03 * 0.18, [1e-6, 1e-3, 1e-3]
    assert fit_curve(curve, mu, speeds).mu_eff == pytest.approx(0.18, abs=0.02)
    with pytest.raises(InputError, match="two values"):
        fit_curve(curve, mu, [[np.zeros(0)] * 3] * 4)


def test_a_curve_is_run_for(tmp_path: Path) -> None:
    """Speeds made by the simulation itself at one mu_eff give that mu_eff back."""
    file = tmp_path / "curve.csv"
    short = Setting("short", (("free", (1,)),), Plan(duration=0.4, settle=0.1, spacing=0), 25.0, usual=TINY.usual)
    mu = (0.0, 0.2)
    rough = np.zeros(1, dtype=CURVE)
    rough["frequency"], rough["layers"], rough["speed_sem"] = 9.0, 11.0, np.nan
    first = calibrate(rough, short, tmp_path / "runs", mu, processes=1, quiet=True)
    assert first.packings == 1 and len(list((tmp_path / "runs").glob("*.nc"))) == 2
    point = complete({"frequency": 9.0, "layers": 11.0, "mu_eff": 0.2}, short, 1)
    (job,) = jobs_of([point], short, tmp_path / "runs")
    assert job.done
    speed = float(summarise(read_dataset(job.file))["speed"])
    file.write_text(f"frequency,layers,speed\n9,11,{speed!r}\n")
    again = calibrate(read_curve(file), short, tmp_path / "runs", mu, processes=1, quiet=True)
    assert again.mu_eff == pytest.approx(0.2, abs=1e-6) and again.rms < 1e-9


# ---- the whole --------------------------------------------------------------------------------


def test_a_small_run_of_everything(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs, figures, verdicts, pages; a second call runs nothing; kept numbers stand in for lost run files."""
    monkeypatch.setitem(plans.FREE, 100.0, (4.0, 9.0, 15.0))
    said: list[str] = []
    names = ["F2", "F4", "F5", "F6", "F7", "F8", "F9", "T1"]
    out = tmp_path / "out"
    verdicts = driver.paper(names, setting=TINY, out=out, processes=1, quiet=True, say=said.append)
    assert [v.claim.name for v in verdicts] == ["T1", "F2", "F4", "F5", "F6", "F7", "F8", "F9"]
    assert "runs of 0.64 s, 0 finished" in said[0] and not any(v.failed for v in verdicts)
    for v in verdicts:
        assert v.findings and (out / f"{v.claim.name}.png").stat().st_size > 5000, v.claim.name
    record = json.loads((out / "claims.json").read_text())
    by_name = {c["claim"]: c for c in record["claims"]}
    assert by_name["F7"]["packings"] == 2 and by_name["F7"]["runs_missing"] == 0
    text = (out / "paper.md").read_text()
    assert "![F8" in text and "| [F9](#f9)" in text
    table = read_dataset(out / "sweep.nc")
    assert table["speed"].dims == ("frequency", "k_B", "layers", "seed") and table["speed"].shape == (3, 1, 1, 2)
    run = read_dataset(next((out / "runs").glob("*.nc")))
    # the swimmer pushes grains, where it is: near the middle of the grid
    push = run["field_swimmer_contact"].values
    assert push[len(push) // 4 : -len(push) // 4].sum() > 0.9 * push.sum() > 0
    # the swimmer's own account: what the bending law did is what the fields and contacts were fed by
    assert float(run["bending_power"].mean()) > 0
    assert float(run["packed_fraction"]) == pytest.approx(0.80, abs=2e-3)

    stamps = {f: f.stat().st_mtime_ns for f in (out / "runs").iterdir()}
    again = driver.paper(["F7"], setting=TINY, out=out, processes=1, quiet=True, say=said.append)
    assert {f: f.stat().st_mtime_ns for f in (out / "runs").iterdir()} == stamps
    for file in stamps:
        file.unlink()
    before = (out / "F8.png").read_bytes()
    kept = driver.paper(["F7", "F8", "F2"], setting=TINY, out=out, run=False, say=said.append)[1:2]
    assert (out / "F8.png").read_bytes() == before
    assert [f.verdict for f in kept[0].findings] == [f.verdict for f in again[0].findings]
    for a, b in zip(kept[0].findings, again[0].findings, strict=True):
        assert (a.value is None) == (b.value is None)
        assert a.value is None or a.value == pytest.approx(b.value, rel=1e-5)


def test_another_scale_of_k_B(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The modes of the law as simulated go with the root of k_B; the page of the default stands beside it."""
    first, out = tmp_path / "first", tmp_path / "out"
    assert main(["paper", "T1", "readings", "--no-run", "--k-b-scale", "1.47", "--out", str(first)]) == 0
    record = json.loads((first / "claims.json").read_text())
    assert record["k_B_scale"] == pytest.approx(2.0 / 1.36)
    assert "--k-b-scale 1.47" in (first / "paper.md").read_text()
    more = ["--compare", str(first / "claims.json")]
    assert main(["paper", "T1", "readings", "--no-run", "--out", str(out), *more]) == 0
    here = json.loads((out / "claims.json").read_text())
    second, fewer = (
        [f["value"] for f in r["claims"][0]["findings"] if f["unit"] == "Hz"] for r in (record, here)
    )  # fmt: skip
    assert len(second) == 3 and second == pytest.approx(np.sqrt(2.0 / 1.36) * np.array(fewer), rel=1e-3)
    assert "[page](../first/paper.md)" in (out / "readings.md").read_text()
    capsys.readouterr()


def test_the_command_without_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, report = tmp_path / "out", tmp_path / "t1.json"
    assert main(["paper", "T1", "F10", "--no-run", "--out", str(out), "--json", str(report)]) == 0
    said = capsys.readouterr().out
    assert "26.37, 62.59, 32.30, 76.66, 37.30, 88.52, 58.98, 139.96 rad/s" in said and "misprints" in said
    record = json.loads(report.read_text())
    assert record["claims"][0]["findings"][0]["verdict"] == HOLDS
    assert record["claims"][1]["verdict"] == OPEN and record["claims"][1]["runs_missing"] > 0
    assert not (out / "runs").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["F11"], "unknown claim"),
        (["T1", "--curve", "nowhere.csv"], "nowhere.csv"),
        (["T1", "--json", "nowhere/at/all.json"], "does not exist"),
        (["T1", "--k-b-scale", "0"], "above zero"),
        (["T1", "--compare", "nowhere.json"], "nowhere.json"),
        (["T1", "--compare", __file__], "no JSON"),
    ],
)
def test_bad_input(tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], words: str) -> None:
    assert main(["paper", *arguments, "--out", str(tmp_path / "out")]) == 2
    assert words in capsys.readouterr().err and not (tmp_path / "out").exists()
