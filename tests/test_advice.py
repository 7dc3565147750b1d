"""Time steps that resolve the laws, and contacts softened for screening runs."""

import dataclasses
import math

import numpy as np
import pytest
from test_engine import CONTACT, Simulation, free, small_bed

from granswim_pymunk.cli import main
from granswim_pymunk.engine import advise_dt, contact_duration, softened
from granswim_pymunk.errors import InputError
from granswim_pymunk.scene import Body, Scene, Time, use, write_scene

SEEDS = range(6)


def pair(*laws, mass=1e-3) -> Scene:
    bodies = tuple(Body(f"{k}", "free", 1e-3, mass, initial=(2.1e-3 * k, 0.0, 0.1 * k, 0.0)) for k in range(2))
    return Scene(bodies, laws=laws)


@pytest.mark.parametrize(
    ("law", "steps"),
    [
        (use("cohesion", force=1.0, range=1e-4), 20),
        (use("distance_force", s=2.0, n=6.0), 20),
        (use("pair_lubrication", c=1e5, range=1e-4), 10),
        (use("pair_spring", k=400.0, f_0=0.0), 990),
        (use("linear_drag", c=10.0), 50),
        (use("quadratic_flow", c=10.0, u=(3.0, 4.0)), 50),
        (use("contact_friction", mu=0.5, v_0=1e-5, stiffness=1.0, hertz=0.0, damping=0.0), 2),
    ],
)
def test_newer_laws_shorten_the_step(law, steps):
    """The advised step grows with the time in which the law acts, and is that many times shorter."""
    scene = pair(law)
    values = scene.resolved(law)
    mass, g = 1e-3, scene.gravity_size
    fastest = {
        "cohesion": lambda: 2 * math.pi * math.sqrt(mass / 2 * 1e-4 / 1.0),
        "distance_force": lambda: 2 * math.pi * math.sqrt(mass / 2 * 2e-3 / (2.0 * 6.0) * 2.0**6),
        "pair_lubrication": lambda: 1e-5,
        "pair_spring": lambda: 2 * math.pi * math.sqrt(mass / 2 / 400.0),
        "linear_drag": lambda: mass / 10.0,
        "quadratic_flow": lambda: mass / (10.0 * 5.0),
        "contact_friction": lambda: 1e-5 / (values["mu"] * g),
    }[law.name]()
    assert 0 < advise_dt(scene) <= fastest / steps
    assert advise_dt(scene) < advise_dt(pair())


def test_nonlinear_spring_counts_where_it_starts():
    spring = use("nonlinear_spring", k_3=4e5, anchor=(0.0, 0.0), length=0.0)
    near, far = (free(spring, initial=(x, 0.0, 0.0, 0.0)) for x in (0.01, 0.1))
    assert advise_dt(far) == pytest.approx(advise_dt(near) / 10)


def test_softened_keeps_the_restitution():
    """A head-on impact with 1, 10 and 100 times softer contacts: the same speed afterwards, longer contacts."""
    speeds, durations = [], []
    for factor in (1.0, 10.0, 100.0):
        scene = softened(pair(use("contact_linear", stiffness=1e4, damping=500.0)), factor)
        bodies = tuple(
            dataclasses.replace(b, initial=(*b.initial[:2], 0.2 - 0.4 * k, 0.0)) for k, b in enumerate(scene.bodies)
        )
        sim = Simulation(dataclasses.replace(scene, bodies=bodies))
        sim.advance(math.ceil(0.02 / sim.dt))
        speeds.append(float(np.ptp(sim.state().v[:, 0])))
        durations.append(contact_duration(scene))
    assert 0.1 < speeds[0] < 0.39
    np.testing.assert_allclose(speeds, speeds[0], rtol=2e-2)
    np.testing.assert_allclose(durations, durations[0] * np.sqrt([1, 10, 100]), rtol=1e-9)


def observe(scene: Scene) -> list[float]:
    """Speed of the swimmer along x and y [m/s] after it set in, and the root of the mean square of its bends [rad]."""
    t = np.linspace(0.0, 0.05, 51)
    rows = list(scene.swimmer)
    xy = Simulation(scene).sample(t, rows)
    mass = np.array([scene.bodies[k].mass for k in rows])
    center = (xy * mass[:, None]).sum(axis=1) / mass.sum()
    way = np.diff(xy, axis=1)
    bends = np.diff(np.unwrap(np.arctan2(way[..., 1], way[..., 0]), axis=1))
    return [*((center[-1] - center[10]) / (t[-1] - t[10])), float(np.sqrt((bends**2).mean()))]


def test_softened_leaves_speed_and_shape():
    """Ten times softer: speed and shape of the swimmer change by less than their errors, in fewer steps."""
    beds = [small_bed(seed=seed, flow=0.0) for seed in SEEDS]
    hard, soft = (np.array([observe(s) for s in scenes]) for scenes in (beds, [softened(s, 10.0) for s in beds]))
    error = np.sqrt((hard.var(axis=0, ddof=1) + soft.var(axis=0, ddof=1)) / len(beds))
    assert (np.abs(hard.mean(axis=0) - soft.mean(axis=0)) < 2 * error).all()
    assert hard[:, 2].mean() > 10 * error[2]  # an error that says something
    assert softened(beds[0], 10.0).time.dt > 2.5 * beds[0].time.dt


def test_softened_leaves_the_innovations():
    """Windows predicted from noisy states of a hard run: softer contacts err as much as the right ones do."""
    noise, window = 2e-6, 2.5e-3
    scene = small_bed(seed=1, flow=0.0)
    truth, rows = Simulation(scene), list(scene.swimmer)
    models = [Simulation(scene), Simulation(softened(scene, 10.0))]
    rng = np.random.default_rng(0)
    squares: list[list[float]] = [[], []]
    for _ in range(24):
        truth.advance(round(window / truth.dt))
        start = truth.state()
        seen = start.xy + rng.normal(0.0, noise, start.xy.shape)
        truth_next = Simulation(scene)
        truth_next.restart(start.xy, start.v, start.t)
        then = truth_next.sample([start.t + window], rows)[0] + rng.normal(0.0, noise, (len(rows), 2))
        for k, model in enumerate(models):
            model.restart(seen, start.v, start.t)
            squares[k].append(float(((model.sample([start.t + window], rows)[0] - then) ** 2).mean()))
    hard, soft = np.sqrt(squares)
    error = math.sqrt((hard.var(ddof=1) + soft.var(ddof=1)) / len(hard))
    assert abs(hard.mean() - soft.mean()) < 2 * error
    assert hard.mean() > noise


def test_softened_needs_contacts_and_a_factor():
    with pytest.raises(InputError, match="no contact"):
        softened(free(), 10.0)
    with pytest.raises(InputError, match="1 or more"):
        softened(pair(CONTACT), 0.5)


def test_command_says_the_steps_and_warns(tmp_path, capsys, caplog):
    scene = dataclasses.replace(pair(CONTACT), time=Time(duration=4e-3, dt=2e-4))
    write_scene(scene, tmp_path / "pair.toml")
    arguments = ["run", str(tmp_path / "pair.toml"), "--frames", "0", "--video", "none", "--out", str(tmp_path / "o")]
    assert main(arguments) == 0
    assert "a contact lasts" in capsys.readouterr().out and "resolves the fastest law" in caplog.text
    caplog.clear()
    arguments.append("--overwrite")
    assert main([*arguments, "--softened", "100"]) == 0
    assert "resolves" not in caplog.text
    assert main([*arguments, "--softened", "0.1"]) == 2
