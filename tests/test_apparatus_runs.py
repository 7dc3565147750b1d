"""``granswim run`` of scenes with hinges, rods, straight walls, friction beside impulses: pictures and exports."""

from dataclasses import replace

import numpy as np
import pytest
from test_links import bars

from granswim_pymunk.cli import main
from granswim_pymunk.scene import Body, Scene, Time, Wall, use, write_scene
from granswim_pymunk.trajectory import read_trajectory


def ball(name, at, v, role="free"):
    return Body(name, role, 0.02, 0.1, initial=(*at, *v))


PAIR = ball("a", (0.1, 0.1), (0.8, 0.5)), ball("b", (0.2, 0.1), (-0.4, 0.3))
ROD = use("rod", bodies=["a", "b"], length=0.1)
RUB = use("contact_friction", mu=0.3)
SOFT = use("contact_linear", stiffness=2e3, damping=5.0)
HARD = use("contact_elastic", restitution=0.9)
G = (0.0, -9.81)
SCENES = {
    "hinges": lambda: bars(use("joint_drag", c=1e-4)),
    "a rod": lambda: Scene(PAIR, (use("gravity"), ROD), gravity=G),
    "straight walls": lambda: Scene.box(0.3, 0.2).add(*PAIR, SOFT, RUB),
    "impulses that rub": lambda: Scene.box(0.3, 0.2).add(*PAIR, HARD, RUB),
    "a rod in a box": lambda: Scene.box(0.3, 0.2).add(*PAIR, ROD, HARD, RUB),
    "a floor and a period": lambda: Scene(
        (PAIR[0], ball("g", (0.25, 0.05), (0.5, 0.0), "grain")), (use("gravity"), SOFT), G, 0.3,
        walls=(Wall((0.0, 0.0), (0.3, 0.0), 0.005, "floor"),)
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SCENES)
def test_run_and_export(name, tmp_path, capsys):
    scene = replace(SCENES[name](), time=Time(dt=1e-4, duration=0.06, output=0.01))
    write_scene(scene, tmp_path / "scene.toml")
    out = tmp_path / "out"
    assert main(["run", str(tmp_path / "scene.toml"), "--out", str(out), "--frames", "3", "--quiet"]) == 0
    trajectory = read_trajectory(out / "trajectory.h5")
    assert len(trajectory) == 7 and np.isfinite(trajectory.xy).all()
    assert sorted(p.name for p in (out / "frames").glob("*.png"))
    for to in ("xyz", "vtk", "csv"):
        assert main(["export", str(out), "--to", to, "--out", str(tmp_path / f"run.{to}")]) == 0
    capsys.readouterr()
