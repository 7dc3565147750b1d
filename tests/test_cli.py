"""The command line as people expect it."""

import json
import re
import subprocess
import sys

import pytest

from granswim_pymunk import __version__
from granswim_pymunk.cli import build_parser, main
from granswim_pymunk.commands import COMMANDS
from granswim_pymunk.console import did_you_mean
from granswim_pymunk.laws import all_laws


def stopped(arguments):
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    return caught.value.code


def children():
    (action,) = (a for a in build_parser()._actions if hasattr(a, "choices") and isinstance(a.choices, dict))
    return action.choices


def test_version(capsys):
    assert stopped(["--version"]) == 0
    assert capsys.readouterr().out == f"granswim_pymunk {__version__}\n"


def test_help_names_commands_and_exit_codes(capsys):
    assert stopped(["--help"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert all(name in said for name in COMMANDS)
    assert "2 wrong input" in said and "130 stopped by Ctrl-C" in said


def test_examples_in_the_help_are_commands_that_exist(capsys):
    """Every example parses, and every command that makes something has one."""
    found = 0
    for name, child in children().items():
        for line in (child.epilog or "").splitlines()[1:]:
            words = re.findall(r"'[^']*'|\S+", line.strip())
            if words[0] != "granswim":
                continue
            words = [word.strip("'") for word in words]
            if ">" in words:
                words = words[: words.index(">")]
            assert words[1] == name
            build_parser(name).parse_args(words[1:])
            found += 1
    assert found >= 20
    for name in ("run", "sweep", "diagnose", "import", "track", "export", "laws", "validate"):
        assert "examples:" in (children()[name].epilog or ""), name


@pytest.mark.parametrize(
    ("arguments", "meant"),
    [
        (["diagnos", "pendulum"], "diagnose"),
        (["--verison"], "--version"),
        (["diagnose", "pendulum", "--minuts", "3"], "--minutes"),
        (["export", "x", "--to", "parket"], "parquet"),
        (["run", "swim", "--colour", "speed"], "--color"),
    ],
)
def test_did_you_mean(arguments, meant, capsys):
    assert stopped(arguments) == 2
    said = capsys.readouterr().err
    assert f"did you mean {meant}" in said and said.count("\n") == 1


def test_nothing_is_guessed_where_nothing_is_near():
    assert did_you_mean("xyzzy", COMMANDS) == ""


def test_every_command_has_quiet_and_json():
    for name, child in children().items():
        options = {option for action in child._actions for option in action.option_strings}
        assert {"--quiet", "--json", "--help"} <= options, name


def test_json_alone_stands_on_stdout(capsys):
    assert main(["laws", "pin", "--json"]) == 0
    said = capsys.readouterr()
    (law,) = json.loads(said.out)
    assert law["name"] == "pin" and {p["name"] for p in law["parameters"]} == {"anchor", "length"}
    assert "rod" in said.err
    assert main(["laws", "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)) == len(all_laws())


def test_json_into_a_file_and_quiet(tmp_path, capsys):
    assert main(["laws", "pin", "--quiet", "--json", str(tmp_path / "a.json")]) == 0
    assert capsys.readouterr().out == ""
    assert json.loads((tmp_path / "a.json").read_text())[0]["name"] == "pin"
    assert main(["laws", "--json", str(tmp_path / "no/a.json")]) == 2
    assert "its folder does not exist" in capsys.readouterr().err


def test_figures_of_a_run_and_a_sweep(tmp_path, capfd):
    assert (
        main(["run", "two_disks", "--duration", "0.05", "--frames", "0", "--out", str(tmp_path / "r"), "--json"]) == 0
    )
    said = capfd.readouterr()
    assert json.loads(said.out)["stopped"] == "finished"
    assert "%|" not in said.err and "\x1b" not in said.err
    code = main(["sweep", "two_disks", "--vary", "seed=1,2", "--duration", "0.02", "--processes", "1", "--quiet",
                 "--out", str(tmp_path / "s"), "--json"])  # fmt: skip
    said = capfd.readouterr()
    assert code == 0 and [row["seed"] for row in json.loads(said.out)] == [1, 2]
    assert said.err == ""


def test_import_says_its_figures(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "fall.csv").write_text("t,x,y\n" + "".join(f"{k / 10},0,{1 - k * k / 20}\n" for k in range(9)))
    assert main(["import", "fall.csv", "--body", "ball:1cm:10g", "--json"]) == 0
    (found,) = json.loads(capsys.readouterr().out)
    assert found["format"] == "long" and found["frames"] == 9 and found["bodies"] == ["ball"]
    assert found["folder"] == "out/import-fall" and (tmp_path / "out/import-fall/tracks.png").is_file()


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_completion(shell, capsys):
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert "granswim" in script and "--hold-out" in script and "diagnose" in script
    if shell == "bash":
        subprocess.run(["bash", "-n"], input=script, text=True, check=True)


def test_no_colour_anywhere(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "granswim_pymunk", "laws", "pin"], capture_output=True, text=True, check=True,
        env={"NO_COLOR": "1", "PATH": "/usr/bin", "TERM": "xterm-256color", "HOME": str(tmp_path)},
    )  # fmt: skip
    assert "\x1b" not in done.stdout + done.stderr
