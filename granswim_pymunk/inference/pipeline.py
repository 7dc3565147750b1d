"""The diagnosis, step by step, whatever was recorded."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace
from itertools import chain
from typing import Any

from ..laws import has_role
from .criteria import current
from .judge import (
    Claim,
    Judgement,
    bends,
    explained_dict,
    judge,
    named_verdict,
    turned_down,
    withdrawn,
    without_laws,
)
from .mechanisms import CLAIMED, nameless, plainly
from .model import Course, HeldOut, ObservationModel, Rival
from .result import MODELS, Diagnosis, empty_verdict, rival_entries


def diagnose_by(model: ObservationModel, seed: int = 0) -> Diagnosis:
    """Explain recordings by what their scene lacks.

    ``seed``: that the model was made with.  Raises InputError for recordings that cannot be used.
    """
    began = time.monotonic()
    model.recalibrate()  # first of all: it hides physics, and may be all that is needed
    model.try_candidates()  # each alone, and forms without a name beside them
    null = model.nulls()  # what the same search finds where nothing is missing
    claim = model.search(null)  # one to three laws that are needed together
    null = model.null_after(null)
    told = len(model.notes)  # what comes after is of one claim
    judged = first_that_explains(model, claim)  # enough of data that they were not fitted to
    model, judged, asked = by_what_nobody_sees(model, judged, told)
    held = model.hold_out(judged)  # not looked at before; it may take from a claim, and never makes one
    judged, held = another_of_the_class(model, judged, held)  # ... but it may tell which of a class it is not
    judged, held = names_for_a_form(model, claim, judged, held)
    held = turned_down_if_bent(judged, held)
    judged, held = part_that_stands(model, judged, held)
    if not asked:
        model, judged, held = unseen_after_held_out(model, judged, held, told)
    judged = told_as_unseen(model, judged)
    judged = after_held_out(model, judged, held)
    places = model.locate(judged)
    left = model.left(judged)
    judged = model.with_found_numbers(judged)
    rivals, closest = rivals_of(model, judged)
    proposal = model.propose(judged, rivals)
    course = Course(null, judged, held, places, left, rivals, closest, proposal)
    found = result_of(model, course, time.monotonic() - began, seed)
    model.done()
    model.progress("done", 1.0)
    return found


def judged_by_training(model: ObservationModel, claim: Claim, alone: bool = False) -> Judgement:
    """What is concluded of a claim from the training part; ``alone``: without forms that have no name beside it."""
    weighed = model.weigh(claim)
    weighed = replace(weighed, forms=(), possible=False) if alone else weighed
    return judge(claim, weighed, model.mismatch(claim), model.plain, model.notes)


def first_that_explains(model: ObservationModel, claim: Claim) -> Judgement:
    """The judgement of a claim, or of the first other law that explains enough.

    Of a class the search names the simplest. Where that explains too little of blocks that it was not fitted to, it is
    not that one, and the others of the class are asked by the same rules before nothing is named, and then those that
    training data ask for less.
    """
    told = len(model.notes)
    judged = model.settle(judged_by_training(model, claim))
    if judged.verdict != "unmodelled" or not claim.laws or claim.nameless:
        return judged
    why, claimed, asked = model.notes[told:], replace(judged, claim=claim), False
    it = "them" if len(claim.laws) > 1 else "it"
    others = chain(
        ((other, f"which fits cannot tell from {it}") for other in model.alike(claimed)),
        ((other, f"which these data ask for less than for {it}") for other in model.runners_up(claimed)),
    )
    for other, which in others:
        asked = True
        del model.notes[told:]
        found = judged_by_training(model, other)
        found = found if found.verdict == "unmodelled" else model.settle(found)
        if found.claim.laws and found.verdict != "unmodelled":
            told_apart = f"{other.label}, {which}, {'do' if len(other.laws) > 1 else 'does'}"
            model.notes[told:told] = [f"{why[-1]}; {told_apart}"] if why else []
            return found
    if not asked:
        return judged
    # what the model keeps of its last look belongs to the first claim again
    del model.notes[told:]
    return model.settle(judged_by_training(model, claim))


def by_what_nobody_sees(
    model: ObservationModel, judged: Judgement, told: int
) -> tuple[ObservationModel, Judgement, bool]:
    """A force from a place at which nothing is seen, where all that is seen leaves more than noise; else all as it was.

    Where it comes from and how it falls off are free, so that it bends to much: it is told where it leaves no more than
    noise, as a form without a name, and is no rival of a law that does.
    """
    left = judged.verdict in CLAIMED and not model.passes(judged.claim)
    asked = left or judged.verdict == "unmodelled"
    found = _of_what_nobody_sees(model, judged, told) if asked else None
    return *(found or (model, judged)), asked


def _of_what_nobody_sees(
    model: ObservationModel, judged: Judgement, told: int
) -> tuple[ObservationModel, Judgement] | None:
    """A law from an unseen place that training data name, and that leaves them no more than noise; None for none.

    Beside what is named anyway it takes no name away: a note says what it would be.
    told : how many notes there were before a claim was judged
    """
    further = model.with_unseen(told, judged.claim)
    if further is None:
        return None
    claim = further.search(None)
    # what else its class has leaves as much
    if not claim.laws or not further.passes(claim):
        return None
    found = first_that_explains(further, claim)
    if found.verdict not in CLAIMED or not further.passes(found.claim):
        return None
    form, named = further.as_unseen(found), {law.mechanism for law in judged.claim.laws}
    if form is None:
        return None
    beside = form.verdict not in CLAIMED  # a law with a name takes their place
    if beside and judged.verdict in CLAIMED and any(law.mechanism in named for law in found.claim.laws):
        model.notes.append(f"what {judged.claim.label} leaves, {further.notes[-1]}")
        return None
    return further, form


def unseen_after_held_out(
    model: ObservationModel, judged: Judgement, held: HeldOut, told: int
) -> tuple[ObservationModel, Judgement, HeldOut]:
    """The same where held-out data turn down what training data say, or are off by more than its numbers can leave.

    A few numbers follow a short training part whatever is missing. What takes their place has to leave noise alone
    there, and of held-out data no more than numbers of the right law do.
    """
    off = judged.claim.laws and (held.outcome == "fails" or held.unlike)
    found = _of_what_nobody_sees(model, judged, told) if off else None
    if found is None:
        return model, judged, held
    after = found[0].hold_out(found[1])
    if after.outcome != "holds" or after.unlike or not model.predicts_better(held, after):
        return model, judged, held
    return *found, after


def told_as_unseen(model: ObservationModel, judged: Judgement) -> Judgement:
    """What holds a law of what nobody sees is told as a form without a name, however it came to be claimed."""
    return (model.as_unseen(judged) if judged.verdict in CLAIMED else None) or judged


def another_of_the_class(model: ObservationModel, judged: Judgement, held: HeldOut) -> tuple[Judgement, HeldOut]:
    """What stands where held-out data turn down a law that training data could not tell from others.

    Training data say that it is one of a class; held-out data say which of them it is not: what they are predicted
    worse with than without, or with errors that its numbers cannot have where it is right. Of the others, which
    training data name by the same rules, the next one stands whose errors are those of its numbers, and no larger;
    where more is missing, so that there is none, the one that predicts held-out data best. Where errors are only
    larger than in every repeat with the law, which chance does in one of a dozen films, those of another have to be
    none such, and smaller; where those of all are such, more is missing, and smaller is enough. The one that
    predicts best stands. Where none of the class does, or more is missing with all of them, those are asked that
    slower noise than was found leaves open. Otherwise all is as it was.
    """
    fails = held.outcome == "fails"
    sure = fails or held.unlike
    if not (sure or held.beyond) or not judged.claim.laws or judged.claim.nameless:
        return judged, held
    better, last = _better_of(model, judged, held, model.alike(judged))
    if all(found.unlike for _, found, _ in better):
        more, after = _better_of(model, judged, held, model.alike_in_slow_noise(judged))
        last = last if after is judged else after
        better = [entry for entry in more if not entry[1].unlike] or better or more
    if not better:
        # what the model keeps of its last look belongs to the first claim again
        return judged, held if last is judged else model.hold_out(judged)
    other, found, notes = better[-1]
    if found.unlike or not sure:  # as all of them are
        other, found, notes = max(better, key=lambda entry: entry[1].gain or 0.0)
    as_all = found.unlike or (found.beyond and not sure)
    how = "worse than without" if fails else "worse" if as_all else "worse than the right law's numbers could"
    model.notes += notes
    model.notes.append(
        f"held-out data tell {other.claim.label} from {judged.claim.label}, with which they are predicted {how}; the"
        " data that were learnt from cannot"
    )
    said = found if last is other else model.hold_out(other)
    return replace(other, told_from=tuple(law.label for law in judged.claim.laws)), said


def _better_of(
    model: ObservationModel, judged: Judgement, held: HeldOut, claims: Sequence[Claim]
) -> tuple[list[tuple[Judgement, HeldOut, list[str]]], Judgement]:
    """Those of the claims that stand better than what was judged by held-out data, and what was looked at last."""
    fails = held.outcome == "fails"
    sure = fails or held.unlike
    better, last, within = list[tuple[Judgement, HeldOut, list[str]]](), judged, False
    for claim in claims:
        other, found, notes = _looked_at(model, claim)
        if found is None:
            continue
        last = other
        if other.claim.label == judged.claim.label:
            continue  # what stood beside it was dropped: it is the same claim
        # what bends the picture predicts a little better whatever is missing
        fault = bends(other) and not bends(judged)
        within |= not found.beyond
        if found.outcome != "holds" or (fault and (found.unlike or not sure)):
            continue
        if not fails and (fault or found.unlike or not sure) and not model.predicts_better(held, found):
            continue
        # where little is known of the numbers any error is one that they may have: that is no merit
        if not fails and (model.predicts_better(found, held) or (_less(found, held) and not bends(judged))):
            continue
        if not fails and _as_far_off(found, held):
            continue
        better.append((other, found, notes))
        if sure and not found.unlike:
            break
    if not sure and within:
        better = [entry for entry in better if not entry[1].beyond]
    return better, last


def _as_far_off(found: HeldOut, held: HeldOut) -> bool:
    """Whether held-out errors are those of what was held, to within what tells no law from another."""
    errors = [of.held.get("revised") for of in (found, held)]
    new, old = (math.nan if error is None else error for error in errors)
    return old < current().left.as_small * new


def _less(found: HeldOut, held: HeldOut) -> bool:
    """Whether held-out data gain less by what was found than by what was held, in chi2."""
    return found.gain is not None and held.gain is not None and found.gain < held.gain


def turned_down_if_bent(judged: Judgement, held: HeldOut) -> HeldOut:
    """What held-out data say where a bent picture is claimed and they are off by more than its numbers can leave.

    A lens, or a camera that looks at an angle, takes a part of any smooth remainder of a few tracks: that such a fault
    predicts better than nothing does not bear it out where it leaves more than it can leave if it is there.
    """
    return replace(held, outcome="fails") if bends(judged) and held.unlike and held.outcome is not None else held


def _silent(found: HeldOut) -> bool:
    """Whether held-out data change by less than one number makes of them by chance, so that they decide nothing."""
    return found.outcome == "undecided" and found.gain is not None and 2 * abs(found.gain) < current().blocks.decides


def part_that_stands(model: ObservationModel, judged: Judgement, held: HeldOut) -> tuple[Judgement, HeldOut]:
    """The law of several that held-out data bear out, where they turn the claim down as a whole.

    A law that is strong and right may be claimed with a weak one that is not, which carries later frames away. Alone
    it has to be named by training data by the same rules, and held-out data have to be predicted better with it, or be
    silent on it, as frames in which nothing meets are on a law of contacts. Beside
    a picture that is bent no form without a name did better: where that fault is turned down, what it took is left, and
    bends to a form as well, which is nothing against the rest.
    """
    if held.outcome != "fails" or len(judged.claim.laws) < 2:
        return judged, held
    looked = False
    for claim in model.parts(judged):
        other, found, notes = _looked_at(model, claim, alone=bends(judged))
        looked |= found is not None
        found = None if found is None else turned_down_if_bent(other, found)
        if found is not None and (found.outcome == "holds" or _silent(found)):
            model.notes += notes
            alone = "say nothing of" if _silent(found) else "predicted better with"
            model.notes.append(
                f"held-out data are {turned_down(judged)}, and {alone} {other.claim.label} alone: the rest is withdrawn"
            )
            return other, found
    # what the model keeps of its last look belongs to the whole claim again
    return judged, turned_down_if_bent(judged, model.hold_out(judged)) if looked else held


def names_for_a_form(
    model: ObservationModel, claim: Claim, judged: Judgement, held: HeldOut
) -> tuple[Judgement, HeldOut]:
    """What stands where held-out data turn down a form without a name that was told in place of names.

    Such a form is no rival to them: training data are asked again without it. What is then told has to be borne out by
    held-out data; where nothing is, all is as it was. Held-out data that are off by more than numbers of the form can
    leave turn it down for names alone, with which they have to be predicted better than with the form.
    """
    fails = held.outcome == "fails"
    if not (fails or held.unlike) or not judged.claim.nameless or not judged.closest:
        return judged, held
    weighed, told, tried = model.weigh(claim), len(model.notes), list[str]()
    other, found = judged, held
    while other.claim.nameless and other.claim.label not in tried and (found.outcome == "fails" or not fails):
        tried.append(other.claim.label)
        weighed = weighed.without(other.claim.label)
        other = judge(claim, weighed, model.mismatch(claim), model.plain, model.notes)
        other = other if other.claim.nameless else model.settle(other)
        looked = other.claim.laws and (fails or not other.claim.nameless)
        found = model.hold_out(other) if looked else held
    borne_out = found is not held and found.outcome == "holds"
    if other.claim.laws and borne_out and (fails or model.predicts_better(held, found)):
        forms, than = " and ".join(map(plainly, tried)), "without" if fails else "with what is told"
        better = ", and better with what is told" if fails else ""
        not_named_then = f"{claim.label} {claim.are} not named: "
        model.notes[:] = [note for note in model.notes if not note.startswith(not_named_then)]
        model.notes.append(f"held-out data are predicted worse with {forms} than {than}{better}")
        return other, found
    del model.notes[told:]
    # what the model keeps of its last look belongs to the form again
    return judged, model.hold_out(judged)


def _looked_at(
    model: ObservationModel, claim: Claim, alone: bool = False
) -> tuple[Judgement, HeldOut | None, list[str]]:
    """The judgement of a claim that is only tried, what held-out data say if it stands, and the notes on it.

    alone : as for ``judged_by_training``
    """
    told = len(model.notes)
    judged = model.settle(judged_by_training(model, claim, alone))
    held = model.hold_out(judged) if judged.claim.laws and not judged.claim.nameless else None
    notes, model.notes[told:] = model.notes[told:], []
    return judged, held, notes


def after_held_out(model: ObservationModel, judged: Judgement, held: HeldOut) -> Judgement:
    """The judgement once held-out data were looked at: they may turn a claim down, or a part of it."""
    if held.outcome == "fails" and judged.claim.laws:
        judged = withdrawn(judged, model.plain, model.notes)
    elif held.claim.laws != judged.claim.laws:
        laws = held.claim.laws
        verdict = named_verdict(laws) if laws else judged.verdict
        if not laws and verdict != "unmodelled":
            verdict = without_laws(model.mismatch(held.claim))
        judged = replace(judged, verdict=verdict, claim=held.claim, explained=held.explained)
    if not judged.claim.laws and model.fails_predictive_check(judged):
        judged = replace(judged, verdict="unmodelled")
    return judged


def rivals_of(model: ObservationModel, judged: Judgement) -> tuple[list[Rival], list[tuple[Rival, float]]]:
    """Laws that do nearly as well as what was claimed, and names that were not accepted, with their share."""
    beside, closest = model.beside(judged), judged.closest
    if judged.verdict == "unmodelled" and not closest and not judged.withdrawn:
        named = (t for t in model.refitted() if not (nameless(t.mechanism) or has_role(t.mechanism, "source")))
        best = next(named, None)
        share = None if best is None else model.share(best)
        closest = () if share is None else ((best, share.share),)
    gains = model.gains(judged, [t for t, _ in closest], [t for t, _ in beside])
    told = [(Rival(t, gains.get(t.label), False), share) for t, share in closest]
    # of several laws each may be told from the claim beside the others alone
    apart = judged.told_from if len(judged.told_from) == 1 else ()
    return [Rival(t, gains.get(t.label), same and t.label not in apart) for t, same in beside], told


def result_of(model: ObservationModel, course: Course, seconds: float = 0.0, seed: int = 0) -> Diagnosis:
    """What is handed over of what was found."""
    instead, verdict = model.instead(course), verdict_of(model, course)
    verdict["notes"] += instead
    return Diagnosis(
        kind=model.kind, verdict=verdict, revised=model.revised(course), instead=instead,
        evidence=model.evidence(course), tables=model.tables(course), used=model.used(), believed=model.believed(),
        places_in=tuple(place.recording for place in course.places), right_law=model.right_law, widened=model.widened,
        seconds=seconds, runs=model.runs, seed=seed,
    )  # fmt: skip


def verdict_of(model: ObservationModel, course: Course) -> dict[str, Any]:
    """The content of verdict.json (contract version 2)."""
    judged, left, proposal = course.judged, course.left, course.proposal
    held = course.held if judged.claim.laws else course.held.without()
    verdict = empty_verdict(judged.verdict, model.unit)
    verdict |= {
        "mismatch": [place.as_dict() for place in course.places], "mechanisms": model.mechanisms(course),
        "rivals": _rivals(course),
        "heldout": held.outcome, "explained": explained_dict(judged), "complete": left.complete,
        "remains": None if left.remains is None else left.remains.as_dict(), "null": _null(model, course),
    }  # fmt: skip
    for part, errors in (("train", held.train), ("heldout", held.held)):
        verdict["fit"][part] = {name: errors.get(name) for name in MODELS}
    verdict["fit"]["window"] = held.window
    if any(held.whole.values()):
        verdict["fit"]["heldout_start_fitted_to_whole"] = dict(held.whole)
    if proposal is not None:
        verdict["next_experiment"] = {
            "change": proposal.change, "separates": list(proposal.separates), "d_prime": proposal.d_prime,
        }  # fmt: skip
    verdict["recalibrated"] = {
        name: dict(zip(("value", "low", "high"), limits, strict=True))
        for name, limits in model.adjustables(course).items()
    }
    verdict["notes"] = [*model.notes, *model.closing_notes(course), *_better_as_given(held, model.unit)]
    return verdict


def _better_as_given(held: HeldOut, unit: str | None) -> list[str]:
    """That the scene as it was given predicts held-out data better than with what is named, where these say it holds.

    A claim is held against the recalibrated scene, since both have their numbers from the same frames. Numbers that are
    off in the same way make both predict worse than numbers that nobody fitted.
    """
    given, plain, revised = (held.held.get(name) for name in ("naive", "recalibrated", "revised"))
    if held.outcome != "holds" or given is None or plain is None or revised is None:
        return []
    if given >= current().verdict.as_given * revised:
        return []
    of = f" {unit}" if unit else ""
    return [
        f"the scene as given predicts held-out data better than the revised one: {given:.3g}{of} is left, and "
        f"{revised:.3g}{of} with that one; held-out data hold against the recalibrated scene, which leaves "
        f"{plain:.3g}{of}"
    ]


def _null(model: ObservationModel, course: Course) -> dict[str, Any] | None:
    """``null``; with the tail model of places that are beyond all replicates."""
    if course.null is None:
        return None
    replicates = len(course.null.gains)
    told: dict[str, Any] = {"p_false_alarm": model.false_alarm(course), "replicates": replicates}
    if model.tail and any(place.p < 1 / (replicates + 1) for place in course.places):
        told["tail"] = model.tail
    return told


def _rivals(course: Course) -> list[dict[str, Any]]:
    return rival_entries(
        [(law.mechanism, course.held.gain) for law in course.judged.withdrawn],
        [(r.law.mechanism, r.gain, share) for r, share in course.closest],
        [(r.law.mechanism, r.gain, r.same) for r in course.rivals],
    )
