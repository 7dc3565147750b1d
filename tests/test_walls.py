"""Straight walls: what a wall does to a disk in closed form, in every mode and by the reference; what is refused."""

import math
from dataclasses import replace

import numpy as np
import pytest

import granswim_pymunk as gs
from granswim_pymunk.engine import Simulation
from granswim_pymunk.engine.checkpoint import resume, save_checkpoint
from granswim_pymunk.errors import InputError
from granswim_pymunk.inference.candidates import named_terms
from granswim_pymunk.inference.data import layers_seen, prepare
from granswim_pymunk.laws import get_law
from granswim_pymunk.recording import Recording, film, read_recording, write_recording
from granswim_pymunk.run import run_scene
from granswim_pymunk.scene import Adjustable, Body, Scene, Wall, read_scene, scene_from_dict, use, write_scene
from granswim_pymunk.validation.hard_disks import Physics, Table
from granswim_pymunk.validation.hard_disks import run as fly
from granswim_pymunk.validation.reference import Reference
from granswim_pymunk.walls import gap_to_wall, outline, way_to_wall

MODES = ("verlet", "chipmunk", "python", "batch")
MASS, RADIUS = 0.1, 0.02
ALONG, AWAY = np.array([0.8, -0.6]), np.array([0.6, 0.8])


def puck(name="a", at=(0.1, 0.1), v=(0.0, 0.0), radius=RADIUS, mass=MASS):
    return Body(name, "free", radius, mass, initial=(*at, *v))


def slanted(*laws, v=(0.4, -0.9), radius=0.003, **more):
    """A puck above a wall that falls by 3 in 4; where it meets the wall is well inside."""
    return Scene((puck(at=0.04 * AWAY, v=v),), laws, walls=(Wall((-0.4, 0.3), (0.4, -0.3), radius),), **more)


def runs_of(scene, dt, modes=MODES):
    return [*(Simulation(scene, mode=mode, dt=dt) for mode in modes), Reference(scene, dt)]


def name_of(run):
    return getattr(run, "mode", "reference")


