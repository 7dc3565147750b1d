"""A number of a law that the scene has, before a law that it has not, or a fault that hardly any camera has."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from granswim_pymunk.inference.candidates import named_terms
from granswim_pymunk.inference.data import prepare
from granswim_pymunk.inference.hypothesis import Hypothesis, Predictor
from granswim_pymunk.inference.result import mechanism_entry
from granswim_pymunk.inference.tracks import model
from granswim_pymunk.inference.tracks.fit import Fitter
from granswim_pymunk.inference.tracks.name import Trial, refit
from granswim_pymunk.inference.tracks.signatures import make_bank
from granswim_pymunk.inference.tracks.steps import time_steps
from granswim_pymunk.inference.tracks.undeclared import instead_of
from granswim_pymunk.inference.tracks.verdict import beside_its_own
from granswim_pymunk.recording import Recording
from granswim_pymunk.scene import Body, Scene, use

NOISE, T = 5e-4, np.arange(80) / 30  # m, s
RAIL = use("rail", bodies=["cart"], direction=(1.0, 0.0))


def filmed(xy: np.ndarray, scene: Scene) -> Recording:
    seen = xy + NOISE * np.random.default_rng(5).normal(size=xy.shape)
    return Recording("film", scene, T, scene.ids, seen, sampling=30.0, position_noise=NOISE)


def trolley(gain: float) -> Recording:
    """A cart that follows ``gain`` times its command, and a load on a rod that hangs from it, at rest at first."""
    rows, length = np.arange(0.0, 3.5, 0.01), 0.3
    command = 0.25 * np.sin(np.pi * rows)

    def rate(t, s):
        pulled = gain * 0.25 * np.pi * np.cos(np.pi * t)
        return [gain * 0.25 * np.sin(np.pi * t), s[2], -(9.81 * np.sin(s[1]) + pulled * np.cos(s[1])) / length]

    x, q, _ = solve_ivp(rate, (0, T[-1]), [0.0, 0.0, 0.0], t_eval=T, rtol=1e-9, atol=1e-11).y
    xy = np.stack([np.column_stack([x, 0 * x]), np.column_stack([x + length * np.sin(q), -length * np.cos(q)])], axis=1)
    laws = (RAIL, use("drive", bodies=["cart"]), use("rod", bodies=["cart", "load"], length=length))
    bodies = (Body("cart", "free", 0.03, 0.5), Body("load", "free", 0.02, 0.1))
    inputs = {"cart": (tuple(rows), tuple(command))}
    return filmed(xy, Scene(bodies, laws, gravity=(0.0, -9.81), inputs=inputs))


def coupled(k: float, f_0: float) -> Recording:
    """Two gliders on springs of 3 N/m each, with one of 1 N/m, 0.5 m long, between them: k and f_0 are believed."""
    mass = 0.25

    def rate(_, s):
        push = 0.5 - (s[1] - s[0])
        return [*s[2:], (-3 * s[0] - push) / mass, (-3 * (s[1] - 0.5) + push) / mass]

    x = solve_ivp(rate, (0, T[-1]), [0.08, 0.47, 0.0, 0.1], t_eval=T, rtol=1e-9, atol=1e-11).y[:2]
    laws = (
        use("rail", bodies=["cart", "load"], direction=(1.0, 0.0)),
        use("spring", bodies=["cart"], anchor=(0.0, 0.0), stiffness=3.0),
        use("spring", bodies=["load"], anchor=(0.5, 0.0), stiffness=3.0),
        use("pair_spring", bodies=["cart", "load"], k=k, f_0=f_0),
    )
    bodies = tuple(Body(name, "free", 0.03, mass) for name in ("cart", "load"))
    return filmed(np.stack([np.column_stack([own, 0 * own]) for own in x], axis=1), Scene(bodies, laws))


def instead(recording: Recording, label: str) -> list:
    """Numbers that would do in place of one law, and by how much that law is better than nothing."""
    case = prepare(recording, held_out=False, split=True)
    fitter = Fitter([case], Predictor(time_steps([case])))
    base = fitter.fit(Hypothesis(), None)
    (signature,) = make_bank(fitter, base, [t for t in named_terms([case]) if t.label == label]).signatures
    fit = refit(fitter, base, signature, (1.0,))
    return instead_of([Trial(signature, fit, base.chi2 - fit.chi2, 1.0)], fit, base, fitter, 1.0)


def test_the_gain_of_a_motor_is_told_before_a_camera_at_an_angle():
    """A load that was at rest swings as the cart moves: all lengths along the rail are as many times too large."""
    number, *_ = instead(trolley(1.08), "camera_foreshortening along x")
    assert number.name == "drive.gain" and number.value == pytest.approx(1.08, abs=0.005)
    assert number.likelier and number.camera and "tells them apart" in str(number)


def test_the_spring_of_the_scene_is_told_before_another_one():
    number, *_ = instead(coupled(0.7, 0.5), "pair_spring")
    assert number.name == "pair_spring.k" and number.value == pytest.approx(1.0, abs=0.01)
    assert number.likelier and not number.camera


def test_no_number_of_the_scene_stands_for_a_law_that_is_better():
    """Where both numbers of the spring are off one alone does not do."""
    assert instead(coupled(0.6, 0.35), "pair_spring") == []


def test_a_form_is_plainer_than_a_lens_beside_other_laws(monkeypatch):
    """Each law beside the first was looked for among all: chance may have given what it had to earn."""
    monkeypatch.setattr(model, "worth", lambda law, spread: law.gain - 2 * law.used)

    def law(used, special=False, gain=0.0, label=""):
        return SimpleNamespace(used=used, special=special, gain=gain, label=label)

    lens, drag, push, power = law(1, True), law(1), law(2), law(2, gain=1000.0, label="a power")
    tracks = SimpleNamespace(spread=1.0, tried=SimpleNamespace(terms=[None] * 40))

    def plainer(gain, *laws):
        form = SimpleNamespace(claim=SimpleNamespace(laws=[power]))
        return model.Tracks._plainer(tracks, SimpleNamespace(laws=laws), [form], gain - 2 * sum(t.used for t in laws))

    assert plainer(1030.0, lens, drag, push) == "a power" == plainer(1000.0, lens, drag)
    assert plainer(1060.0, lens, drag, push) == plainer(1030.0, drag, push) == ""


def test_a_law_that_the_scene_has_already_is_told_with_both_together():
    """A coupling 20 % too weak was a second spring, and nobody read that the first one is 1.92 N/m in place of 1.6."""
    carts = tuple(Body(name, "free", 0.02, 0.1) for name in "ab")
    spring = use("pair_spring", k=1.6, f_0=0.4)
    scene = Scene(carts, (use("rail", direction=(1.0, 0.0)), spring))
    t, xy = np.arange(40) / 20, np.zeros((40, 2, 2))
    xy[:, :, 0] = [[0.0, 0.25]] + 0.01 * np.sin(5 * t[:, None])
    record = Recording("carts", scene, t, ("a", "b"), xy, sampling=20.0, position_noise=1e-4)
    case = prepare(record, held_out=False, split=True)
    numbers = {"k": (0.32, 0.31, 0.33, "N/m"), "f_0": (0.08, 0.07, 0.09, "N")}
    entry = mechanism_entry("pair_spring", "F_n = f_0 - k d", ["a", "b"], numbers, 1.0, 1.0)
    told = "pair_spring stands in the scene already, with k = 1.6 N/m, f_0 = 0.4 N: together k = 1.92 N/m, f_0 = 0.48 N"
    assert beside_its_own([entry], [case]) == [told]
    assert beside_its_own([{**entry, "bodies": ["a"]}], [case]) == []
    drag = mechanism_entry("linear_drag", "F = -c v", ["a", "b"], {"c": (1.0, 0.9, 1.1, "kg/s")}, 1.0, 1.0)
    assert beside_its_own([drag], [case]) == []
