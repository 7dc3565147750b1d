"""Masses and radii that are known, but not exactly: numbers with a prior, fitted beside whatever is tried.

Through an impact an error b of the sum R of two radii turns the line of centres by about b/R, and within some diameters
that is seen. A fit with exact radii takes it for whatever else bends paths a little: a scale of the picture, a drag
near the walls. So radii and masses of bodies that met are numbers of every fit, held to what is believed by a Gaussian
prior. Source: Tarantola 2005, Inverse Problem Theory, ch. 3.

Between impacts a mass shows where springs or pins join bodies, or a force does not grow with it: a mass on a spring
that is off by b changes the period by b/2. Where the experimenter stated by how much masses and radii may be off, those
that show in the motion are numbers of every fit as well, whatever of the scene it is that makes them matter.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ... import distributions as stats
from ...scene import Body, Scene
from ..criteria import current
from ..data import Case
from ..hypothesis import Free, Term
from ..linear import basis
from .fit import Fitter
from .fitted import Fit
from .segments import find_impacts
from .signatures import columns_of, stacked


def believed_terms(cases: Sequence[Case]) -> tuple[Term, ...]:
    """A term for every radius and mass that is not known exactly, of bodies that met in what is learned from.

    Where nothing was said of them, they are as uncertain as ``criteria.candidates.unstated``; a mass counts where it
    met one that moves, too. A body with the same id, radius and mass in two recordings is the same body, and off by the
    same.
    """
    met: dict[tuple[str, float, float], Case] = {}
    weighed: set[str] = set()
    for case in cases:
        impacts = [i for i in find_impacts(case) if case.training[i.row]] if not case.held_out else []
        weighed |= {n for i in impacts if sum(case.recording.scene.body(m).mobile for m in i.met) > 1 for n in i.met}
        for name in sorted({n for i in impacts for n in i.met}):
            body = case.recording.scene.body(name)
            met.setdefault((name, body.radius, body.mass), case)
    terms: list[Term] = []
    for (name, *_), case in met.items():
        errors: dict[str, float | None] = {"radius": case.recording.radius_error, "mass": case.recording.mass_error}
        errors = {what: current().candidates.unstated if e is None else e for what, e in errors.items()}
        if name not in weighed or not case.recording.scene.body(name).mobile:
            del errors["mass"]
        terms += [_error_term(cases, what, case.recording.scene.body(name), e) for what, e in errors.items() if e]
    return tuple(terms)


def stated_terms(cases: Sequence[Case], fitted: Collection[str]) -> tuple[Term, ...]:
    """A term for every mass and radius that is said to be off by so much, but for those that are ``fitted``."""
    terms: dict[tuple[str, float, float], Term] = {}
    for case in cases:
        for what, error in (("mass", case.recording.mass_error), ("radius", case.recording.radius_error)):
            for body in case.recording.scene.bodies if error else ():
                name = error_name(what, body.id)
                if error and name not in fitted and (body.mobile or what == "radius"):
                    terms.setdefault((name, body.radius, body.mass), _error_term(cases, what, body, error))
    return tuple(terms.values())


def shown_terms(
    cases: Sequence[Case], fitter: Fitter, naive: Fit, adjustables: Sequence[Term], met: Sequence[Term]
) -> tuple[Term, ...]:
    """Of masses and radii that are stated to be off by so much, those that show in motion, beside those that ``met``.

    About the scene as it is believed: where one standard deviation of the error moves the bodies as starts and
    adjustable numbers cannot, and all this changes chi2 by more than one number gains by chance. A free fall does not
    show a mass, nor does a spring whose stiffness is adjustable show that of its only body. Two masses that imitate
    each other both count, as their priors tell them apart.
    """
    terms = stated_terms(cases, {f.name for term in met for f in term.free})
    if not terms:
        return ()
    whole = stacked(fitter, naive)
    free = [whole.beside(columns_of(fitter, naive, term)[0]) for term in adjustables]
    taken = basis(np.hstack(free)) if free else np.zeros((len(whole.left), 0))
    shown = []
    for term in terms:
        (number,) = term.free
        # the prior is no part of what the bodies do
        moves = columns_of(fitter, naive, replace(term, free=(replace(number, prior=0.0),)))[0][:, 0] * number.prior
        own = whole.beside(moves)
        own = own - taken @ (taken.T @ own)
        left = float(np.linalg.norm(own))
        if left > current().signatures.surviving * np.linalg.norm(moves) and left**2 > current().candidates.shows:
            shown.append(term)
    return tuple(shown)


def _error_term(cases: Sequence[Case], what: str, body: Body, error: float) -> Term:
    """The ``mass`` or ``radius`` of a body, off by a share with a prior of that standard deviation."""
    same = (body.id, body.radius, body.mass)
    where = frozenset(c.name for c in cases if same in [(b.id, b.radius, b.mass) for b in c.recording.scene.bodies])
    most = min(current().candidates.believed * error, 0.5)
    free = Free(error_name(what, body.id), "1", -most, most, 0.0, error, where, 0.0, prior=error)
    return Term(f"{what}_error", free.name, (free,), _Off(what, body.id), (body.id,), free.name)


FARTHER_OFF = "masses and radii are farther off than was stated, or is usual"
OFF_UNSTATED = "masses or radii are off of which no error was stated (mass_error, radius_error)"


@dataclass(frozen=True)
class OffBelief:
    """Masses and radii that the data refute: by which ``shares`` they are off, empty where they refute none.

    as_believed : together they are as far off as such errors are by chance
    stated : of all that are told, the experimenter said how far off they may be; of others that is what is usual
    unstated : as believed all the same, those of which nobody said that they may be off are, whatever the others are
    """

    shares: Mapping[str, float]
    as_believed: bool = True
    stated: bool = True
    unstated: bool = False

    @property
    def why(self) -> str:
        """Why nothing is complete with them, as the contract frees what was stated alone; empty where that is none."""
        if not self.shares:
            return ""
        return FARTHER_OFF if not self.as_believed else OFF_UNSTATED if self.unstated else ""

    def __str__(self) -> str:
        told = ", ".join(f"{name} = {100 * share:+.2g} %" for name, share in self.shares.items())
        within = f"as far off as {'was stated' if self.stated else 'is usual'} explain it"
        how = within if self.as_believed else "are off"
        return f"the scene as believed leaves more than noise: masses and radii {how}, {told}"


def off_belief(fitter: Fitter, fit: Fit) -> OffBelief:
    """By which shares masses and radii are off where the data refute what is believed of them.

    With all of them held to what is believed chi2 rises by more than as many numbers gain by chance (a likelihood
    ratio; what the priors take of it makes it the more careful). Those are told whose 95 %
    intervals leave out what is believed. Of which nobody stated an error, those are asked alone as well.
    """
    rows = list(fit.hypothesis.believed)
    if not len(rows) or not np.any(fit.values[rows]):
        return OffBelief({})
    values = fit.values.copy()
    values[rows] = [fit.hypothesis.free[k].neutral for k in rows]
    few, level = current().intervals.refit, max(fit.chi2 / max(fit.count - fit.numbers, 1), 1.0)

    def refuted(those: Sequence[int], values: np.ndarray) -> bool:
        held = fitter.fit(fit.hypothesis, values, fit.starts, held=tuple(those), evaluations=few)
        return bool((held.chi2 - fit.chi2) / level >= stats.chi2.isf(current().noise.alarm, len(those)))

    if not refuted(rows, values):
        return OffBelief({})
    names, errors = [fit.hypothesis.free[k].name for k in rows], np.sqrt(np.diag(fit.covariance)[rows])
    shares = fit.values[rows]
    away = np.abs(shares) / np.maximum(errors, np.finfo(float).tiny)
    told = away >= min(stats.norm.isf(current().verdict.absent / 2), away.max())
    off = {name: float(share) for name, share, tell in zip(names, shares, told, strict=True) if tell}
    priors = np.array([fit.hypothesis.free[k].prior for k in rows])
    likely = chance_of_errors(shares, priors, fit.covariance[np.ix_(rows, rows)]) >= current().noise.alarm
    stated = {free.name for term in stated_terms(fitter.cases, ()) for free in term.free}
    unsaid = [k for k in rows if fit.hypothesis.free[k].name not in stated]
    alone = fit.values.copy()
    alone[unsaid] = values[unsaid]
    # asked only where nothing is farther off anyway
    unstated = likely and bool(unsaid) and (len(unsaid) == len(rows) or refuted(unsaid, alone))
    return OffBelief(off, likely, stated.issuperset(off), unstated)


def chance_of_errors(shares: np.ndarray, priors: np.ndarray, covariance: np.ndarray) -> float:
    """p of errors as far from what is believed, all together, where they are drawn from what is believed of them.

    Estimates that the prior P draws to itself have the covariance P - C, with C (p, p) that of what the data and the
    prior leave open: their squares over it are chi2. Counted along directions that the data know better than the prior
    does, C < P/2; what nobody saw stays where it is believed, and must not speak for the others. Of two disks that
    met once that is the sum of their radii. Source: Box 1980, J. R. Stat. Soc. A 143, 383 (prior predictive checks).

    shares, priors : (p,) relative errors that were found, and their standard deviations as believed
    """
    known, directions = np.linalg.eigh(np.eye(len(shares)) - covariance / np.outer(priors, priors))
    counts = known > 1 / 2
    if not counts.any():
        return 1.0
    along = directions.T @ (shares / priors)
    return float(stats.chi2.sf(float(np.sum(along[counts] ** 2 / known[counts])), int(counts.sum())))


def error_name(what: str, body: str) -> str:
    """The name of the number that says by which share the ``mass`` or ``radius`` of a body is off."""
    return f"{what}_error[{body}]"


def with_error(scene: Scene, what: str, body: str, share: float) -> Scene:
    """The scene with the ``mass`` or ``radius`` of a body larger by a share."""
    bodies = tuple(replace(b, **{what: getattr(b, what) * (1.0 + share)}) if b.id == body else b for b in scene.bodies)
    return replace(scene, bodies=bodies)


class _Off:
    """Makes a radius or mass larger by the share that was found."""

    def __init__(self, what: str, body: str) -> None:
        self.what, self.body = what, body

    def __call__(self, scene: Scene, camera: Mapping[str, Any], values: Sequence[float] | np.ndarray):
        return with_error(scene, self.what, self.body, float(values[0])), camera
