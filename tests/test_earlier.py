"""Fits of candidates that are made again from elsewhere: none of those before is lost."""

from __future__ import annotations

from types import SimpleNamespace

from granswim_pymunk.inference.tracks.name import TOO_LATE, Trial
from granswim_pymunk.inference.tracks.study import _or_earlier


def trial(label, chi2, base=1000.0, reason=""):
    fit = None if chi2 is None else SimpleNamespace(chi2=chi2)
    signature = SimpleNamespace(term=SimpleNamespace(label=label, mechanism=label, free=(), special=False))
    return Trial(signature, fit, 0.0 if chi2 is None else base - chi2, float("inf"), reason)


def test_of_each_law_the_fit_that_follows_more_closely_stands():
    base = SimpleNamespace(chi2=500.0)
    before = [trial("drag", 100.0), trial("push", 400.0), trial("lift", 450.0), trial("spring", 600.0)]
    now = [
        trial("drag", 300.0, 500.0), trial("push", 200.0, 500.0), trial("lift", None), trial("spring", None),
        trial("flow", 250.0, 500.0),
    ]  # fmt: skip
    kept = {t.label: t for t in _or_earlier(now, before, base)}
    assert [t.label for t in _or_earlier(now, before, base)] == ["drag", "push", "flow", "lift", "spring"]
    assert kept["drag"].fit.chi2 == 100.0 and kept["drag"].gain == 400.0  # over the scene as it follows now
    assert kept["push"].fit.chi2 == 200.0 and kept["lift"].fit.chi2 == 450.0
    assert kept["spring"].fit is None  # the scene alone follows better now


def test_where_the_time_was_up_the_earlier_fit_stands_whatever_it_leaves():
    base = SimpleNamespace(chi2=500.0)
    (kept,) = _or_earlier([trial("drag", None, reason=TOO_LATE)], [trial("drag", 600.0)], base)
    assert kept.fit.chi2 == 600.0 and kept.gain == -100.0
