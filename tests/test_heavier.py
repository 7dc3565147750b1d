"""Of several bodies one is heavier than it is believed to be; and forces that a rail takes up."""

from dataclasses import replace

import numpy as np
import pytest

import granswim_pymunk as gs
from granswim_pymunk.inference.candidates import flexible_terms
from granswim_pymunk.inference.data import prepare_all
from granswim_pymunk.inference.hypothesis import Hypothesis, Predictor
from granswim_pymunk.inference.tracks.fit import Fitter
from granswim_pymunk.inference.tracks.signatures import make_bank
from granswim_pymunk.inference.tracks.steps import time_steps
from granswim_pymunk.recording import film
from granswim_pymunk.scene import Body, Scene, use


def carts(heavier: float, seconds: float):
    """Three carts on springs of their own, each on the same rail; the last is heavier by a share."""
    masses = dict.fromkeys("abc", 0.5) | {"c": 0.5 * (1 + heavier)}
    bodies = tuple(
        Body(name, "free", 0.04, mass, initial=(0.1 + 0.02 * k, 0.2 * k, 0.0, 0.0))
        for k, (name, mass) in enumerate(masses.items())
    )
    springs = tuple(use("spring", bodies=[b.id], anchor=(0.0, 0.2 * k), stiffness=20.0) for k, b in enumerate(bodies))
    laws = (*springs, use("rail", bodies=list(masses), direction=(1.0, 0.0)))
    seen = film(Scene(bodies, laws), np.arange(0.0, seconds, 1 / 30), rng=np.random.default_rng(5), noise=3e-4)
    believed = tuple(replace(b, mass=0.5, initial=None) for b in bodies)
    return replace(seen, scene=Scene(believed, laws))


@pytest.mark.deep
def test_one_of_three_carts_is_heavier():
    """The inertia of that one is named, and not a field over the place where it happens to swing."""
    verdict = gs.diagnose(carts(0.15, 5.0), seed=1).verdict
    (entry,) = verdict["mechanisms"]
    assert (entry["name"], entry["bodies"]) == ("added_mass", ["c"]) and verdict["verdict"] == "missing_physics"
    beta = entry["parameters"]["beta"]
    assert beta["low"] - 2e-3 < 0.15 < beta["high"] + 2e-3 and beta["high"] - beta["low"] < 0.01


def test_a_force_across_a_rail_is_no_number():
    """It moves nothing, whatever its size: what rounding leaves of its derivative is none."""
    cases = prepare_all([carts(0.15, 2.0)], ())
    fitter = Fitter(cases, Predictor(time_steps(cases)))
    naive = fitter.fit(Hypothesis(), (), None)
    places = [t for t in flexible_terms(cases) if any(f.name.endswith(".b0") for f in t.free)]
    assert places
    for signature in make_bank(fitter, naive, places).signatures:
        names = [f.name.rpartition(".")[2] for f in signature.term.free]
        assert any(n.startswith("a") for n in names) and not any(n.startswith("b") for n in names)


def loaded_puck(share: float, restitution: float = 0.9):
    """Two pucks that collide once, believed to be alike; the one that is struck carries a load."""
    bodies = (
        Body("a", "free", 0.03, 0.1, initial=(0.0, 0.0, 0.3, 0.01)),
        Body("b", "free", 0.03, 0.1 * (1 + share), initial=(0.25, 0.02, 0.02, 0.0)),
    )
    laws = (use("contact_elastic", restitution=restitution),)
    t = np.arange(0.0, 2.0, 1 / 240)
    seen = film(Scene(bodies, laws), t, rng=np.random.default_rng(3), noise=2e-4)
    believed = tuple(replace(b, mass=0.1, initial=None) for b in bodies)
    return replace(seen, scene=Scene(believed, laws))


@pytest.mark.deep
def test_one_of_two_pucks_is_heavier():
    """What it carries is struck, too; and only masses over one another are told, where no force weighs them."""
    verdict = gs.diagnose(loaded_puck(0.22), seed=1).verdict
    (entry,) = verdict["mechanisms"]
    assert (verdict["verdict"], entry["name"], verdict["complete"]) == ("missing_physics", "added_mass", True)
    beta = entry["parameters"]["beta"]
    truth = {"b": 0.22, "a": 1 / 1.22 - 1}[entry["bodies"][0]]
    assert beta["low"] < truth < beta["high"] and beta["high"] - beta["low"] < 0.1