class TestOneContact:
    def test_linear(self):
        """m x'' = -k x - gamma m x': half of a damped oscillation; contact lasts while the bodies overlap."""
        stiffness, damping = 5e3, 30.0
        scene = slanted(use("contact_linear", stiffness=stiffness, damping=damping))
        v = np.array(scene.bodies[0].initial[2:])
        w = math.sqrt(stiffness / MASS - damping**2 / 4)
        away = -(v @ AWAY) * math.exp(-0.5 * damping * math.pi / w)
        for run in runs_of(scene, 2e-5):
            run.advance(3500)
            after = run.state().v[0]
            assert after @ ALONG == pytest.approx(v @ ALONG, rel=1e-9), name_of(run)
            assert after @ AWAY == pytest.approx(away, rel=1e-3), name_of(run)
            assert run.state().spin[0] == 0.0

    def test_hertz(self):
        """Nothing is lost, and the deepest overlap is (5 m v^2/(4 k))^(2/5)."""
        stiffness = 2e5
        scene = slanted(use("contact_hertz", stiffness=stiffness))
        v = np.array(scene.bodies[0].initial[2:])
        deepest = (1.25 * MASS * (v @ AWAY) ** 2 / stiffness) ** 0.4
        for run in runs_of(scene, 2e-5, ("verlet", "batch")):
            path = run.sample(np.arange(0.0, 0.08, 1e-4))[:, 0]
            gap = gap_to_wall(path, RADIUS, scene.walls[0])
            assert gap.min() == pytest.approx(-deepest, rel=1e-3), name_of(run)
            assert run.state().v[0] @ AWAY == pytest.approx(-(v @ AWAY), rel=1e-4)

    @pytest.mark.parametrize("contact", ["contact_linear", "contact_elastic"])
    def test_friction(self, contact):
        """A puck that slides all through: mu times the impulse along the normal, and the spin that comes of it."""
        mu = 0.1
        restitution = 1.0 if contact == "contact_linear" else 0.9
        law = use(contact, stiffness=5e3) if contact == "contact_linear" else use(contact, restitution=restitution)
        scene = slanted(law, use("contact_friction", mu=mu), v=(1.2, -2.0))
        v = np.array(scene.bodies[0].initial[2:])
        change = -(1 + restitution) * (v @ AWAY)
        for run in runs_of(scene, 1e-5 if contact == "contact_linear" else 1e-4, ("verlet", "chipmunk", "batch")):
            run.advance(round(0.05 / run.dt))
            after = run.state()
            close = 1e-3 if name_of(run) != "batch" else 3e-3
            assert after.v[0] @ AWAY == pytest.approx(v @ AWAY + change, rel=close), name_of(run)
            assert after.v[0] @ ALONG == pytest.approx(v @ ALONG - mu * change, rel=close), name_of(run)
            spin = -RADIUS * mu * change * MASS / scene.bodies[0].moment
            assert after.spin[0] == pytest.approx(spin, rel=close), name_of(run)

    @pytest.mark.parametrize("mode", MODES)
    def test_impulse(self, mode):
        scene = slanted(use("contact_elastic", restitution=0.7))
        v = np.array(scene.bodies[0].initial[2:])
        run = Simulation(scene, mode=mode, dt=1e-4)
        gap = gap_to_wall(run.state().xy[0], RADIUS, scene.walls[0])
        meets = float(gap / -(v @ AWAY))
        path = run.sample(np.array([0.5, 1.5, 2.0]) * meets)[:, 0]
        after = (v @ ALONG) * ALONG - 0.7 * (v @ AWAY) * AWAY
        start = np.array(scene.bodies[0].initial[:2])
        close = 1e-6 if mode in ("verlet", "chipmunk") else 1e-4  # the others find it a step late
        np.testing.assert_allclose(path[0], start + 0.5 * meets * v, atol=1e-12)
        np.testing.assert_allclose(path[1], start + meets * v + 0.5 * meets * after, atol=close)
        np.testing.assert_allclose(run.state().v[0], after, rtol=1e-9)

    @pytest.mark.parametrize("law", [use("contact_linear", stiffness=2e5), use("contact_elastic", restitution=1.0)])
    def test_round_end(self, law):
        """Beyond the end of a wall a puck meets its end as it would meet a post."""
        wall = Wall((0.0, 0.0), (0.0, -0.5), 0.01)
        offset = 0.018
        scene = Scene((puck(at=(-0.1, offset), v=(1.0, 0.0)),), (law,), walls=(wall,))
        post = Body("post", "wall", wall.radius, 1.0, initial=(0.0, 0.0, 0.0, 0.0))
        there = Simulation(Scene((*scene.bodies, post), (law,)), dt=1e-4).sample(np.linspace(0.05, 0.12, 5))[:, :1]
        for run in runs_of(scene, 1e-4, MODES if law.name == "contact_linear" else MODES[:2]):
            close = 1e-10 if law.name == "contact_linear" or name_of(run) != "reference" else 1e-5
            np.testing.assert_allclose(run.sample(np.linspace(0.05, 0.12, 5)), there, atol=close, err_msg=name_of(run))
        if law.name == "contact_elastic":
            sine = offset / (RADIUS + wall.radius)
            n = np.array([-math.sqrt(1 - sine**2), sine])
            np.testing.assert_allclose(run.state().v[0], np.array([1.0, 0.0]) - 2 * n[0] * n, atol=1e-9)

    def test_no_force_at_a_distance(self):
        scene = slanted(use("distance_force", s=1.0, n=2.0), use("cohesion", force=1.0, range=1.0))
        for run in runs_of(scene, 1e-4, ("verlet", "python", "batch")):
            assert not run.forces().any()


