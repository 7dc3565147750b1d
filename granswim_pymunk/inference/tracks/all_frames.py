"""What all frames together ask for, where those that were learnt from are too few to tell it: said, and not named."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from ..criteria import current
from ..data import Case
from ..hypothesis import Failed
from ..judge import Claim
from ..mechanisms import plainly
from ..significance import price
from .choose import absurd
from .fit import Fitter, side_by_side
from .fitted import Fit
from .name import Trial, refit
from .signatures import Signature, make_bank
from .verdict import Told


def asked_by_all_frames(
    fitter: Fitter, cases: Sequence[Case], claim: Claim, plain: Fit, tried: Sequence[Trial], looked: int
) -> list[str]:
    """A note on the law that all frames ask for in place of what was claimed of those learnt from; none where none is.

    Held-out frames make no claim, and with them among those that are fitted none is left to test one on. But where few
    frames are learnt from, as of a ball that is in the air for twenty, these may be all there is to tell a law by.
    claim : what stands, without laws where nothing does;  plain : the scene without a law
    tried : laws fitted alone;  looked : how many were compared
    """
    frames = sum(int((c.training | c.start | c.scored).sum()) for c in cases)
    rivals = [t for t in tried if t.fit is not None and not t.special and not absurd(t)]
    if fitter.segmented or not rivals or frames > current().left.few_frames:
        return []
    whole = fitter.of_all_frames(cases)
    try:
        least, now = whole.refitted(plain), whole.refitted(claim.fit)
        fits = [(t, whole.refitted(t.fit)) for t in rivals if t.fit is not None]
        # what was hardly there in frames that were learnt from is not begun where that left it alone
        anew = make_bank(whole, least, [t.term for t in rivals]).signatures
        begun = side_by_side(whole, [partial(_begun, base=least, signature=s) for s in anew])
        fits = [
            (t, min(fit, other or fit, key=lambda f: f.chi2)) for (t, fit), other in zip(fits, begun, strict=True)
        ]
    except Failed:
        return []
    fits.sort(key=lambda f: f[1].chi2 + 2 * f[0].used)
    best, fit = fits[0]
    spread = max(fit.chi2 / max(fit.count, 1), 1.0)
    used = sum(t.used for t in claim.laws)
    earns = (least.chi2 - fit.chi2) / spread > price(looked, best.used)
    ahead = (now.chi2 - fit.chi2) / spread - 2 * (best.used - used) > current().verdict.alike
    if any(t.mechanism == best.mechanism for t in claim.laws) or not (earns and ahead):
        return []
    told = Told(fit, spread, cases).entries(best, None)
    beside = dict([(t.label, f) for t, f in fits[1:] if t.mechanism != best.mechanism][: current().verdict.instead])
    beside[claim.label if claim.laws else "the scene without a law"] = now
    others = ", ".join(f"{name} {_times(f):.2g}" for name, f in beside.items())
    return [
        f"all {frames} frames together, held-out ones too, ask for {plainly(best.mechanism)}: "
        f"{'; '.join(entry['expression'] for entry in told)}. It leaves {_times(fit):.2g} times the noise ({others}); "
        "no frames are left to test that on"
    ]


def _begun(fitter: Fitter, base: Fit, signature: Signature) -> Fit | None:
    """A law fitted from what it does beside the scene, on growing parts of the frames; None where that fails."""
    try:
        return refit(fitter, base, signature, current().evaluations.growing)
    except Failed:
        return None


def _times(fit: Fit) -> float:
    """How many times the noise a fit leaves."""
    return float(np.sqrt(fit.chi2 / max(fit.count, 1)))
