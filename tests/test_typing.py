"""A user's script under ``mypy --strict``: right ones pass, wrong ones are told at their line."""

import re
from pathlib import Path

import pytest

SCRIPT = """
import numpy as np

import granswim_pymunk as gs

t = np.linspace(0.0, 1.0, 50)
recording: gs.Recording = gs.make_recording(t, np.zeros((50, 1, 2)), radius="5mm", mass="10g", names="puck")
result: gs.Result = gs.diagnose(recording, minutes=0.01)
names: tuple[str, ...] = result.names
numbers: dict[str, object] = result.to_dict()
scene = gs.Scene.box(0.2, 0.1).add(gs.Body("a", "free", radius=1e-3, mass=1e-3), gs.use("linear_drag", c=1e-3))
simulation = gs.Simulation(scene)
state: gs.State = simulation.run(0.1)
xy: np.ndarray[tuple[int, ...], np.dtype[np.float64]] = simulation.sample(t)
scene.plot(state, path="a.png")
done: gs.RunResult = gs.run_scene(scene, "out/x", duration=0.1)
found: list[gs.Recording] = gs.import_recording("a.csv")
"""


WRONG = {
    "gs.diagnose(recording, fsp=60)": "fsp",
    "gs.diagnose(recording, minutes='1')": "minutes",
    "state = simulation.sample(t)": "State",
    "gs.Body('a', 'free', radius='5', mass=1.0)": "float",
}


def test_hints_are_followed(tmp_path):
    """All lines in one script: what is checked at each does not hang on the others, and reading the package does."""
    mypy = pytest.importorskip("mypy.api")
    script = tmp_path / "script.py"
    script.write_text(SCRIPT + "\n".join(WRONG) + "\n")
    config = tmp_path / "mypy.ini"
    config.write_text(f"[mypy]\nmypy_path = {Path(__file__).parent.parent}\nfollow_imports = silent\n")
    said, _, _ = mypy.run(["--strict", f"--config-file={config}", f"--cache-dir={tmp_path / 'kept'}", str(script)])
    found = re.findall(r"script\.py:(\d+): error: (.*)", said)
    first = SCRIPT.count("\n") + 1
    assert [int(line) for line, _ in found] == list(range(first, first + len(WRONG))), said
    assert all(word in text for word, (_, text) in zip(WRONG.values(), found, strict=True)), said