def closed(*laws, **more):
    """Two pucks of different size in a box."""
    scene = Scene.box(0.3, 0.2, **more).add(
        puck(v=(0.8, 0.5)), puck("b", (0.2, 0.08), (0.4, -0.6), radius=0.03, mass=0.2), *laws
    )
    return scene


SOFT = (
    (use("contact_linear", stiffness=2000.0, damping=5.0), use("contact_friction", mu=0.3),
     use("rolling_resistance", mu_r=0.1)),
    (use("contact_hertz", stiffness=2e5, damping=5.0), use("wall_drag", c=0.3, range=0.01)),
)  # fmt: skip


@pytest.mark.parametrize("laws", SOFT)
def test_all_modes_and_the_reference_agree(laws):
    times = np.linspace(0.05, 0.3, 6)
    paths = {name_of(run): run.sample(times) for run in runs_of(closed(*laws), 1e-4)}
    gaps = [gap_to_wall(paths["verlet"][:, 1], 0.03, wall).min() for wall in closed().walls]
    assert min(gaps) < 0.01
    for name, path in paths.items():
        np.testing.assert_allclose(path, paths["reference"], atol=1e-11, err_msg=name)


@pytest.mark.parametrize("friction", [0.0, 0.2])
def test_impulses_in_a_box(friction):
    """Six impacts with walls and pucks, each off by a thousandth of a step's way."""
    laws = [use("contact_elastic", restitution=0.9), *([use("contact_friction", mu=friction)] if friction else [])]
    times = np.linspace(0.1, 0.6, 6)
    runs = runs_of(closed(*laws), 2e-4, ("verlet", "chipmunk"))
    paths = [run.sample(times) for run in runs]
    for run, path in zip(runs, paths, strict=True):
        np.testing.assert_allclose(path, paths[-1], atol=3e-5, err_msg=name_of(run))
        np.testing.assert_allclose(run.state().spin, runs[-1].state().spin, atol=1e-2)
    assert friction == 0.0 or abs(runs[0].state().spin).max() > 1.0


def test_each_body_with_its_own_restitution():
    """A wall takes the restitution of the law that acts on the body, whatever that of others is."""
    floor = Wall((-1.0, 0.0), (1.0, 0.0))
    bodies = (puck("a", (-0.2, 0.03), (0.0, -0.5)), puck("b", (0.2, 0.03), (0.0, -0.5)))
    laws = [use("contact_elastic", restitution=e, bodies=[name]) for name, e in (("a", 0.5), ("b", 0.8))]
    for run in runs_of(Scene(bodies, tuple(laws), walls=(floor,)), 1e-3, ("verlet", "batch")):
        run.advance(80)
        np.testing.assert_allclose(run.state().v[:, 1], [0.25, 0.4], rtol=1e-9)


def test_walls_with_a_restitution_of_their_own():
    """A cushion gives back 0.5 where two pucks would 0.8, and they still do; also where these lose all."""
    floor = Wall((-1.0, 0.0), (1.0, 0.0))
    for between, at_wall in ((0.8, 0.5), (0.5, 0.8), (0.0, 0.6)):
        laws = (use("contact_elastic", restitution=between, wall_restitution=at_wall),)
        bodies = (puck("a", (-0.2, 0.03), (0.0, -0.5)), puck("b", (0.2, 0.5), (0.5, 0.0)), puck("c", (0.3, 0.5)))
        for run in runs_of(Scene(bodies, laws, walls=(floor,)), 1e-3, ("verlet", "chipmunk", "batch")):
            run.advance(180)
            v = run.state().v
            assert v[0, 1] == pytest.approx(0.5 * at_wall, rel=1e-9), name_of(run)
            np.testing.assert_allclose(v[1:, 0], [0.25 * (1 - between), 0.25 * (1 + between)], atol=1e-6)


def test_bodies_that_no_contact_law_names_pass():
    scene = slanted().add(puck("b", (0.3, 0.3)), use("contact_linear", stiffness=5e3, bodies=["b"]))
    for run in runs_of(scene, 1e-4):
        run.advance(1000)
        np.testing.assert_allclose(run.state().v[0], scene.bodies[0].initial[2:])


