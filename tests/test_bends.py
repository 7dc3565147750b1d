"""A special fault of the apparatus bends the picture as any few tracks need it, and is named for more than that."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from granswim_pymunk.inference import pipeline
from granswim_pymunk.inference.hypothesis import Free, Hypothesis, Term
from granswim_pymunk.inference.judge import Judgement
from granswim_pymunk.inference.model import Claim, HeldOut
from granswim_pymunk.inference.pipeline import after_held_out, another_of_the_class, part_that_stands
from granswim_pymunk.inference.tracks import model, settle
from granswim_pymunk.inference.tracks.choose import searched, worth
from granswim_pymunk.inference.tracks.name import Trial
from granswim_pymunk.inference.tracks.segments import Impact, _struck_again
from granswim_pymunk.inference.tracks.signatures import Signature


def term(label: str, inner: int = 0, special: bool = False) -> Term:
    strength = Free(f"{label}.k", "1", -10.0, 10.0, 0.0, 1.0)
    sought = [Free(f"{label}.{n}", "m", -1.0, 1.0, 0.0, 0.1, inner=True) for n in range(inner)]
    return Term(label, label, (strength, *sought), lambda *a: None, special=special)


def trial(of: Term, gain: float, spread: float = 0.01) -> Trial:
    n = len(of.free)
    fit = SimpleNamespace(
        hypothesis=Hypothesis((of,)), values=np.full(n, 0.5), covariance=spread**2 * np.eye(n), chi2=100.0 - gain
    )
    return Trial(Signature(of, np.zeros((4, 1)), 1.0, gain), fit, gain, 1.0)  # type: ignore[arg-type]


def test_what_is_sought_over_a_range_pays_for_the_search():
    """Evidence of a number found to s in a range w: sqrt(2 pi) s/w, 2 of which in chi2 AIC has paid already."""
    lens = trial(term("lens", 2, special=True), 60.0)
    price = -2 * 2 * math.log(math.sqrt(2 * math.pi) * 0.01 / 2.0) - 4
    assert searched(lens, 1.0) == pytest.approx(price)
    assert worth(lens, 1.0) == pytest.approx(60.0 - 2 * 3 - price)
    # one whose place is hardly known gained nothing by it, and what is no special fault is paid as it was
    assert searched(trial(term("lens", 2, special=True), 60.0, spread=5.0), 1.0) == 0.0
    assert searched(trial(term("repulsion", 2), 60.0), 1.0) == 0.0
    assert searched(trial(term("lens", special=True), 60.0), 1.0) == 0.0


def test_a_law_with_an_entry_that_may_be_none_is_no_other_of_its_class(monkeypatch):
    """Of a bearing that drags, a drag of each body is another form, with a number more that says nothing."""
    alone = trial(term("bearing"), 60.0)
    entries = tuple(Free(f"drag.c[{body}]", "kg/s", 0.0, 10.0, 0.0, 1.0) for body in "ab")
    each = trial(Term("drag", "drag", entries, lambda *a: None), 60.0)
    monkeypatch.setattr(model, "choose", lambda same, *a: max(same, key=lambda t: t.gain, default=None))
    for second, others in ((0.4, ["drag"]), (0.01, [])):
        fit = SimpleNamespace(**vars(each.fit) | {"values": np.array([0.5, second]), "profiles": {}})
        tried = SimpleNamespace(alive=[alone, replace(each, fit=fit)], inner={"recalibrated": 9.0}, terms=())
        tracks = SimpleNamespace(
            spread=1.0, tried=tried, study=SimpleNamespace(inner=SimpleNamespace(slack=0.0), late=lambda share: True),
        )  # fmt: skip
        judged = SimpleNamespace(claim=Claim((alone,), alone.fit))
        assert [c.laws[0].mechanism for c in model.Tracks.alike(tracks, judged)] == others  # type: ignore[arg-type]


def test_a_fault_of_the_camera_is_held_against_another_one(monkeypatch):
    """Neither is made of a law: that they have none in common does not make them one."""
    tilt, scale, asked = term("tilt"), term("scale"), []
    monkeypatch.setattr(settle, "_standing_for", lambda *a: [])
    monkeypatch.setattr(settle, "_usual_instead", lambda *a: [scale, tilt])
    monkeypatch.setattr(settle, "_in_place", lambda search, found, k, term, revised: asked.append(term.label))
    settle.in_names_of_apparatus(SimpleNamespace(terms=()), [trial(tilt, 9.0)], None)  # type: ignore[arg-type]
    assert asked == ["scale"]


def test_laws_stand_by_where_held_out_data_turn_down_a_bent_picture(monkeypatch):
    terms = term("lens", 0, True), term("drag"), term("push")
    lens, drag, push = (trial(t, gain) for t, gain in zip(terms, (90.0, 60.0, 40.0), strict=True))
    monkeypatch.setattr(model, "choose", lambda same, *a: max(same, key=lambda t: t.gain))
    tracks = SimpleNamespace(
        spread=1.0, tried=SimpleNamespace(alive=[lens, drag, push], inner={"recalibrated": 9.0}, terms=()),
        study=SimpleNamespace(inner=SimpleNamespace(slack=0.0)),
    )  # fmt: skip

    def others(law: Trial) -> list[str]:
        judged = SimpleNamespace(claim=Claim((law,), law.fit))
        return [c.laws[0].mechanism for c in model.Tracks.alike(tracks, judged)]  # type: ignore[arg-type]

    assert others(lens) == ["drag", "push"]
    tracks.tried.alive.remove(lens)
    assert others(drag) == []  # what was told apart stays so


def test_a_bent_picture_takes_no_law_s_place_where_none_is_right(monkeypatch):
    drag, lens = trial(term("drag"), 60.0), trial(term("lens", 0, True), 60.0)
    held = {law.mechanism: HeldOut({}, {}, "holds", g, Claim((law,), law.fit), None, unlike=True)
            for law, g in ((drag, 5.0), (lens, 9.0))}  # fmt: skip

    def judged_of(law: Trial) -> Judgement:
        return Judgement("missing_physics", Claim((law,), law.fit), None)

    monkeypatch.setattr(pipeline, "judge", lambda claim, *a: judged_of(claim.laws[0]))

    def end(first: Trial, other: Trial, ahead: bool = True, behind: bool = False) -> str:
        stub = SimpleNamespace(
            notes=[], alike=lambda judged: [Claim((other,), other.fit)], alike_in_slow_noise=lambda judged: [],
            weigh=lambda c: None, mismatch=lambda c: None,
            plain=None, settle=lambda j: judged_of(other), hold_out=lambda j: held[j.claim.laws[0].mechanism],
            predicts_better=lambda a, b: behind if b is held[first.mechanism] else ahead,
        )  # fmt: skip
        found, _ = another_of_the_class(stub, judged_of(first), held[first.mechanism])  # type: ignore[arg-type]
        return found.claim.laws[0].mechanism

    assert end(drag, lens) == "drag"
    assert end(lens, drag) == "drag"
    # errors as of the right law are reason enough for a law, and none for a fault that predicts no better
    held |= {name: replace(found, unlike=False) for name, found in held.items()}
    drag_, lens_ = (replace(held[name], unlike=True) for name in ("drag", "lens"))
    held["drag"] = drag_
    assert end(drag, lens, ahead=False) == "drag" and end(drag, lens) == "lens"
    held |= {"drag": replace(drag_, unlike=False), "lens": lens_}
    assert end(lens, drag, ahead=False) == "drag"
    # any error is as of a law whose numbers are hardly known: it has to predict no worse
    assert end(lens, drag, ahead=False, behind=True) == "lens"


@pytest.mark.parametrize(
    ("within", "ahead", "stands"),
    [
        ([], ["push"], "push"),
        ([], [], "drag"),
        (["stream"], ["push"], "drag"),
        (["stream"], ["push", "stream"], "stream"),
    ],
)
def test_where_held_out_data_are_off_with_all_of_a_class_the_best_of_them_stands(monkeypatch, within, ahead, stands):
    """Off by more than in every repeat with a law, which chance does: where it is so of all, more is missing."""
    laws = [trial(term(name), 60.0) for name in ("drag", "push", "stream")]
    monkeypatch.setattr(pipeline, "judge", lambda claim, *a: Judgement("missing_physics", claim, None))

    def held(judged: Judgement) -> HeldOut:
        name = judged.claim.laws[0].mechanism
        gain = {"drag": 5.0, "push": 9.0, "stream": 8.0}[name]
        return HeldOut({}, {}, "holds", gain, judged.claim, None, beyond=name not in within)

    stub = SimpleNamespace(
        notes=[], alike=lambda judged: [Claim((t,), t.fit) for t in laws[1:]], alike_in_slow_noise=lambda judged: [],
        weigh=lambda c: None, mismatch=lambda c: None, plain=None, settle=lambda j: j, hold_out=held,
        predicts_better=lambda a, b: b.claim.laws[0].mechanism in ahead,
    )  # fmt: skip
    first = Judgement("missing_physics", Claim((laws[0],), laws[0].fit), None)
    found, _ = another_of_the_class(stub, first, held(first))  # type: ignore[arg-type]
    assert found.claim.laws[0].mechanism == stands
    # a pair of which the first law alone is left is the same claim, though by rounding it predicts better
    stub.alike, stub.predicts_better = lambda judged: [Claim((laws[0],), laws[0].fit)], lambda a, b: a is not b
    stub.notes.clear()
    found, _ = another_of_the_class(stub, first, held(first))  # type: ignore[arg-type]
    assert found is first and not stub.notes


def test_a_bent_picture_is_turned_down_where_held_out_data_are_off_by_more_than_it_leaves():
    lens, drag = (Claim((t,), t.fit) for t in (trial(term("lens", 0, True), 60.0), trial(term("drag"), 60.0)))
    for claim, unlike, outcome in ((lens, True, "fails"), (lens, False, "holds"), (drag, True, "holds")):
        judged = Judgement("measurement", claim, None)
        held = HeldOut({}, {}, "holds", 5.0, claim, None, unlike=unlike)
        assert pipeline.turned_down_if_bent(judged, held).outcome == outcome
    notes: list[str] = []
    found = after_held_out(
        SimpleNamespace(plain=drag, notes=notes, fails_predictive_check=lambda j: False),  # type: ignore[arg-type]
        Judgement("measurement", lens, None), HeldOut({}, {}, "fails", 5.0, lens, None, unlike=True),
    )  # fmt: skip
    assert found.verdict == "unmodelled" and "off by more than numbers of lens can be" in notes[0]


def test_of_two_laws_the_one_stands_that_held_out_data_bear_out(monkeypatch):
    drag, push = trial(term("drag"), 90.0), trial(term("push"), 60.0)
    monkeypatch.setattr(pipeline, "judge", lambda claim, *a: Judgement("missing_physics", claim, None))

    def end(*holds: str) -> tuple[list[str], list[str]]:
        def held(judged: Judgement) -> HeldOut:
            names = {law.mechanism for law in judged.claim.laws}
            outcome = "holds" if len(names) == 1 and names <= set(holds) else "fails"
            return HeldOut({}, {}, outcome, 1.0, judged.claim, None)

        stub = SimpleNamespace(
            notes=["before"], parts=lambda judged: [Claim((t,), t.fit) for t in (drag, push)], plain=None,
            weigh=lambda claim: stub.notes.append("of what was only tried"), mismatch=lambda claim: None,
            settle=lambda judged: judged, hold_out=held,
        )  # fmt: skip
        both = Judgement("missing_physics", Claim((drag, push), drag.fit), None)
        judged, found = part_that_stands(stub, both, held(both))  # type: ignore[arg-type]
        assert found.claim is judged.claim
        return [law.mechanism for law in judged.claim.laws], stub.notes

    assert end("drag", "push")[0] == ["drag"]
    names, notes = end("push")
    assert names == ["push"] and "push alone" in notes[-1] and notes[0] == "before"
    names, notes = end()
    assert names == ["drag", "push"] and notes == ["before"]
    # where no part is asked, held-out data are not looked at again
    both = Judgement("missing_physics", Claim((drag, push), drag.fit), None)
    held = HeldOut({}, {}, "fails", 1.0, both.claim, None)
    assert part_that_stands(SimpleNamespace(parts=lambda judged: []), both, held) == (both, held)  # type: ignore[arg-type]


def test_a_flight_too_short_for_a_start_ends_no_segment():
    """Two meet, one of them strikes a third, and the two meet again two frames later: all in one segment."""

    def met(row: int, *bodies: str) -> Impact:
        return Impact(row, row + 1, bodies, {}, {}, {})

    rows, criteria = np.arange(10, 60), SimpleNamespace(frames=4)
    cut = (11, [met(20, "b", "c")])  # frame 21 is the eleventh
    assert _struck_again(met(23, "a", "b"), cut, rows, criteria)
    assert not _struck_again(met(26, "a", "b"), cut, rows, criteria)
    assert not _struck_again(met(23, "a", "d"), cut, rows, criteria)
