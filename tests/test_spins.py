"""Disks that spin when they meet: what was tracked of their angles tells how friction of the contact pushes them."""

from dataclasses import replace

import numpy as np
import pytest

from granswim_pymunk.inference import diagnose
from granswim_pymunk.inference.data import prepare
from granswim_pymunk.inference.tracks.kicks import told, unexplained
from granswim_pymunk.recording import Recording
from granswim_pymunk.scene import Adjustable, Body, Scene, use

R, M, MU, E, SPIN = 0.03, 0.03, 0.15, 0.7, 26.0


def pucks(*laws):
    return Scene(tuple(Body(name, "free", R, M) for name in "ab"), laws)


def met(mu=MU, noise=2e-5, seed=1):
    """A spinning disk strikes one at rest: friction is mu times the push, against the slip; I = m r^2/2."""
    t = np.arange(0, 1.0, 0.01)
    start, v, other = np.array([0.1, 0.05]), np.array([0.0, 0.5]), np.array([0.11, 0.25])
    # when the centres are two radii apart
    apart = other - start
    b, c = apart @ v, apart @ apart - 4 * R**2
    hit = (b - np.sqrt(b**2 - v @ v * c)) / (v @ v)
    n = (other - start - v * hit) / (2 * R)
    across = np.array([-n[1], n[0]])
    push = (1 + E) * M / 2 * (v @ n)
    slip = v @ across + SPIN * R
    rub = -np.sign(slip) * mu * push
    j = -push * n + rub * across
    after = np.maximum(t - hit, 0)[:, None]
    a = start + np.minimum(t, hit)[:, None] * v + after * (v + j / M)
    bb = other - after * j / M
    turned = R * rub / (0.5 * M * R**2)
    angle = np.stack([SPIN * t + after[:, 0] * turned, after[:, 0] * turned], axis=1)
    xy = np.stack([a, bb], axis=1) + noise * np.random.default_rng(seed).standard_normal((len(t), 2, 2))
    scene = pucks(use("contact_elastic", restitution=1.0))
    scene = replace(scene, adjustable=(Adjustable("contact_elastic", "restitution", 0.3, 1.0),))
    film = Recording(name="met", scene=scene, t=t, ids=("a", "b"), xy=xy, angle=angle, position_noise=noise)
    return film, hit


def test_spins_are_read_off_the_angles():
    film, hit = met()
    case = prepare(film, held_out=False, split=True)
    assert case.spins_at(0.0) == pytest.approx([SPIN, 0.0], abs=1e-6)
    later = case.spins_at(float(film.t[film.t > hit][1]))
    assert later[1] < -3 and later == pytest.approx([SPIN + later[1], later[1]], abs=1e-6)
    assert any("how fast they turn at first" in note for note in case.notes)
    none = prepare(replace(film, angle=None), held_out=False, split=True)
    assert none.spins_at(0.0) is None


@pytest.mark.deep
def test_friction_of_a_spinning_disk_is_found():
    """Without its spin the friction pushes the other way: no coefficient does, and other laws bend to it."""
    film, _ = met()
    verdict = diagnose([film]).verdict
    found = {m["name"]: m for m in verdict["mechanisms"]}
    assert list(found) == ["contact_friction"]
    mu = found["contact_friction"]["parameters"]["mu"]
    assert mu["low"] <= MU and (mu["high"] is None or MU <= mu["high"])


def test_bodies_that_meet_without_a_law_of_contact_are_said_to():
    film, hit = met(mu=0.0)
    case = prepare(replace(film, scene=pucks(), angle=None), held_out=False, split=False)
    sentence = told(case, unexplained(case))
    assert "no law of contact" in sentence and f"t = {hit:.2f}"[:7] in sentence
