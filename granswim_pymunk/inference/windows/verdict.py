"""What is written of a bed: entries of the laws that were found, where they act, scenes that run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ... import distributions as stats
from ...laws import all_laws
from ...scene import Scene
from ..criteria import current
from ..flow import told_flow
from ..hypothesis import Failed, Hypothesis, Term
from ..mechanisms import RESTITUTION
from ..places import Place
from ..pushes import told_as, with_form
from ..result import handed_over, mechanism_entry
from ..swimmer_terms import equation, reported_parameters
from .candidates import LawAdder
from .hidden import NAME
from .likelihood import Prediction, WindowLikelihood
from .trial import BedTrial
from .windows import BedCase, BedPredictor, placed


def parameters_of(trial: BedTrial) -> dict[str, tuple[Any, Any, Any, str]]:
    """Name to (value, low, high, unit) of what was found; a force of a flow as its velocity."""
    covariance = trial.covariance if np.isfinite(trial.covariance).all() else None
    apply = trial.term.apply
    flow = apply.flow(trial.values, covariance) if isinstance(apply, LawAdder) else None
    if flow is None or not isinstance(apply, LawAdder):
        return reported_parameters(trial.term, trial.values, covariance)
    return told_flow(flow, (apply.law.strength[0], apply.pushed))


def _acting(term: Term, scene: Scene) -> list[str]:
    acting = term.bodies or tuple(b.id for b in scene.bodies if b.mobile)
    return [name for name in acting if not name.startswith(NAME)]


def entry_of(trial: BedTrial, scene: Scene, gain: float | None) -> dict[str, Any]:
    """The entry of ``mechanisms``; gain: half the fall of chi2 on held-out windows."""
    parameters, acting = parameters_of(trial), _acting(trial.term, scene)
    text = equation(trial.term, parameters)
    everybody = {b.id for b in scene.bodies if b.mobile and not b.id.startswith(NAME)}
    parameters = with_form(trial.mechanism, parameters, set(acting) == everybody, [scene])
    return mechanism_entry(
        trial.mechanism, text + told_as(parameters), acting, parameters,
        trial.signature.surviving, gain,
    )  # fmt: skip


def chance_of_law(trial: BedTrial, likelihood: WindowLikelihood) -> float:
    """p of what a law gains, by itself: F of its numbers and of the samples that replicates tell the spread with."""
    pairs = zip(likelihood.beds, likelihood.noises, strict=True)
    known = sum((len(noise.replicates) - 1) * len(b.starts) for b, noise in pairs)
    gain = max(trial.linear if trial.gain is None else trial.gain - trial.attenuation, 0.0)
    numbers = len(trial.term.free)
    return float(stats.f.sf(gain / (trial.spread * numbers), numbers, max(known, 3)))


def place_of(trial: BedTrial, scene: Scene, z: float, p: float) -> list[Place]:
    """Where a law does its work: one joint, the head, contacts; empty where it acts on all."""
    acting = _acting(trial.term, scene)
    declared = all_laws().get(trial.mechanism)
    if trial.mechanism == RESTITUTION or (declared is not None and declared.kind == "pair"):
        bounded = declared is None or declared.reach is None  # nothing acts before bodies touch
        return [Place((), z, p, "contacts", before_contact=False if bounded else None)]
    if not set(acting) <= set(scene.swimmer_ids):
        return []
    region = "swimmer"
    if len(acting) == 1:
        joint = trial.term.choices.get("joint")
        if joint is not None:
            region = f"joint {joint}"
        elif acting[0] == scene.bodies[scene.swimmer[0]].id:
            region = "head"
    return [Place(acting, z, p, region)]


def revised_scene(bed: BedCase, hypothesis: Hypothesis, values: np.ndarray, laws: Sequence[BedTrial]) -> Scene:
    """The scene of a recording with what was found, from a state estimated at its third frame.

    hypothesis : of the adjustables, and of radii where these are unsure, with their values
    """
    for trial in laws:
        hypothesis, values = hypothesis.with_term(trial.term), np.concatenate([values, trial.values])
    scene, camera = hypothesis.scene(bed.case, values)
    xy, v = BedPredictor(bed, cut=False).start_at(bed.half, (3, 0), camera, shapes=bed.shapes_of(scene))
    start = float(bed.film.t[bed.half])
    spacing = float(np.median(np.diff(bed.film.t)))
    return handed_over(
        replace(placed(scene, xy, v), bed=None), camera, bed.recording, dt=bed.dt,
        start=start + float(camera["time_offset"]), duration=float(bed.film.t[-1]) - start, output=spacing,
    )  # fmt: skip


def body_map(
    likelihood: WindowLikelihood, predicted: Prediction, hypothesis: Hypothesis, values: np.ndarray
) -> tuple[np.ndarray, int] | None:
    """Of the training window with the largest misfit: (n,) size of each body's innovation in expected spreads.

    predicted : all windows by the hypothesis. The spread is that of a few members and of the noise; NaN where a body
    was not seen.
    """
    criteria = current().windows.places
    bed = likelihood.beds[0]
    used = np.flatnonzero(bed.training)
    if not len(used):
        return None
    white = likelihood.noises[0].whiten(likelihood.innovations(predicted)[0], used)
    window = int(used[np.argmax(np.sum(white**2, axis=1))])
    predictor = BedPredictor(bed, cut=False)
    frames = int(bed.starts[window]) + bed.looks
    try:
        simulation, camera = predictor.simulation(hypothesis, values)
        ends = []
        for member in range(criteria.members):
            xy, v = predictor.start(window, member, camera, simulation.scene)
            simulation.restart(xy, v, float(bed.film.t[frames[0]]))
            ends.append(simulation.sample([float(bed.film.t[frames[-1]])])[0])
    except Failed:
        return None
    stack = np.stack(ends)
    spread = np.sqrt(stack.var(axis=0, ddof=1).mean(axis=1) * (1 + 1 / criteria.members) + bed.film.sigma**2)
    gone = np.hypot(*(bed.film.xy[frames[-1]] - stack.mean(axis=0)).T)
    z = gone / (math.sqrt(2.0) * spread)
    z[[not b.mobile for b in bed.scene.bodies]] = np.nan
    z[bed.hidden] = np.nan
    return z, window
