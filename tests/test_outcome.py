"""What diagnoses of beds hand over: a verdict of the contract, scenes that run, a page that needs nothing beside it."""

import json
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from granswim_pymunk.diagnosis.diagnose import kind_of, verdict_of
from granswim_pymunk.diagnosis.outcome import (
    Outcome,
    Table,
    check_verdict,
    empty_verdict,
    mechanism_entry,
    mismatch_entry,
    write_outcome,
)
from granswim_pymunk.errors import InputError
from granswim_pymunk.recording import Recording
from granswim_pymunk.scene import Bed, Body, Scene, read_scene, swimmer


@pytest.fixture
def outcome() -> Outcome:
    verdict = empty_verdict("missing_physics")
    flow = ([0.1, 0.2], [0.0, 0.1], [0.2, 0.3], "m/s")
    parameters = {"mu": (0.3, 0.28, 0.32, "1"), "p": (0, None, None, "1"), "u": flow}
    verdict["mechanisms"] = [
        mechanism_entry("contact_friction", "F_t = -mu F_n sign(v_t)", ["0", "1"], parameters, 0.9, np.float64(12.5))
    ]
    verdict["mismatch"] = [mismatch_entry(["6"], np.float64(9.0), 1e-9, region="tail", phase=(0.1, 0.3))]
    verdict["fit"]["train"]["naive"] = 1e-4
    verdict["fit"]["heldout"]["revised"] = float("nan")
    verdict["rivals"] = [{"name": "linear_drag", "gain_heldout": 3.0, "indistinguishable": False}]
    verdict["null"] = {"p_false_alarm": 0.01, "replicates": 99}
    figure = Figure()
    figure.subplots().plot([0, 1], [1, 0])
    scene = Scene((Body("a", "free", 1e-3, 1e-4, True, (0.0, 0.0, 0.1, 0.0)),))
    return Outcome(
        verdict, {"one": (scene, {}), "two": (scene, {"scale": 1.01})}, "The scene leaves out friction in <contacts>.",
        [("Where?", "At the tail."), ("How sure?", "Very.")], {"map": (figure, "Where it is. Red is much.")},
        [Table("Cases", ["name", "z"], [["a & b", "3"]], numeric=(1,))], ["a note"], ["one", "two"], seed=3,
    )  # fmt: skip


def test_files_of_an_outcome(outcome, tmp_path):
    write_outcome(outcome, tmp_path)
    verdict = json.loads((tmp_path / "verdict.json").read_text())
    assert verdict["fit"]["heldout"]["revised"] is None and verdict["mechanisms"][0]["gain_heldout"] == 12.5
    assert verdict["notes"] == ["a note"] and verdict["mismatch"][0]["when"]["phase"] == [0.1, 0.3]
    assert read_scene(tmp_path / "revised" / "two.toml").camera == {"scale": 1.01}
    assert read_scene(tmp_path / "revised.toml").bodies[0].id == "a"
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    for text in ("&lt;contacts&gt;", "a &amp; b", "At the tail.", "[95 %: ", "tail", "Rivals"):
        assert text in page
    assert "http" not in page and page.count("<img") == 1 and "None" not in page
    assert [p.name for p in (tmp_path / "figures").iterdir()] == ["map.png"]
    # a later outcome leaves nothing of this one
    write_outcome(replace(outcome, figures={}), tmp_path)
    assert not list((tmp_path / "figures").iterdir())


def test_verdicts_that_say_too_little_are_refused(outcome):
    check_verdict(verdict_of(outcome))
    for change in (
        {"verdict": "perhaps"},
        {"mechanisms": []},
        {"fit": {"train": {}, "heldout": {}, "unit": "m rms"}},
        {"mismatch": [mismatch_entry([], 3.0, 0.1)]},
    ):
        with pytest.raises(ValueError):
            check_verdict({**outcome.verdict, **change})


def test_folder_that_cannot_be_written_to_is_named(outcome, tmp_path):
    (tmp_path / "figures").write_text("a file where a folder should be")
    with pytest.raises(InputError, match="cannot be written"):
        write_outcome(outcome, tmp_path)
    assert not (tmp_path / "verdict.json").exists()


def test_kinds_of_recordings():
    def recording(name: str, scene: Scene, frames: int = 3) -> Recording:
        n = sum(b.observed for b in scene.bodies)
        ids = tuple(b.id for b in scene.bodies if b.observed)
        return Recording(name=name, scene=scene, t=np.arange(frames) * 0.1, ids=ids, xy=np.zeros((frames, n, 2)))

    chain = tuple(swimmer())
    grain = Body("g", "grain", 1e-3, 1e-5, True, (0.0, 0.05, 0.0, 0.0))
    alone = recording("alone", Scene(chain))
    seen = recording("seen", Scene((*chain, grain)))
    hidden = recording("hidden", Scene((*chain, replace(grain, observed=False))))
    bed = recording("bed", Scene(chain, bed=Bed(0.03, 0.8, (2e-3, 3e-3), 2500.0)))
    assert [kind_of([r]) for r in (alone, seen, hidden, bed)] == ["bodies", "bed", "unseen", "unseen"]
    assert kind_of([hidden, bed]) == "unseen"
    with pytest.raises(InputError, match="recording seen: shows a bed that is seen, alone bodies without a bed"):
        kind_of([alone, seen])
