"""Concealed cases: nothing betrays them, seals bind, strengths are what they say, scores count right."""

import json
import os
import re
import sys
import threading
import time

import numpy as np
import pytest

from granswim_pymunk.cli import main
from granswim_pymunk.commands.prove import parse_seeds
from granswim_pymunk.errors import InputError
from granswim_pymunk.proof import prove as runner
from granswim_pymunk.proof.candidates import Sizes, typical
from granswim_pymunk.proof.cases import _public, believed_scene, bodies_case, rivals, strength_of
from granswim_pymunk.proof.conceal import MOMENT, conceal
from granswim_pymunk.proof.prove import DEVELOPMENT_SECRET, prove_cases, table_text
from granswim_pymunk.proof.score import (
    confusion,
    detection,
    figures_of_merit,
    held_out,
    is_failure,
    proportion,
    read_rows,
    score_case,
)
from granswim_pymunk.proof.seal import commitment, opened, read_secret
from granswim_pymunk.proof.setups import SETUPS
from granswim_pymunk.proof.world import World
from granswim_pymunk.recording import read_recording
from granswim_pymunk.validation import proof_pictures

SECRET = b"a secret of the tests"


@pytest.fixture(scope="module")
def pair_of_cases(tmp_path_factory):
    """The same seed with nothing, and with a strong drag, concealed in it."""
    folders = []
    for effect in ("none", "quadratic_drag"):
        out = tmp_path_factory.mktemp(effect)
        folders.append(conceal(42, out / "open", SECRET, out / "sealed", effect=effect))
    return folders


def test_cases_that_differ_in_the_sealed_part_differ_in_the_tracks_only(pair_of_cases):
    nothing, something = pair_of_cases
    truths = [
        json.loads((f.parent.parent / "sealed" / f"{f.name}.json").read_text())["truth"] for f in (nothing, something)
    ]
    assert [t["category"] for t in truths] == ["null", "mechanism"] and truths[1]["sigma"] > 1.5
    names = [sorted(p.name for p in f.iterdir()) for f in pair_of_cases]
    assert names[0] == names[1] and nothing.name == something.name
    assert (nothing / "tracks.csv").read_bytes() != (something / "tracks.csv").read_bytes()
    for a in nothing.iterdir():
        b = something / a.name
        assert a.stat().st_mode == b.stat().st_mode
        assert a.stat().st_mtime == b.stat().st_mtime == MOMENT
    # fitted numbers are those of the tracks; everything else is the same to the letter
    texts = [(f / "recording.toml").read_text() for f in pair_of_cases]
    assert not read_recording(nothing).scene.adjustable or texts[0] != texts[1]
    adjustable = [a.parameter for a in read_recording(nothing).scene.adjustable]
    masked = []
    for text in texts:
        for parameter in adjustable:
            text = re.sub(rf"^{parameter} = .*$", f"{parameter} = fitted", text, flags=re.M)
        masked.append(text)
    assert masked[0] == masked[1]
    # times of frames, order of rows and which sightings are lost are the same; so is the number of decimals
    rows = [[line.split(",") for line in (f / "tracks.csv").read_text().splitlines()[1:]] for f in pair_of_cases]
    assert [r[:2] for r in rows[0]] == [r[:2] for r in rows[1]]
    for table in rows:
        assert all(len(cell.partition(".")[2]) <= 8 for row in table for cell in row[2:] if "e" not in cell)


@pytest.mark.parametrize("seed", [13, 25])
def test_the_believed_numbers_follow_from_the_tracks_alone(seed):
    case = bodies_case(seed, DEVELOPMENT_SECRET)
    setup, public = _public(DEVELOPMENT_SECRET, seed)
    public.random()  # whether the noise is known
    seen = case.recording.angle if setup.angles else case.recording.xy.reshape(len(setup.t), -1)
    again = believed_scene(setup, np.array(seen), public)
    assert again.laws == case.recording.scene.laws
    assert case.recording.scene.adjustable