class TestPeriod:
    """A floor that ends at the seam is one with its image."""

    LAWS = (use("gravity"), use("contact_linear", stiffness=2e3, damping=4.0), use("contact_friction", mu=0.2))

    @pytest.mark.parametrize("floor", [((0.0, 0.0), (0.2, 0.0)), ((-0.3, 0.0), (0.5, 0.0))])
    def test_across_the_seam(self, floor):
        start = puck(at=(0.15, 0.03), v=(0.9, 0.0))
        folded = Scene((start,), self.LAWS, (0.0, -9.81), 0.2, walls=(Wall(*floor),))
        plain = Scene((start,), self.LAWS, (0.0, -9.81), walls=(Wall((-5.0, 0.0), (5.0, 0.0)),))
        times = np.linspace(0.05, 0.3, 6)
        wanted = Simulation(plain, dt=1e-4).sample(times)
        assert wanted[-1, 0, 0] > 0.3
        for run in runs_of(folded, 1e-4):
            np.testing.assert_allclose(run.sample(times), wanted, atol=1e-10, err_msg=name_of(run))

    def test_an_upright_wall_and_its_image(self):
        scene = Scene(
            (puck(at=(0.15, 0.0), v=(-0.5, 0.0)),), self.LAWS[1:2], periodic_x=0.2, walls=(Wall((0.02, -1), (0.02, 1)),)
        )
        times = np.linspace(0.1, 0.7, 7)
        paths = [run.sample(times)[:, 0, 0] for run in runs_of(scene, 2e-4)]
        assert paths[0].min() > 0.02 + 0.9 * RADIUS and paths[0].max() < 0.22 - 0.9 * RADIUS
        for path in paths:
            np.testing.assert_allclose(path, paths[0], atol=1e-10)

    def test_nearest_image(self):
        wall = Wall((0.02, 0.0), (0.05, 0.01))
        xy = np.random.default_rng(1).uniform(-0.5, 0.5, (200, 2))
        ways = way_to_wall(xy, wall, 0.2)
        shifted = [Wall((0.02 + k * 0.2, 0.0), (0.05 + k * 0.2, 0.01)) for k in range(-5, 6)]
        others = np.array([gap_to_wall(xy, 0.0, image) for image in shifted])
        np.testing.assert_allclose(np.hypot(*ways.T), others.min(axis=0), atol=1e-14)
        laws = Reference(Scene((puck(),), (), periodic_x=0.2, walls=(wall,)), 1e-3).laws
        np.testing.assert_allclose(laws.walls.ways(xy)[:, 0], ways, atol=1e-14)


def test_wall_drag_near_a_wall_at_the_side():
    """v = v_0 exp(-c t/m) along an upright wall within the range, none beyond it."""
    c, times = 0.2, np.array([0.5])
    walls = (Wall((0.0, -1.0), (0.0, 2.0), 0.01),)
    bodies = (puck(at=(0.035, 0.0), v=(0.0, 0.5)), puck("b", (0.2, 0.0), (0.0, 0.5)))
    scene = Scene(bodies, (use("wall_drag", c=c, range=0.006),), walls=walls)
    for run in runs_of(scene, 1e-3):
        end = run.sample(times)[0, :, 1]
        assert end[0] == pytest.approx(0.5 * MASS / c * (1 - math.exp(-c * times[0] / MASS)), rel=1e-5), name_of(run)
        assert end[1] == pytest.approx(0.25)


