"""What the nonsense of benchmarks/fuzz.py found, one test each."""

import io
import json

import numpy as np
import pytest

from granswim_pymunk.benchmarks.fuzz_inputs import checkpoint_seed, table_seeds
from granswim_pymunk.cli import main
from granswim_pymunk.engine.checkpoint import FIELDS, _digest
from granswim_pymunk.recording import read_recording


def refused(argv, message, capsys):
    assert main([str(part) for part in argv]) == 2
    err = capsys.readouterr().err
    assert message in err and err.strip().count("\n") == 0 and "Traceback" not in err


class TestImport:
    TABLE = "t,body,x,y\n" + "".join(f"{k / 10},a,{0.1 * k},0.2\n" for k in range(8))

    def given(self, tmp_path, *more):
        return ["import", tmp_path / "table.csv", "--out", tmp_path / "out", "--body=a:5mm:10g", *more]

    def test_a_title_that_is_no_formula(self, tmp_path, capsys):
        (tmp_path / "table.csv").write_text(self.TABLE)
        assert main([str(part) for part in self.given(tmp_path, "--title=$\\frac{$")]) == 0
        assert read_recording(tmp_path / "out").title == "$\\frac{$"

    def test_a_cell_of_very_many_letters(self, tmp_path, capsys):
        (tmp_path / "table.csv").write_text(self.TABLE + "x" * 200_000 + "\n")
        refused(self.given(tmp_path), "table.csv", capsys)

    def test_more_lines_skipped_than_there_are(self, tmp_path, capsys):
        (tmp_path / "table.csv").write_text(self.TABLE)
        refused(self.given(tmp_path, f"--skip-rows={10**20}"), "skip rows: has 9 lines", capsys)

    def test_a_damaged_trajectory(self, tmp_path, capsys):
        whole = dict(table_seeds())["run.h5"]
        damaged = 0
        for at in range(0, len(whole), 97):
            (tmp_path / "table.csv").write_bytes(whole[:at] + b"\x9a" * 7 + whole[at + 7 :])
            code = main([str(part) for part in self.given(tmp_path)])
            assert code in (0, 2)
            err = capsys.readouterr().err.strip()
            damaged += "is damaged" in err
            assert "\n" not in err
        assert damaged


class TestRun:
    def test_an_option_whose_value_is_a_double_dash(self, tmp_path, capsys):
        refused(["diagnose", "pendulum", "--out", tmp_path / "o", "--minutes=--"], "--minutes: needs a value", capsys)

    @pytest.mark.parametrize(
        ("more", "says"),
        [
            (["--duration=1e300"], "steps of"),
            (["--duration=1", "--dt=1e-300"], "steps of"),
            (["--duration=1e-3", "--frames=1000000000000"], "1e+12 pictures"),
            (["--duration=1", "--fps=1e15"], "1e+15 pictures"),
        ],
    )
    def test_more_than_can_be_run_or_stored(self, tmp_path, capsys, more, says):
        refused(["run", "two_disks", "--out", tmp_path / "o", "--video=none", *more], says, capsys)


class TestCheckpoint:
    """A sum that fits does not make sense of what it is the sum of."""

    @pytest.mark.parametrize("change", [
        {"begun": None}, {"units": 3}, {"dt": "x"}, {"dt": "0x0p+0"}, {"scene": "title = 3"}, {"scene": None},
        {"random": {"bit_generator": "seed"}}, {"random": {"bit_generator": "PCG64"}}, {"step": "x"}, {"note": []},
        {"mode": "none"}, {"start": None},
    ])  # fmt: skip
    def test_refused(self, tmp_path, capsys, change):
        with np.load(io.BytesIO(checkpoint_seed())) as archive:
            data = {name: archive[name] for name in archive.files}
        about = json.loads(str(data["about"])) | change
        about = {key: value for key, value in about.items() if key != "begun" or value is not None}
        data["about"] = np.array(json.dumps(about))
        data["sum"] = np.array(_digest(str(data["about"]), {name: data[name] for name in FIELDS}))
        (tmp_path / "run").mkdir()
        np.savez(tmp_path / "run" / "checkpoint.npz", **data)
        refused(["run", "--resume", tmp_path / "run"], "the checkpoint is damaged", capsys)