def test_a_seal_binds_and_needs_the_secret(tmp_path, pair_of_cases):
    folder = pair_of_cases[1]
    published = (folder.parent / f"{folder.name}.sha256").read_text()
    sealed = json.loads((folder.parent.parent / "sealed" / f"{folder.name}.json").read_text())
    assert opened(sealed, published)["effects"][0]["name"] == "quadratic_drag"
    sealed["truth"]["effects"][0]["values"]["c"] *= 1.0001
    with pytest.raises(InputError, match="hash"):
        opened(sealed, published)
    # the same seed under another secret is another case, and the truth alone does not give its hash
    other = conceal(42, tmp_path / "open", b"another secret of the tests", tmp_path / "sealed")
    assert (other / "tracks.csv").read_bytes() != (folder / "tracks.csv").read_bytes()
    truth = json.loads((tmp_path / "sealed" / f"{other.name}.json").read_text())["truth"]
    assert commitment("", truth) != (tmp_path / "open" / f"{other.name}.sha256").read_text().strip()
    assert not any("sha256" in p.name or "seal" in p.name for p in other.iterdir())


def test_the_users_secret_is_made_once_and_for_him_alone(tmp_path, monkeypatch):
    monkeypatch.setenv("GRANSWIM_SECRET", str(tmp_path / "data" / "secret"))
    first = read_secret()
    assert read_secret() == first and len(first) >= 32
    assert (tmp_path / "data" / "secret").stat().st_mode & 0o077 == 0
    (tmp_path / "short").write_text("abc")
    with pytest.raises(InputError, match="bytes"):
        read_secret(tmp_path / "short")
    with pytest.raises(InputError, match="cannot be read"):
        read_secret(tmp_path / "missing")


def test_conceal_refuses_what_would_spoil_the_proof(tmp_path, capsys):
    with pytest.raises(InputError, match="elsewhere"):
        conceal(1, tmp_path, SECRET, tmp_path)
    assert list(tmp_path.iterdir()) == []
    arguments = ["conceal", "--seed", "6", "--out", str(tmp_path / "a"), "--secret", str(tmp_path / "s")]
    (tmp_path / "s").write_bytes(SECRET)
    assert main(arguments) == 0
    assert main(arguments) == 2
    assert "before" in capsys.readouterr().err
    assert main([*arguments, "--effect", "telekinesis"]) == 2


@pytest.mark.parametrize("name", sorted(SETUPS))
def test_every_apparatus_makes_a_recording_that_can_be_read(name, tmp_path, monkeypatch):
    monkeypatch.setattr("granswim_pymunk.proof.cases.draw_setup", SETUPS[name])
    folder = conceal(5, tmp_path / "open", SECRET, tmp_path / "sealed", effect="none")
    recording = read_recording(folder)
    assert len(recording.t) >= 40
    assert recording.title == "concealed case"


def test_strength_grows_with_the_effect_and_adjustables_take_theirs_away():
    setup = SETUPS["table"](np.random.default_rng(4))
    while not setup.scene.adjustable:
        setup = SETUPS["table"](np.random.default_rng(len(setup.t)))
    start = World(setup.scene, [], setup.dt).start()
    sizes = Sizes(setup)
    force = typical("uniform_force", setup, sizes)
    weak, strong = (strength_of(setup, setup.scene, [force.scaled(f, "a")], start) for f in (0.1, 0.2))
    assert strong == pytest.approx(2 * weak, rel=0.05)
    # a second drag like the adjustable one is imitated altogether
    assert strength_of(setup, setup.scene, [typical("linear_drag", setup, sizes)], start) < 1e-3
    assert strength_of(setup, setup.scene, [typical("quadratic_drag", setup, sizes)], start) > 1.0


def test_rivals_that_are_one_and_the_same_have_no_d_prime():
    setup = SETUPS["pendulum"](np.random.default_rng(1))
    start = World(setup.scene, [], setup.dt).start()
    tilt = typical("camera_tilt", setup, Sizes(setup))
    sigma = strength_of(setup, setup.scene, [tilt], start)
    found = rivals(setup, setup.scene, [tilt], start, sigma)
    assert sigma > 20
    assert found.rivals["uniform_force"] < 0.1 * sigma  # a turned picture is a turned gravity
    assert found.rivals["quadratic_drag"] > 0.5 * sigma


