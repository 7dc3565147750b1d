"""How closely segments join at impacts before candidates are compared.

A loose joint lets a scene follow that does not yet know what is missing, and hides what an impact shows: a restitution
that is off by a per cent is less than the joint gives. Masses and radii that are a little off are numbers of every fit,
so that a scene in which nothing is missing can be joined far more closely; and one that cannot shows by that which law
it lacks, where with that law it can. A weak drag shows in hardly any flight between two impacts: from flight to flight
it adds up.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...laws import all_laws
from ..candidates import in_contact_alone, is_damping
from ..criteria import current
from ..hypothesis import Term
from ..linear import basis
from ..significance import price
from .fit import Fitter
from .fitted import Fit
from .name import refit
from .signatures import make_bank, stacked


def joined_closely(fitter: Fitter, base: Fit, terms: Sequence[Term]) -> tuple[Fitter, Fit]:
    """The fitter and the recalibrated fit with steps at impacts as narrow as the recordings allow.

    Allowed is what chance brings, of the scene itself or of the scene with one law that acts where bodies meet, or one
    drag or friction for all of them (a push on one of them takes up whatever an impact leaves): then that law alone
    takes away what the narrower steps show, its price paid. No further than the scene itself follows:
    where it is lost, first order says little of any law, and none finds its way from there. What was found is joined
    more closely later (``fit.joined``).
    """
    if not base.ties:
        return fitter, base
    rivals = [t for t in terms if _of_impacts(t) or is_damping(t)]
    loose = base
    for share in current().segments.closer:
        if fitter.stop():
            break
        closer = fitter.tightened(share / fitter.closeness)
        again = closer.refitted(base, evaluations=current().evaluations.joints)
        if again.chi2 - loose.chi2 <= loose.allowed_rise:
            fitter, base = closer, again
            continue
        lost = again.chi2 > current().signatures.far ** 2 * again.count
        if lost or not _explained_by_one(closer, again, loose, rivals):
            break
        fitter, base = closer, again
    return fitter, base


def shows_one_more(fitter: Fitter, fit: Fit, terms: Sequence[Term]) -> Fitter | None:
    """The fitter with steps at impacts so narrow that a scene with laws shows one more that it lacks, None for none.

    A strong law, as a drag, is told through loose joints, which hide what an impact shows beside it as they do in a
    scene without any (``joined_closely``); and where that loses its way without the strong law, its joints stay loose.
    With the law it can be joined more closely. Where chi2 then rises by more than chance, and one more law of impacts
    or one drag takes that away, its price paid for having been looked for among all ``terms``, joints that close show
    it, and the laws are compared with these.
    """
    taken = {t.mechanism for t in fit.hypothesis.terms}
    rivals = [t for t in terms if (_of_impacts(t) or is_damping(t)) and t.mechanism not in taken]
    for share in current().segments.closer if fit.ties and rivals else ():
        if fitter.stop():
            break
        if share >= fitter.closeness:
            continue
        closer = fitter.tightened(share / fitter.closeness)
        again = closer.refitted(fit, evaluations=current().evaluations.joints)
        if again.chi2 - fit.chi2 <= fit.allowed_rise:
            continue
        lost = again.chi2 > current().signatures.far ** 2 * again.count
        return closer if not lost and _explained_by_one(closer, again, fit, rivals, len(terms)) else None
    return None


def _of_impacts(term: Term) -> bool:
    """Whether a law of one number or two acts on bodies only where they are near each other."""
    law = all_laws().get(term.law)
    return (in_contact_alone(term) or (law is not None and law.kind == "pair")) and len(term.free) <= 2


def _explained_by_one(
    closer: Fitter, base: Fit, loose: Fit, rivals: Sequence[Term], looked: int | None = None
) -> bool:
    """Whether with one of the laws chi2 rises no further than allowed, and falls by its price below that without it.

    looked : how many laws the price is one of, the ``rivals`` alone where not given
    Where the scene without them is caught, first order ranks none: laws of contacts alone are then tried first.
    """
    signatures = sorted(make_bank(closer, base, rivals).signatures, key=lambda s: -s.gain)
    looked = len(rivals) if looked is None else looked
    rise, least = loose.allowed_rise, price(looked, 1)
    if caught := _promised(closer, base) > max(rise, least):
        signatures.sort(key=lambda s: not in_contact_alone(s.term))
    for signature in signatures[: current().segments.rivals]:
        if signature.gain < least and not caught:
            break
        found = refit(closer, base, signature, (1.0,))
        fell = base.chi2 - found.chi2
        if found.chi2 - loose.chi2 <= rise and fell > price(looked, len(signature.term.free)):
            return True
    return False


def _promised(fitter: Fitter, fit: Fit) -> float:
    """The fall of chi2 that its own numbers promise to first order where a fit ended: none, but where it was caught."""
    whole = stacked(fitter, fit)
    own = np.hstack([whole.starts, basis(whole.open_numbers)])
    return float(np.sum((own.T @ whole.left) ** 2))
