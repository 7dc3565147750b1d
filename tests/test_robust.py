"""Scenes of any kind run or are refused in one line, recordings full of nonsense too; threads, processes are alone."""

import concurrent.futures
import math
import resource
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from test_engine import bits, run, small_bed

from granswim_pymunk.benchmarks import fuzz_inputs
from granswim_pymunk.benchmarks.fuzz import fuzz, nonsense, seeds, whole
from granswim_pymunk.benchmarks.fuzz_inputs import KINDS
from granswim_pymunk.engine import Simulation
from granswim_pymunk.errors import InputError, SimulationError
from granswim_pymunk.recording import read_recording
from granswim_pymunk.scene import Body, Scene, Time, use

STRANGE = settings(
    max_examples=40, deadline=None, derandomize=True, database=None, suppress_health_check=list(HealthCheck)
)


@st.composite
def scenes(draw) -> Scene:
    """Disks of any size, density and stiffness, strewn at any packing, periodic or not, some of them walls."""
    n = draw(st.sampled_from([1, 2, 3, 7, 30, 200, 1500]))
    scale = 10.0 ** draw(st.integers(-5, 1))
    density = 10.0 ** draw(st.integers(0, 4))
    spread = draw(st.sampled_from([1.0, 1.5, 20.0]))
    periodic = draw(st.booleans())
    rng = np.random.default_rng(draw(st.integers(0, 2**16)))
    radius = scale * rng.uniform(0.2, 1.0, n)
    side = math.ceil(math.sqrt(n))
    place = 2.1 * scale * spread * np.stack(np.divmod(np.arange(n), side), axis=1)
    speed = rng.normal(0.0, draw(st.sampled_from([0.0, 0.1, 10.0])) * scale / 1e-2, (n, 2))
    walls = rng.random(n) < draw(st.sampled_from([0.0, 0.2, 0.9]))
    mass = density * 4 / 3 * math.pi * radius**3
    bodies = tuple(
        Body(
            f"{k}", "wall" if walls[k] else "grain", float(radius[k]), float(mass[k]),
            initial=(*place[k].tolist(), *((0.0, 0.0) if walls[k] else speed[k].tolist())),
        )
        for k in range(n)
    )  # fmt: skip
    stiffness = float(mass.mean()) * 10.0 ** draw(st.integers(2, 10))
    laws = (use("contact_linear", stiffness=stiffness, damping=draw(st.sampled_from([0.0, 10.0]))), use("gravity"))
    length = float(place[:, 0].max() + 2.1 * scale * spread) if periodic else None
    return Scene(bodies, laws=laws, periodic_x=length, gravity=(0.0, -9.81), time=Time())


@STRANGE
@given(scenes(), st.integers(1, 40))
def test_any_scene_runs_or_is_refused(scene, steps):
    """The same bits twice, at once or bit by bit, and finite numbers; or one of the two errors."""
    try:
        one, two = Simulation(scene), Simulation(scene)
        one.advance(steps)
        for _ in range(steps):
            two.advance(1)
    except (InputError, SimulationError) as error:
        assert str(error) and "\n" not in str(error)
        return
    state = one.state()
    assert np.isfinite(state.xy).all() and np.isfinite(state.v).all()
    assert bits(*one.raw().values()) == bits(*two.raw().values())
    contacts = one.contacts()
    assert (contacts.overlap > 0).all() and np.isfinite(contacts.force).all()
    if not scene.periodic_x:
        # contacts act in pairs: momentum changes by gravity alone where no wall takes part
        if all(b.mobile for b in scene.bodies):
            mass = np.array([b.mass for b in scene.bodies])
            start = np.array([b.initial[2:] for b in scene.bodies])
            gained = (mass[:, None] * (state.v - start)).sum(axis=0) - mass.sum() * np.array([0, -9.81]) * state.t
            scale = (mass * np.hypot(*state.v.T)).sum() + mass.sum() * 9.81 * state.t + 1e-300
            assert np.abs(gained).max() < 1e-9 * scale * max(steps, 1) + 1e-6 * mass.sum() * 9.81 * state.t