def result(category="mechanism", effect="linear_drag", named="linear_drag", verdict="missing_physics", **changed):
    """A result as ``prove`` writes it, made up."""
    values = {"c": 0.01, "p": 0}
    effects = [{"name": effect, "values": values, "bodies": None, "other": {}}] if effect else []
    truth = {
        "seed": 1, "setup": "table", "category": category, "effects": effects, "bodies": ["a", "b"] if effect else [],
        "sigma": 20.0 if effect else 0.0, "own": 0.0, "rivals": {"quadratic_drag": 4.0, "ambient_flow": 1.0},
    }  # fmt: skip
    mechanisms = [
        {"name": named, "bodies": ["a", "b"],
         "parameters": {"c": {"value": 0.0101, "low": 0.0098, "high": 0.0104}, "p": {"value": 0}}}
    ] if named else []  # fmt: skip
    answer = {
        "verdict": verdict, "mechanisms": mechanisms, "rivals": [], "mismatch": [{"bodies": ["a"]}],
        "fit": {"heldout": {"naive": 9.0, "recalibrated": 6.0, "revised": 1.05, "noise_floor": 1.0}},
        "null": {"p_false_alarm": 0.01},
    }  # fmt: skip
    made = {"case": "bodies-1", "truth": truth, "verdict": answer, "seconds": 3.0, "failed": "", "commitment": "0" * 64}
    made["truth"].update(changed)
    return made


def test_a_right_answer_scores_in_every_column():
    row = score_case(result())
    assert row.eligible is False  # an ambient flow cannot be told from it
    row = score_case(result(rivals={"quadratic_drag": 4.0}))
    assert (row.right_name, row.right_class, row.located, row.eligible) == (True, True, True, True)
    assert row.covered == (True,) and row.errors["c"] == pytest.approx(0.01)
    assert held_out([row]) == {"n": 1.0, "naive": 9.0, "recalibrated": 6.0, "revised": 1.05, "revised_known": 1.05}
    assert not is_failure(row)


def test_wrong_answers_score_as_such():
    wrong = score_case(result(named="quadratic_drag"))
    assert (wrong.right_name, wrong.right_class, wrong.covered) == (False, False, ())
    assert is_failure(wrong)
    replicate = score_case(result(named="ambient_flow"))
    assert (replicate.right_name, replicate.right_class) == (False, True)
    silent = score_case(result(named="", verdict="no_mismatch"))
    assert (silent.right_class, silent.located) == (False, None)
    elsewhere = score_case(result(bodies=["b"]))
    assert elsewhere.located is False
    alarm = score_case(result("null", effect="", named="linear_drag"))
    assert alarm.physics_named and is_failure(alarm)
    camera = score_case(result("null", effect="", named="camera_scale", verdict="measurement"))
    assert not camera.physics_named and is_failure(camera)
    lost = score_case({**result(), "verdict": None, "failed": "it fell over"})
    assert lost.verdict == "failed" and is_failure(lost)
    outside = score_case(result("outside", effect="attraction", named="unknown", verdict="unmodelled"))
    assert outside.right_name and not outside.physics_named


def test_a_table_of_scores_is_read_as_it_was_written(tmp_path, capsys):
    rows = [
        score_case(result(rivals={"quadratic_drag": 4.0})),
        score_case(result("null", effect="", named="", verdict="no_mismatch")),
        score_case({**result(), "verdict": None, "failed": "it fell over"}),
    ]
    table = tmp_path / "score.csv"
    table.write_text(table_text(rows))
    read = read_rows(table)
    assert table_text(read) == table_text(rows)
    assert read[0].eligible and read[0].covered == (True,) and read[1].located is None
    # its figures, and an error that says where
    assert proof_pictures.main([str(table), "--bodies", str(table), "--out", str(tmp_path)]) == 0
    assert len(list(tmp_path.glob("proof_bodies_*.png"))) == 4 and not list(tmp_path.glob("proof_beds_*.png"))
    table.write_text(table_text(rows).replace(",20,", ",twenty,"))
    assert proof_pictures.main([str(table), "--bodies", str(table), "--out", str(tmp_path)]) == 2
    assert "score.csv: row 2: " in capsys.readouterr().err


def test_figures_count_the_cases_they_speak_of():
    good = score_case(result(rivals={"quadratic_drag": 4.0}))
    bad = score_case(result(rivals={"quadratic_drag": 4.0}, named=None) | {"verdict": None})
    null = score_case(result("null", effect="", named="", verdict="no_mismatch"))
    merit = figures_of_merit([good] * 9 + [bad] + [null] * 4)
    assert (merit[0].hits, merit[0].n, merit[0].reached) == (9, 10, True)
    assert (merit[3].hits, merit[3].n, merit[3].reached) == (0, 4, True)
    assert merit[4].share is None and merit[4].reached is None
    truths, answers, table = confusion([good, null])
    assert (truths, answers) == (["linear_drag", "none"], ["linear_drag", "none"])
    assert table.tolist() == [[1, 0], [0, 1]]
    assert detection([good, null]) == [(16, 30, 1, 1, 1)]
    assert proportion(0, 20)[2] == pytest.approx(0.1684, abs=1e-4)  # Clopper & Pearson
    assert proportion(0, 0) is None