def test_a_run_hangs_on_the_range_of_wall_drag_smoothly():
    # with an edge a run would only change where the range crosses a whole step, and no number could be fitted to it
    def end(reach):
        walls = (Wall((-1.0, 0.0), (1.0, 0.0), 0.01),)
        scene = Scene((puck(at=(0.0, 0.06), v=(0.0, -0.1)),), (use("wall_drag", c=0.2, range=reach),), walls=walls)
        return [run.sample(np.array([0.4]))[0, 0, 1] for run in runs_of(scene, 4e-3)]

    heights = np.array([end(reach) for reach in np.linspace(0.015, 0.0155, 9)])
    grown = np.diff(heights, axis=0)
    assert (grown > 0).all() and (grown.std(axis=0) < 0.1 * grown.mean(axis=0)).all()


def test_two_bodies_on_a_rod_in_a_box():
    """Ends of a rod bounce off the walls: nothing is lost."""
    rod = use("rod", bodies=["a", "b"], length=0.08)
    scene = Scene.box(0.3, 0.2).add(
        puck(v=(0.8, 0.5)), puck("b", (0.18, 0.1), (0.8, 0.1)), rod, use("contact_linear", stiffness=5e4)
    )
    run = Simulation(scene, dt=1e-5)
    before = (run.state().v ** 2).sum()
    run.advance(60_000)
    assert (run.state().v ** 2).sum() == pytest.approx(before, rel=2e-3)
    xy = run.state().xy
    assert math.dist(*xy) == pytest.approx(0.08, rel=1e-6)
    assert (xy > 0.015).all() and (xy < [0.285, 0.185]).all()


@pytest.mark.parametrize("mode", MODES)
def test_checkpoint_and_restart_have_the_same_bits(mode, tmp_path):
    scene = closed(*SOFT[0])
    whole = Simulation(scene, mode=mode, dt=1e-4)
    whole.advance(1500)
    half = Simulation(scene, mode=mode, dt=1e-4)
    half.advance(700)
    save_checkpoint(half, tmp_path / "half.npz")
    later, *_ = resume(tmp_path / "half.npz")
    later.advance(800)
    np.testing.assert_array_equal(later.state().xy, whole.state().xy)
    if mode == "verlet":
        state = Simulation(scene, dt=1e-4).state()
        whole.restart(state.xy, state.v, 0.0)
        whole.advance(1500)
        np.testing.assert_array_equal(later.state().xy, whole.state().xy)


class TestFiles:
    def test_scene(self, tmp_path):
        scene = closed(*SOFT[0], walls=(Wall((0.05, 0.1), (0.06, 0.12)),))
        write_scene(scene, tmp_path / "scene.toml")
        back = read_scene(tmp_path / "scene.toml")
        assert back.walls == scene.walls and back.hash == scene.hash
        assert [w.id for w in back.walls] == ["bottom", "right", "top", "left", ""]
        moved = Scene(scene.bodies, scene.laws, walls=(*scene.walls[:4], Wall((0.05, 0.1), (0.06, 0.13))))
        assert moved.identity != scene.identity != Scene(scene.bodies, scene.laws).identity
        assert "straight walls [m]: bottom, right, top, left, [0.05, 0.1] to [0.06, 0.12]" in str(scene)

    def test_recording(self, tmp_path):
        scene = closed(use("contact_elastic", restitution=0.9))
        film_of = film(scene, np.arange(0.0, 0.3, 0.01))
        write_recording(film_of, tmp_path / "box")
        assert "[[wall]]" in (tmp_path / "box" / "recording.toml").read_text()
        assert "granswim-recording/2" in (tmp_path / "box" / "recording.toml").read_text()
        back = read_recording(tmp_path / "box")
        assert back.scene.walls == scene.walls and not back.notes
        np.testing.assert_array_equal(back.xy, film_of.xy)

    @pytest.mark.parametrize(
        ("wall", "words"),
        [
            ({"to": [1.0, 0.0]}, "needs from"),
            ({"from": [0.0, 0.0]}, "needs to"),
            ({"from": [0.0, 0.0], "to": [0.0, 0.0]}, "the same one twice"),
            ({"from": [0.0], "to": [0.0, 1.0]}, "from should be two finite numbers"),
            ({"from": "left", "to": [0.0, 1.0]}, "from should be two finite numbers"),
            ({"from": [0.0, math.nan], "to": [0.0, 1.0]}, "from should be two finite numbers"),
            ({"from": [0.0, 0.0], "to": [0.0, 1.0], "radius": -1e-3}, "radius should be a number, zero or above"),
            ({"from": [0.0, 0.0], "to": [0.0, 1.0], "radius": "thin"}, "radius should be a number, zero or above"),
            ({"from": [0.0, 0.0], "to": [0.0, 1.0], "thick": 1.0}, "unknown key 'thick'"),
            ({"from": [0.0, 0.0], "to": [0.0, 1.0], "id": "a"}, "this id is used twice"),
            ({"from": [0.0, 0.0], "to": [0.3, 0.1]}, "farther along x than the period"),
            (3.0, "should be a table"),
        ],
    )
    def test_refused(self, wall, words):
        body = {"id": "a", "role": "free", "radius": 0.01, "mass": 1.0, "initial": [0.0, 0.1, 0.0, 0.0]}
        data = {"body": [body], "wall": [wall], "scene": {"periodic_x": 0.2}}
        with pytest.raises(InputError, match=words):
            scene_from_dict(data, file="scene.toml")

    def test_a_body_inside_a_wall(self, tmp_path):
        scene = Scene((puck(at=(0.0, 0.005)),), SOFT[1][:1], walls=(Wall((-1.0, 0.0), (1.0, 0.0), id="floor"),))
        write_scene(scene, tmp_path / "scene.toml")
        with pytest.raises(InputError, match=r"overlaps wall floor by 0.015 m, more than half a radius"):
            read_scene(tmp_path / "scene.toml")


