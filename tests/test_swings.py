"""Two arms followed in windows: what is left of the error without friction."""

from __future__ import annotations

import pytest

from granswim_pymunk.inference.candidates import named_terms
from granswim_pymunk.inference.data import prepare
from granswim_pymunk.validation import swings

VISCOUS = {"viscous": ("joint_drag (each body)",)}


def first_seconds(tmp_path, seconds: float):
    lines = swings.shipped().read_text(encoding="utf-8").splitlines()
    file = tmp_path / "swing.csv"
    file.write_text("\n".join(lines[: 1 + int(200 * seconds)]) + "\n", encoding="utf-8")
    return file


def test_friction_takes_most_of_the_error_of_windows_away(tmp_path, capsys):
    file = first_seconds(tmp_path, 3.0)
    assert swings.main(["--source", str(file), "--json", str(tmp_path / "n.json")], VISCOUS) == 0
    head, _, nothing, viscous = capsys.readouterr().out.strip().splitlines()
    assert head.count("|") == 4  # windows of 4 s are longer than what was held out
    assert nothing.startswith("| nothing |") and "N m s" in viscous
    assert float(viscous.split("|")[3]) < 0.5
    assert (tmp_path / "n.json").read_text().count('"name"') == 2


def test_the_whole_swing_comes_with_the_package():
    recording = swings.import_double_pendulum(swings.shipped())
    assert recording.t[-1] == pytest.approx(48.0) and not recording.scene.laws_named("joint_drag")


def test_every_law_of_the_table_is_a_candidate():
    case = prepare(swings.import_double_pendulum(swings.shipped()), held_out=False, split=True)
    known = {t.label for t in named_terms([case])}
    assert {label for labels in swings.LAWS.values() for label in labels} <= known


def test_what_is_no_table_is_one_line(tmp_path, capsys):
    file = tmp_path / "no.csv"
    file.write_text("a,b\n1,2\n")
    assert swings.main(["--source", str(file)]) == 2
    error = capsys.readouterr().err.strip().splitlines()
    assert len(error) == 1 and "no.csv" in error[0]