def test_prove_scores_a_seed_once_and_goes_on_where_it_stopped(tmp_path, monkeypatch):
    given = []

    def prove(seeds):
        return prove_cases([("bodies", seed) for seed in seeds], tmp_path)

    def fake(recordings, keep, minutes=None):
        # the folder holds a recording and nothing that betrays it
        given.append(sorted(p.name for p in recordings[0].iterdir()))
        return {"verdict": result(named="", verdict="no_mismatch")["verdict"], "seconds": 1.0, "failed": ""}

    monkeypatch.setattr(runner, "diagnose_alone", fake)
    first = prove([6, 13])
    again = prove([6, 13, 15])
    assert [len(first), len(again), len(given)] == [2, 3, 3]
    assert given[0] == ["recording.toml", "tracks.csv"]
    assert (tmp_path / "proof.html").stat().st_size > 20_000
    assert (tmp_path / "score.csv").read_text().count("\n") == 4
    with pytest.raises(InputError, match="once"):
        prove([6, 6])
    with pytest.raises(InputError, match="secret"):
        prove([1000])
    # a truth that was changed after its hash was published is noticed
    file = tmp_path / "sealed" / "bodies-6.json"
    file.write_text(file.read_text().replace('"null"', '"pair"'))
    (tmp_path / "results" / "bodies-6.json").unlink()
    with pytest.raises(InputError, match="hash"):
        prove([6])


@pytest.mark.parametrize("code", [130, 143, -15])
def test_a_diagnosis_that_somebody_stopped_is_no_result(code, tmp_path, monkeypatch):
    monkeypatch.setattr(runner, "_run", lambda *given: (code, "granswim diagnose: interrupted"))
    with pytest.raises(InputError, match="stopped"):
        prove_cases([("bodies", 6)], tmp_path)
    assert not list(tmp_path.glob("results/*"))
    monkeypatch.setattr(runner, "_run", lambda *given: (2, "granswim diagnose: no frames"))
    assert prove_cases([("bodies", 6)], tmp_path)[0].failed == "granswim diagnose: no frames"


def test_a_diagnosis_that_is_begun_after_all_was_stopped_ends_at_once(tmp_path, monkeypatch):
    """A case that is still being drawn at SIGTERM goes on to its diagnosis, for which prove would wait."""
    monkeypatch.setattr(runner, "_GONE", threading.Event())
    runner._GONE.set()
    began = time.monotonic()
    code, _ = runner._run([sys.executable, "-c", "import time; time.sleep(60)"], str(tmp_path), os.environ)
    assert code in runner.STOPPED and time.monotonic() - began < 30 and not runner._RUNNING


def test_seeds_are_ranges_and_numbers():
    assert parse_seeds("1000-1003,1010") == [1000, 1001, 1002, 1003, 1010]
    with pytest.raises(InputError, match="1000-1019"):
        parse_seeds("ten")


@pytest.mark.long  # a cart on springs, a minute of a processor
def test_two_laws_are_both_named_where_another_drag_comes_first_alone(tmp_path):
    # a seed of a series that is over; its secret is published
    secret = b"bf9da10e2ae368c7473603a22640460b5fb1a64f0a476855b9c95139b282035a"
    folder = conceal(1004, tmp_path / "open", secret, tmp_path / "sealed")
    published = (tmp_path / "open" / "bodies-1004.sha256").read_text()
    truth = opened(json.loads((tmp_path / "sealed" / "bodies-1004.json").read_text()), published)
    verdict = runner.diagnose_alone([folder], None)["verdict"]
    assert {m["name"] for m in verdict["mechanisms"]} == {e["name"] for e in truth["effects"]}
    held = verdict["fit"]["heldout"]
    assert held["revised"] < 1.3 * held["noise_floor"] < 0.2 * held["naive"]


def test_a_concealed_drag_is_found_by_a_process_of_its_own(tmp_path, capsys):
    file = tmp_path / "score.json"
    assert main(["prove", "--seeds", "25", "--out", str(tmp_path / "out"), "--json", str(file)]) == 0
    case = json.loads(file.read_text())["cases"][0]
    assert case["truth"] == "linear_drag" and case["right_class"] == 1 and case["failed"] == ""
    assert (tmp_path / "out" / "reports" / "bodies-25" / "report.html").stat().st_size > 10_000
    assert "right name first" in capsys.readouterr().out