@pytest.mark.deep
def test_restitution_of_a_box_is_found(tmp_path):
    """A puck that meets all four walls, filmed by a code that is not the engine: the restitution that was believed is
    not the one it has."""
    corners = [(0.0, 0.0), (0.3, 0.0), (0.3, 0.2), (0.0, 0.2)]
    sides = tuple(zip(corners, [*corners[1:], corners[0]], strict=True))
    table = Table(np.array([0.03]), np.array([0.1]), np.array([False]), sides)
    t = 0.2 + np.arange(200) / 240
    flight = fly(table, Physics(restitution=0.9), np.array([[0.1, 0.08, 0.9, 0.65]]), t)
    assert {touch[2] for touch in flight.touches} == {1, 2, 3, 4}
    seen = flight.xy + 3e-4 * np.random.default_rng(3).normal(size=flight.xy.shape)
    walls = tuple(Wall(*side) for side in sides)
    scene = Scene((Body("puck", "free", 0.03, 0.1),), (use("contact_elastic", restitution=0.95),), walls=walls)
    recording = Recording("box", scene, t, ("puck",), seen, sampling=240.0, position_noise=3e-4)
    write_recording(recording, tmp_path / "box")
    verdict = gs.diagnose(tmp_path / "box", seed=1, out=tmp_path / "out").verdict
    assert verdict["verdict"] == "missing_physics"
    assert [m["name"] for m in verdict["mechanisms"]] == ["restitution"]
    found = verdict["mechanisms"][0]["parameters"]["restitution"]
    assert found["low"] < 0.9 < found["high"] and found["high"] - found["low"] < 0.01
    revised = read_scene(tmp_path / "out" / "revised.toml")
    assert revised.walls == walls
    run_scene(revised, tmp_path / "again", frames=2, quiet=True)


