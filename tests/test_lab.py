"""Recordings as single laboratories make them: their physics, their files, their scores."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from granswim_pymunk.inference.candidates import named_terms
from granswim_pymunk.inference.tracks.model import Tracks
from granswim_pymunk.inference.tracks.name import Trial, _from_pieces, refit
from granswim_pymunk.inference.tracks.signatures import make_bank
from granswim_pymunk.recording import read_recording, write_recording
from granswim_pymunk.validation import lab, school


@pytest.fixture(scope="module")
def made():
    return {key: make(np.random.default_rng(5), f"{key}-5") for key, make in lab.EXPERIMENTS.items()}


def test_the_integrator_is_of_fourth_order() -> None:
    t = np.linspace(0.0, 3.0, 7)
    swing = lab.integrated(lambda _, y: np.array([y[1], -4.0 * y[0]]), [1.0, 0.0], t)
    assert swing[:, 0] == pytest.approx(np.cos(2 * t), abs=1e-11)


def test_a_puck_loses_speed_as_its_drag_says(made) -> None:
    recording, truth = made["puck"].recording, made["puck"].truth
    c, body = truth["effects"][0]["values"]["c"], recording.scene.bodies[0]
    t = recording.t - recording.t[0]
    left = []
    for column in recording.xy[:, 0].T:
        seen = np.isfinite(column)
        form = np.column_stack([np.ones_like(t), 1 - np.exp(-c / body.mass * t)])[seen]
        rest = column[seen] - form @ np.linalg.lstsq(form, column[seen], rcond=None)[0]
        left.append(np.median(np.abs(rest)))
    # of a path of a metre the uneven table leaves more than the noise of 0.25 mm, and at most millimetres
    assert np.ptp(recording.xy[np.isfinite(recording.xy[:, 0, 0]), 0, 0]) > 0.3
    assert 4e-4 < max(left) < 2e-2
    assert 5e-4 < truth["slope_rms"] < 1.5e-3 and not recording.scene.laws


def test_a_motor_lags(made) -> None:
    recording = made["motor"].recording
    t, command = recording.scene.inputs["cart"]
    v = np.gradient(np.interp(recording.t, recording.t, _whole(recording)), recording.t)
    grid = np.arange(0.0, 0.4, 0.01)
    smooth = np.convolve(v, np.ones(7) / 7, "same")[20:-20]
    match = [np.corrcoef(smooth, np.interp(recording.t[20:-20] - lag, t, command))[0, 1] for lag in grid]
    assert grid[int(np.argmax(match))] == pytest.approx(lab.LAG, abs=0.04)


def _whole(recording) -> np.ndarray:
    x = recording.xy[:, 0, 0]
    seen = np.isfinite(x)
    return np.interp(recording.t, recording.t[seen], x[seen])


def test_a_pendulum_has_both_frictions(made) -> None:
    recording, truth = made["pendulum"].recording, made["pendulum"].truth
    assert {e["name"] for e in truth["effects"]} == {"joint_drag", "joint_friction"}
    assert np.median(np.diff(recording.t)) == pytest.approx(1 / 60, rel=1e-4)
    r = np.hypot(*np.moveaxis(recording.xy[:, 0], -1, 0))
    assert np.nanmedian(r) == pytest.approx(truth["length"], rel=1e-3)
    believed = recording.scene.laws_named("pin")[0].values["length"]
    assert abs(believed / truth["length"] - 1) == pytest.approx(0.002, rel=0.1)


def test_magnets_turn_before_they_touch(made) -> None:
    recording = made["magnets"].recording
    d = np.hypot(*np.moveaxis(recording.xy[:, 0] - recording.xy[:, 1], -1, 0))
    assert 0.035 < np.nanpercentile(d, 1) < 0.12 and np.nanmax(d) > 0.25
    assert [item.name for item in recording.scene.laws] == ["contact_elastic"]


@pytest.mark.deep
def test_a_repulsion_is_found_from_pieces_where_the_scene_without_it_is_lost() -> None:
    """Magnets that turn at four radii: without what repels them they collide, and every start goes to where they do."""
    tracks = Tracks([lab.magnets(np.random.default_rng(2), "magnets-2").recording])
    tracks.recalibrate()
    base, fitter = tracks.recalibrated_fit, tracks.study.fitter
    assert base.chi2 > 100 * base.count and not fitter.segmented
    terms = [t for t in named_terms(tracks.study.cases) if t.mechanism == "distance_force"]
    signatures = make_bank(fitter, base, terms).signatures

    def told(trials: list[Trial]) -> tuple[float, float, float]:
        best = max(trials, key=lambda t: t.gain)
        s, n = best.values
        return best.gain / base.chi2, float(s), float(n)

    first = [refit(fitter, base, s, (1.0,)) for s in signatures]
    trials = [Trial(s, f, base.chi2 - f.chi2, np.inf) for s, f in zip(signatures, first, strict=True)]
    share, s, _ = told(trials)
    assert share < 0.2 and s < 0  # an attraction, of all things
    share, s, n = told(_from_pieces(fitter, base, trials, [t.term for t in trials]))
    assert share > 0.6 and s > 0 and n == pytest.approx(4.0, abs=0.8)  # drag and tilt are still missing


def test_the_command_writes_and_scores(tmp_path: Path, capsys, monkeypatch) -> None:
    monkeypatch.setattr(lab, "EXPERIMENTS", {"motor": lab.motor})
    out = tmp_path / "films"
    assert lab.main(["--out", str(out), "--count", "1"]) == 0
    (truth,) = json.loads((tmp_path / "films.json").read_text())
    assert truth["effects"] == [{"name": "actuator_lag", "values": {"tau": 0.146}}]
    assert read_recording(out / "motor-0").scene.inputs
    (tmp_path / "v" / "motor-0").mkdir(parents=True)
    verdict = {"verdict": "missing_physics", "mechanisms": [{"name": "actuator_lag"}], "rivals": [],
               "explained": {"share": 0.84}, "complete": False, "heldout": "holds"}  # fmt: skip
    (tmp_path / "v" / "motor-0" / "verdict.json").write_text(json.dumps(verdict))
    assert lab.main(["--out", str(out), "--score", str(tmp_path / "v")]) == 0
    assert "| missing_physics actuator_lag | all | 0.84 | False | holds |" in capsys.readouterr().out
    assert lab.main(["--out", str(tmp_path / "none"), "--score", str(tmp_path)]) == 2


@pytest.mark.parametrize(
    ("named", "verdict", "how"),
    [
        (["joint_drag"], "missing_physics", "right"),
        (["joint_drag", "joint_friction"], "missing_physics", "all"),
        (["linear_drag"], "missing_physics", "class"),
        (["joint_friction"], "missing_physics", "wrong"),
        (["unknown"], "unmodelled", "silent"),
    ],
)
def test_what_explains_most_is_asked_for(named, verdict, how) -> None:
    truth = {"effects": [{"name": "joint_drag"}, {"name": "joint_friction"}]}
    said = {"verdict": verdict, "mechanisms": [{"name": n} for n in named], "rivals": []}
    assert lab.judged(truth, said) == how
    assert lab.judged(truth, None) == "none"


@pytest.fixture(scope="module")
def afternoon():
    return {key: make(np.random.default_rng(5), f"{key}-5") for key, make in school.EXPERIMENTS.items()}


def test_all_are_recordings_that_can_be_read(afternoon, tmp_path) -> None:
    for name, made in afternoon.items():
        read = read_recording(write_recording(made.recording, tmp_path / name))
        assert len(read.t) > 50 and made.truth["experiment"] == name


def test_energy_is_kept_where_nothing_is_missing(afternoon) -> None:
    xy = afternoon["still"].recording.xy[:, 0]
    seen = np.isfinite(xy[:, 0])
    heights = xy[seen, 1]
    # a bob without friction comes back to where it began, again and again
    early, late = heights[: len(heights) // 2].max(), heights[len(heights) // 2 :].max()
    assert early == pytest.approx(late, abs=4e-3)
    assert not afternoon["still"].truth["effects"] and not afternoon["quiet"].truth["effects"]


def test_pucks_stay_in_their_box_and_apart() -> None:
    t = np.arange(0.0, 2.0, 1 / 240)
    rng = np.random.default_rng(1)
    p, met = school.boxed(rng, np.array([0.1, 0.1, 0.13, 0.1]), 0.003, 0.9, t)
    assert met and all(0 <= when < 2.0 for when, *_ in met)
    assert p.min() > 0.03 - 1e-4 and p.max() < 0.57 + 1e-4
    apart = [np.hypot(*(p[:, i] - p[:, j]).T).min() for i in range(4) for j in range(i)]
    assert min(apart) > 0.06 - 1e-4 and min(apart) < 0.0605


def test_nothing_and_what_no_law_is_have_no_name() -> None:
    def said(verdict: str, *names: str) -> dict:
        return {"verdict": verdict, "mechanisms": [{"name": n} for n in names]}

    nothing, other = {"effects": []}, {"effects": [{"name": "unknown"}]}
    assert lab.judged(nothing, said("no_mismatch")) == "all"
    assert lab.judged(nothing, said("missing_physics", "linear_drag")) == "wrong"
    assert lab.judged(other, said("unmodelled", "unknown")) == "all"
    assert lab.judged(other, said("missing_physics", "linear_drag")) == "wrong"
    assert lab.judged(other, said("no_mismatch")) == "silent"
