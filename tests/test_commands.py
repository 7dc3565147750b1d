"""What all commands have in common: quick to start, quiet when interrupted, their output tried first."""

import importlib
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from granswim_pymunk.cli import build_parser, command_module, in_one_line, main
from granswim_pymunk.commands import COMMANDS
from granswim_pymunk.files import claimed

HEAVY = {"numba", "matplotlib", "scipy", "pymunk", "xarray", "h5py", "pandas", "numpy"}


def imported(*arguments: str) -> set[str]:
    """What a command imports before it has done anything."""
    text = (
        "import sys\nfrom granswim_pymunk.cli import main\n"
        f"try:\n    main({list(arguments)!r})\nexcept SystemExit:\n    pass\n"
        "print('|', *sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, timeout=60, check=True)
    return set(run.stdout.rpartition("|")[2].split())


def test_help_imports_nothing_heavy() -> None:
    assert not imported("--help") & HEAVY
    for name in ("run", "sweep", "diagnose", "prove", "validate", "laws", "cache"):
        assert not imported(name, "--help") & HEAVY, name


def test_help_lists_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--help"])
    said = capsys.readouterr().out
    for name in COMMANDS:
        assert re.search(rf"^    {name}\s", said, re.MULTILINE) and command_module(name).HELP.split()[0] in said


def test_choices_are_those_of_the_package() -> None:
    from granswim_pymunk.paper.plans import SETTINGS

    (setting,) = (a for a in build_parser("paper")._subparsers._group_actions[0].choices["paper"]._actions  # type: ignore
                  if a.dest == "setting")  # fmt: skip
    assert set(setting.choices) == set(SETTINGS)
    for name in COMMANDS:
        module = command_module(name)
        arguments = {a.dest for a in build_parser(name)._subparsers._group_actions[0].choices[name]._actions}  # type: ignore
        assert {*getattr(module, "FOLDERS", ()), *getattr(module, "FILES", ())} <= arguments
        for needed in getattr(module, "NEEDS", ()):
            assert importlib.util.find_spec(f"granswim_pymunk.{needed}")


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("sweep", ["two_disks", "--vary", "seed=1,2", "--out", "{}"]),
        ("conceal", ["--seed", "1", "--out", "{}"]),
        ("conceal", ["--seed", "1", "--out", "here", "--sealed", "{}"]),
        ("prove", ["--out", "{}"]),
        ("prove", ["--json", "{}"]),
        ("import", ["whatever.csv", "--out", "{}"]),
        ("export", ["whatever", "--to", "csv", "--out", "{}"]),
        ("validate", ["--out", "{}"]),
        ("validate", ["--json", "{}"]),
        ("crosscheck", ["bed_9Hz", "--json", "{}"]),
        ("benchmark", ["--json", "{}"]),
        ("paper", ["--out", "{}"]),
        ("paper", ["--json", "{}"]),
    ],
)
@pytest.mark.parametrize("place", ["file", "long"])
def test_output_is_tried_before_the_work(
    name: str, arguments: list[str], place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    (tmp_path / "file").write_text("")
    out = tmp_path / "file" / "out" if place == "file" else tmp_path / ("x" * 300)
    monkeypatch.chdir(tmp_path)
    module = command_module(name)
    began = []
    if name != "sweep":  # whose folder has a default
        monkeypatch.setattr(module, "main", lambda args: began.append(args) or 0)
    assert main([name, *(text.format(out) for text in arguments)]) == 2
    error = capsys.readouterr().err
    assert not began and str(out) in error and "Traceback" not in error and len(error.splitlines()) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_a_second_diagnosis_into_one_folder_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Else the report of one would stand beside the verdict of the other."""
    with claimed(tmp_path / "out"):
        assert main(["diagnose", "two_disk_spin", "--out", str(tmp_path / "out")]) == 2
    assert "another program is writing to this folder" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


STARTED = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # which a shell's background jobs ignore
from granswim_pymunk.__main__ import main
print("loading", flush=True)
sys.argv = ["granswim", "run", "pocket_swim", "--out", sys.argv[1]]
sys.exit(main())
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("after", [0.0, 0.2, 0.6])
def test_interrupted_while_it_starts(after: float, number: signal.Signals, tmp_path: Path) -> None:
    """No traceback, whatever is being imported."""
    command = [sys.executable, "-c", STARTED, str(tmp_path / "out")]
    run = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert run.stdout and run.stdout.readline() == "loading\n"
    time.sleep(after)
    run.send_signal(number)
    said, error = run.communicate(timeout=60)
    if number == signal.SIGTERM and run.returncode == -number:
        return  # nothing of ours was loaded
    assert run.returncode == 128 + number, (said, error)
    assert "Traceback" not in said + error and "interrupted" in error


ENDING = """
import signal, sys, threading, time
from granswim_pymunk.cli import _terminate, at_the_end
signal.signal(signal.SIGTERM, _terminate)
threading.Thread(target=time.sleep, args=(60,)).start()  # as one that is in the middle of a long run
print("ending", flush=True)
sys.exit(at_the_end(143))
"""


def test_a_second_signal_ends_what_is_ending() -> None:
    """At once, and not by an exception among threads that are still at work."""
    run = subprocess.Popen([sys.executable, "-c", ENDING], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert run.stdout and run.stdout.readline() == "ending\n"
    time.sleep(0.5)
    run.send_signal(signal.SIGTERM)
    said, error = run.communicate(timeout=30)
    assert run.returncode == -signal.SIGTERM and not said + error


def test_a_warning_of_a_command_is_one_line() -> None:
    assert in_one_line(UserWarning("input b is no body"), UserWarning, "a.py", 1) == "granswim: input b is no body\n"


LOST = """
import signal, sys, time, weakref
from granswim_pymunk import cli
from granswim_pymunk.commands import diagnose
from granswim_pymunk.errors import Terminated
class Thing: pass
def swallow(reference): raise KIND
def work(arguments):
    thing = Thing()
    kept = weakref.ref(thing, swallow)
    del thing
    time.sleep(20)
    return 0
diagnose.main = work
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.exit(cli.main(["diagnose", "pendulum"]))
"""


@pytest.mark.parametrize("kind, code", [("KeyboardInterrupt", 130), ("Terminated", 143)])
def test_an_interruption_that_a_callback_swallows_is_not_lost(kind: str, code: int) -> None:
    """What is raised while an object of a weak dictionary dies is passed over by Python: the work went on."""
    script = LOST.replace("KIND", kind)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=15, check=False)
    assert done.returncode == code and done.stderr == "granswim diagnose: interrupted\n"