@pytest.mark.deep
def test_a_cushion_is_no_puck(tmp_path):
    """Two pucks in the same box that bounce off each other as believed, filmed by the same code, and off walls not."""
    corners = [(0.0, 0.0), (0.3, 0.0), (0.3, 0.2), (0.0, 0.2)]
    sides = tuple(zip(corners, [*corners[1:], corners[0]], strict=True))
    table = Table(np.full(2, 0.02), np.full(2, 0.1), np.array([False, False]), sides)
    t = np.arange(150) / 120
    start = np.array([[0.05, 0.1, 0.7, 0.05], [0.2, 0.11, 0.0, 0.3]])
    flight = fly(table, Physics(restitution=0.9, at_walls=0.7), start, t)
    assert any(touch[2] == 1 for touch in flight.touches) and any(touch[2] > 1 for touch in flight.touches)
    seen = flight.xy + 3e-4 * np.random.default_rng(3).normal(size=flight.xy.shape)
    walls = tuple(Wall(*side) for side in sides)
    bodies = tuple(Body(name, "free", 0.02, 0.1) for name in "ab")
    own = Adjustable("contact_elastic", "restitution", 0.5, 1.0)
    scene = Scene(bodies, (use("contact_elastic", restitution=1.0),), walls=walls, adjustable=(own,))
    verdict = gs.diagnose(Recording("box", scene, t, ("a", "b"), seen, position_noise=3e-4), seed=1).verdict
    assert verdict["verdict"] == "missing_physics"
    assert [m["name"] for m in verdict["mechanisms"]] == ["restitution"]
    found = verdict["mechanisms"][0]["parameters"]["wall_restitution"]
    assert found["low"] < 0.7 < found["high"] and found["high"] - found["low"] < 0.03
    between = verdict["recalibrated"]["contact_elastic.restitution"]
    assert between["low"] < 0.9 < between["high"]


def thrown_at_a_board(rate, v):
    """A ball in flight that a board stops partly, along it too, filmed; the scene knows of no loss."""
    ball = Body("ball", "free", 0.12, 0.6, initial=(0.0, 2.0, *v))
    board = (Wall((0.8, -5.0), (0.8, 8.0)),)
    lossy = (use("gravity"), use("contact_elastic", restitution=0.62), use("contact_friction", mu=0.3))
    truth = Scene((ball,), lossy, (0.0, -9.81), walls=board)
    seen = film(truth, np.arange(0.0, 0.9, 1 / rate), rng=np.random.default_rng(4), noise=1e-3)
    naive = (use("gravity"), use("contact_elastic", restitution=1.0))
    return replace(seen, scene=replace(seen.scene, laws=naive), angle=None)


def test_a_layer_along_a_wall_has_to_be_seen():
    """Four metres a second, 60 frames a second: whatever is thinner than 10 cm shows no more than an impact."""
    fast, slow = (4.0, -1.0), (1.0, 0.0)
    for rate, v, thin in ((60, fast, (0.05, 0.15)), (60, slow, (0.0, 0.04)), (600, fast, (0.0, 0.02))):
        seen = thrown_at_a_board(rate, v)
        case = prepare(replace(seen, scene=replace(seen.scene, gravity=(0.0, 0.0))), held_out=False, split=False)
        assert thin[0] <= layers_seen(get_law("wall_drag"), [case])[0] <= thin[1]
        term = next(t for t in named_terms([case]) if t.label == "wall_drag")
        reach = term.free[1]
        low, high = layers_seen(get_law("wall_drag"), [case])
        assert reach.low == low <= reach.first <= high == reach.high < 2.0


@pytest.mark.deep
def test_a_board_that_takes_speed_is_no_layer_of_air(tmp_path):
    verdict = gs.diagnose(thrown_at_a_board(60, (4.0, -1.0)), seed=1).verdict
    assert {m["name"] for m in verdict["mechanisms"]} == {"restitution", "contact_friction"}


def test_pictures(tmp_path):
    closed(*SOFT[0]).plot(path=tmp_path / "box.png", width=300)
    Scene.box(0.2, 0.1).plot(path=tmp_path / "empty.png", width=300)
    corners = outline(Wall((0.0, 0.0), (1.0, 0.0), 0.1))
    assert corners[:, 0].min() == pytest.approx(-0.1) and corners[:, 0].max() == pytest.approx(1.1)
    assert np.abs(corners[:, 1]).max() == pytest.approx(0.1)
