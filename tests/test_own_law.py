"""A law that a user's script declares is a candidate in every kind of recording, and is named where it is the truth."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from test_diagnosis import SHORT, filmed, table
from test_unseen import F, T, only_curve, swimming, toy_scene
from test_unseen import recording as unseen

from granswim_pymunk.engine import Simulation
from granswim_pymunk.inference.candidates import named_terms
from granswim_pymunk.inference.data import prepare
from granswim_pymunk.inference.hypothesis import Hypothesis
from granswim_pymunk.inference.packings.candidates import candidates_of
from granswim_pymunk.inference.packings.summaries import conditions_of
from granswim_pymunk.inference.pipeline import diagnose_by
from granswim_pymunk.inference.tracks import diagnose_tracks
from granswim_pymunk.inference.tracks.model import Tracks
from granswim_pymunk.inference.windows import diagnose_bed
from granswim_pymunk.inference.windows.candidates import bed_terms
from granswim_pymunk.inference.windows.plan import Plan
from granswim_pymunk.inference.windows.windows import BedPredictor, bed_case
from granswim_pymunk.laws import Law, Parameter, law
from granswim_pymunk.laws.base import _REGISTRY
from granswim_pymunk.recording import Recording, read_recording
from granswim_pymunk.scene import Body, Scene, use

BED = Path(__file__).parent / "data" / "small_nothing"


@pytest.fixture
def sideways():
    """A force across the motion, as of a body that spins in a fluid: nothing in the package knows its name."""

    @law(kind="body", name="sideways", expression="F = c e_z x v", reference="a user", candidate="named",
         strength=["c"], parameters=[Parameter("c", "kg/s", "how strongly it is turned", typical=1e-3)])  # fmt: skip
    def sideways(vx, vy, c):
        return -c * vy, c * vx

    yield sideways
    _REGISTRY.pop("sideways")


@cache
def bed() -> Recording:
    return read_recording(BED)


def of_bodies() -> set[str]:
    case = prepare(filmed(table(), table(), SHORT, np.random.default_rng(3)), held_out=False, split=True)
    return {t.mechanism for t in named_terms([case])}


def of_a_bed() -> set[str]:
    return {t.mechanism for t in bed_terms([bed_case(bed()).case])}


def of_unseen_packings() -> set[str]:
    return {x.mechanism for x in candidates_of(conditions_of([unseen(swimming(T))], [], 0))}


def of_a_curve() -> set[str]:
    recorded = only_curve(toy_scene(F), *((f, 0.0, 0.01, 1e-3, 3) for f in (8.0, 9.0, 10.0)))
    return {x.mechanism for x in candidates_of(conditions_of([recorded], [], 0))}


@pytest.mark.parametrize("candidates", [of_bodies, of_a_bed, of_unseen_packings, of_a_curve])
def test_it_is_tried_in_every_kind_of_recording(sideways, candidates):
    assert sideways.name in candidates()


@pytest.mark.deep
def test_it_is_named_in_tracks_of_bodies(sideways: Law):
    naive = table()
    seen = filmed(naive, naive, SHORT, np.random.default_rng(3))
    # the reference integrator has laws of its own: the truth is what the engine makes of this one
    case = prepare(seen, held_out=False, split=True)
    term = next(t for t in named_terms([case]) if t.mechanism == sideways.name)
    truth = term.apply(naive, {}, [0.01])[0]
    xy = Simulation(truth, dt=1e-4).sample(SHORT)
    noisy = xy + np.random.default_rng(4).normal(size=xy.shape) * seen.position_noise
    verdict = diagnose_tracks([replace(seen, xy=noisy)]).verdict
    assert verdict["verdict"] == "missing_physics"
    (entry,) = verdict["mechanisms"]
    assert entry["name"] == sideways.name and entry["parameters"]["c"]["value"] == pytest.approx(0.01, rel=0.02)


def test_it_is_named_through_impacts(sideways: Law):
    """Tracks that are followed in segments: three pucks, of which one strikes the other two."""
    start = ((-0.2, 0.0, 0.5, 0.0), (0.0, 0.02, 0.0, 0.0), (0.12, 0.09, -0.2, -0.3))
    bodies = [Body(str(k), "free", 0.025, 0.05, initial=s) for k, s in enumerate(start)]
    naive = Scene(tuple(bodies), (use("contact_elastic", restitution=0.9),))
    t = np.arange(0.0, 0.9, 0.01)
    xy = Simulation(naive.with_laws(use(sideways.name, c=0.02)), dt=1e-4).sample(t)
    noisy = xy + 1e-4 * np.random.default_rng(4).normal(size=xy.shape)
    known = replace(naive, bodies=tuple(replace(b, initial=None) for b in bodies))
    seen = Recording("struck", known, t, naive.ids, noisy, sampling=100.0, position_noise=1e-4)
    model = Tracks([seen])
    assert max(map(len, model.study.fitter.segments.values())) > 1
    verdict = diagnose_by(model).verdict
    assert verdict["verdict"] == "missing_physics"
    (entry,) = verdict["mechanisms"]
    assert entry["name"] == sideways.name and entry["parameters"]["c"]["value"] == pytest.approx(0.02, rel=0.05)


@pytest.mark.deep
def test_it_is_named_in_a_bed_that_is_seen(sideways: Law):
    recorded = bed()
    case = bed_case(recorded)
    term = next(t for t in bed_terms([case.case]) if t.mechanism == sideways.name)
    strength = 4.0 * term.free[0].scale
    film = BedPredictor(case).replicate(Hypothesis((term,)), np.array([strength]), 50)
    seen = replace(recorded, name="turned", t=film.t[2:], xy=film.xy[2:][:, recorded.track_rows])
    verdict = diagnose_bed([seen], candidates=[sideways.name, "weak_joint"], plan=Plan(1, 1, 4, 8, 2)).verdict
    assert verdict["verdict"] == "missing_physics"
    (entry,) = verdict["mechanisms"]
    assert entry["name"] == sideways.name and entry["parameters"]["c"]["value"] == pytest.approx(strength, rel=0.3)
    assert use("sideways", c=1.0).law is sideways