class TestNonsense:
    def test_some_hundreds(self, tmp_path):
        """Of every kind: recordings, scenes, foreign tables, options, stored beds, checkpoints."""
        found = fuzz(300, tmp_path, seed=1, kinds=tuple(KINDS))
        assert found.tried == 300 and found.refused > 50 and found.read > 10
        assert not found.failures, found.failures[:3]
        assert set(found.kinds) == set(KINDS) and all(counts["refused"] for counts in found.kinds.values())

    @pytest.mark.long
    def test_ten_thousand(self, tmp_path):
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        found = fuzz(10_000, tmp_path, seed=2, kinds=tuple(KINDS))
        assert not found.failures, found.failures[:3]
        # kilobytes on Linux
        assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 1e6

    @pytest.mark.long
    def test_whole_diagnoses(self, tmp_path):
        found = whole(200, tmp_path, seed=3)
        assert found.tried == 200 and not found.failures, found.failures[:3]

    @pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "options"])
    def test_what_is_spoilt_was_good(self, tmp_path, monkeypatch, kind):
        """Unspoilt, each of these is taken: a refusal is one of what was spoilt."""
        monkeypatch.setattr(fuzz_inputs, "spoil_some", lambda files, rng: dict(files))
        monkeypatch.setattr(fuzz_inputs, "spoil", lambda content, rng: content)
        monkeypatch.setattr(fuzz_inputs, "_spoil_tree", lambda tree, rng: tree)
        monkeypatch.setattr(fuzz_inputs, "_word", lambda rng: "1")
        monkeypatch.setattr(fuzz_inputs, "IMPORT_OPTIONS", ("--sampling",))
        found = fuzz(6, tmp_path, kinds=(kind,))
        assert found.read == 6 and not found.failures, found

    def test_what_breaks_is_found(self, tmp_path, monkeypatch):
        """Another error, several lines, and a case without an end."""

        def wrong(rng, place):
            def act():
                number = int(rng.integers(3))
                if number == 0:
                    raise ZeroDivisionError("by zero")
                if number == 1:
                    raise InputError("x") from None
                while True:
                    pass

            return act

        monkeypatch.setitem(KINDS, "wrong", wrong)
        monkeypatch.setattr("granswim_pymunk.benchmarks.fuzz.LONGEST", 0.05)
        found = fuzz(12, tmp_path, kinds=("wrong",))
        said = " ".join(text for _, text in found.failures)
        assert found.refused and "wrong: ZeroDivisionError: by zero (test_robust.py:" in said and "longer than" in said

    def test_what_is_fuzzed_can_be_read(self, tmp_path):
        """The files that the nonsense is made from are good ones."""
        for k, files in enumerate(seeds()):
            folder = tmp_path / str(k)
            folder.mkdir()
            for name, content in files.items():
                (folder / name).write_bytes(content)
            assert len(read_recording(folder).t) > 1

    def test_nonsense_is_repeatable(self):
        assert nonsense(np.random.default_rng(4)) == nonsense(np.random.default_rng(4))

    def test_a_case_can_be_tried_alone(self, tmp_path):
        together = fuzz(6, tmp_path, seed=5)
        alone = [fuzz(1, tmp_path, seed=5, first=k) for k in range(6)]
        assert sum(f.read for f in alone) == together.read and sum(f.refused for f in alone) == together.refused


def test_threads_are_alone():
    """Several threads, each with a scene of its own, get the bits that each scene gives alone."""
    beds = [small_bed(seed=seed) for seed in range(4)]
    alone = [bits(*run(scene, steps=600).raw().values()) for scene in beds]

    def work(scene):
        sim = Simulation(scene)
        for _ in range(6):
            sim.advance(100)
        return bits(*sim.raw().values())

    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        assert list(pool.map(work, beds * 2)) == alone * 2


def test_processes_are_alone():
    script = (
        "import sys; from test_engine import *\n"
        "print(bits(*run(small_bed(seed=int(sys.argv[1])), steps=600).raw().values()))"
    )
    here = str(__file__).rsplit("/", 1)[0]
    began = [
        subprocess.Popen([sys.executable, "-c", script, str(seed)], cwd=here, stdout=subprocess.PIPE, text=True)
        for seed in (0, 1)
    ]
    told = [program.communicate(timeout=300)[0].strip() for program in began]
    assert told == [bits(*run(small_bed(seed=seed), steps=600).raw().values()) for seed in (0, 1)]
