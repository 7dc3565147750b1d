"""Tables of known effects in beds: every line is kept as it is done, and says which code made it."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

import pytest

from granswim_pymunk.inference.result import empty_verdict
from granswim_pymunk.validation import bed_effects, unseen_effects, unseen_nulls
from granswim_pymunk.validation.bed_effects import Row

ROWS = (Row("linear_drag", {"c": 6e-5}, number=("c", 6e-5)), Row("nothing", {}, "no_mismatch"))


@pytest.fixture
def diagnosed(monkeypatch) -> list[str]:
    """Diagnoses that take no time: which recordings were asked for. The second one that is asked is interrupted."""
    asked: list[str] = []

    def fake(recordings, out, minutes):
        asked.append(recordings[0].name)
        if len(asked) == 2:
            raise KeyboardInterrupt
        verdict = empty_verdict("no_mismatch", "m rms") | {"null": {"p_false_alarm": 0.5, "replicates": 299}}
        return {"verdict": verdict, "seconds": 900, "cpu": 212, "code": bed_effects.code(), "commit": "0a1b2c3d"}

    monkeypatch.setattr(bed_effects, "diagnosed", fake)
    return asked


def run(out: Path, *names: str) -> None:
    args = bed_effects.table_parser("", 15.0).parse_args([*names, "--out", str(out), "--page", str(out / "page.md")])
    made = lambda row, number, folder: [folder / row.name]  # noqa: E731
    bed_effects.run_table(args, ROWS, made, "Title", "bed_effects", ("About.",), lambda text: None)


def test_a_number_believed_off_may_be_told_where_nothing_is_missing():
    verdict = empty_verdict("recalibrate", "m rms")
    assert bed_effects.judged(ROWS[1], verdict)[0] == "class"
    assert bed_effects.judged(Row("stiffness off", {}, "recalibrate"), verdict)[0] == "right"
    assert bed_effects.judged(ROWS[0], verdict)[0] == "wrong"


def test_a_law_that_is_claimed_beside_the_right_one_is_wrong():
    verdict = empty_verdict("missing_physics", "m rms")
    entries = [{"name": name, "parameters": {}} for name in ("linear_drag", "added_mass")]
    verdict["rivals"] = []
    assert bed_effects.judged(ROWS[0], verdict | {"mechanisms": entries[:1]})[0] == "right"
    assert bed_effects.judged(ROWS[0], verdict | {"mechanisms": entries})[0] == "wrong"


def test_an_interrupted_table_goes_on_where_it_stopped(diagnosed, tmp_path):
    with pytest.raises(KeyboardInterrupt):
        run(tmp_path)
    page = (tmp_path / "page.md").read_text()
    assert "| linear drag (c = 6e-05) | no_mismatch |" in page and "nothing" not in page and "| 900 | 212 |" in page
    run(tmp_path)
    assert diagnosed == ["linear_drag", "nothing", "nothing"]
    page = (tmp_path / "page.md").read_text()
    assert "Right: 1 of 2" in page and "wrong: 1" in page


def test_lines_of_other_code_stay_until_they_are_run_again(diagnosed, tmp_path):
    diagnosed += ["so that none", "is interrupted"]
    run(tmp_path, "linear_drag")
    file = tmp_path / "results" / "linear_drag.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {"code": "earlier", "commit": "99999999"}))
    run(tmp_path, "nothing")
    page = (tmp_path / "page.md").read_text()
    assert "| 99999999 | wrong |" in page and "| 0a1b2c3d | right |" in page and "Right: 1 of 2" in page
    run(tmp_path)
    assert diagnosed[2:] == ["linear_drag", "nothing", "linear_drag"]
    assert "99999999" not in (tmp_path / "page.md").read_text()
    run(tmp_path)
    assert len(diagnosed) == 5


def test_rows_without_a_result_are_run_before_those_of_other_code(diagnosed, tmp_path):
    diagnosed += ["so that none", "is interrupted"]
    run(tmp_path, "linear_drag")
    file = tmp_path / "results" / "linear_drag.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {"code": "earlier"}))
    run(tmp_path)
    assert diagnosed[2:] == ["linear_drag", "nothing", "linear_drag"]


def test_lines_of_a_page_stay_where_the_folder_has_no_result(diagnosed, tmp_path):
    diagnosed += ["so that none", "is interrupted"]
    run(tmp_path, "linear_drag")
    before = (tmp_path / "page.md").read_text()
    (tmp_path / "results" / "linear_drag.json").unlink()
    run(tmp_path, "nothing")
    page = (tmp_path / "page.md").read_text()
    (line,) = [x for x in before.splitlines() if x.startswith("| linear drag")]
    assert line in page and "Right: 1 of 2" in page and "wrong: 1" in page
    (tmp_path / "page.md").write_text(page.replace("About.", "Something else."))
    run(tmp_path, "nothing")
    assert "linear drag" not in (tmp_path / "page.md").read_text()


def test_the_commit_of_a_checkout_and_of_none(tmp_path, monkeypatch):
    subprocess.run(["git", "init", "-q"], cwd=tmp_path, check=True)
    (tmp_path / "__init__.py").write_text("")
    monkeypatch.setattr(bed_effects.granswim_pymunk, "__file__", str(tmp_path / "__init__.py"))
    assert bed_effects.commit() == "–"
    who = ["-c", "user.name=a", "-c", "user.email=a@b.c"]
    subprocess.run(["git", "add", "."], cwd=tmp_path, check=True)
    subprocess.run(["git", *who, "commit", "-qm", "first"], cwd=tmp_path, check=True)
    assert re.fullmatch("[0-9a-f]{8,}", bed_effects.commit())
    (tmp_path / "__init__.py").write_text("changed = True")
    assert re.fullmatch("[0-9a-f]{8,}[+]", bed_effects.commit())


def test_a_swimmer_alone_is_asked_for_every_effect_that_acts_on_it(diagnosed, tmp_path, monkeypatch):
    made = lambda row, number, folder, small, only: [folder / f"{number:02d}" / f"film-{only}"]  # noqa: E731
    monkeypatch.setattr(unseen_effects, "make", made)
    diagnosed += ["", ""]
    assert unseen_effects.main(["cohesion", "--film", "2", "--out", str(tmp_path)], lambda text: None) == 0
    assert [f.name for f in tmp_path.glob("film-2/results/*")] == ["cohesion.json"] and diagnosed[-1] == "film-2"
    assert len({row.name for row in unseen_effects.ROWS if row.verdict == "missing_physics"}) >= 14


def test_nulls_of_a_swimmer_alone_are_kept_and_told(tmp_path, monkeypatch):
    asked = []

    def fake(recordings, minutes):
        asked.append(recordings)
        verdict = empty_verdict("no_mismatch", "m rms") | {"null": {"p_false_alarm": 0.5, "replicates": 299}}
        spent = {"seconds": 9, "cpu": 3, "code": bed_effects.code(), "commit": "0a1b2c3d"}
        return {"verdict": verdict, "z": 0.1 * len(asked), **spent}

    made = lambda row, number, folder, small, only=None, bed=0: [(row.moved, number, small, only, bed)]  # noqa: E731
    monkeypatch.setattr(unseen_effects, "make", made)
    monkeypatch.setattr(unseen_nulls, "diagnosed", fake)
    given = ["--out", str(tmp_path), "--small", "7", "--full", "2", "--page", str(tmp_path / "page.md")]
    for _ in range(2):
        assert unseen_nulls.main(given, lambda text: None) == 0
    assert len(asked) == 9  # each once
    moved, _, small, only, bed = zip(*(a[0] for a in asked), strict=True)
    assert [bool(m) for m in moved[:7]] == [False, False, True, False, False, True, False]
    assert bed == (100,) * 6 + (101, 0, 0) and small == (True,) * 7 + (False,) * 2 and only[-1] == 2
    page = (tmp_path / "page.md").read_text()
    assert "| full | 2 | 0" in page and "| small | 7 | 0" in page and "| small beds | 7 | 0.40" in page
