"""The report: one HTML file that needs nothing beside it, in the order in which a person asks."""

from __future__ import annotations

import base64
import importlib.metadata
import io
import math
import os
import platform
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .. import __version__
from ..diagnosis.candidates import APPARATUS
from ..diagnosis.driver import Diagnosis
from ..diagnosis.experiment import DECIDES
from ..diagnosis.fit import Fit
from ..diagnosis.held_out import Errors
from ..diagnosis.hypothesis import Term
from ..diagnosis.innovations import Whiteness
from ..errors import InputError
from ..laws import all_laws
from .figures import drawn_over, figures, p_text
from .films import film_of
from .player import player
from .sheet import STYLE_SHEET
from .words import (
    NARROW,
    bodies,
    counted,
    equation,
    escaped,
    interval,
    length,
    listed,
    number,
    spoken,
    times,
    unit_text,
)

NAMES = (
    "overlay", "errors_over_time", "innovations", "windows", "flexible", "candidates", "held_out", "null",
)  # fmt: skip
_APPARATUS_MEANING = {
    "camera_scale": "scale of the picture",
    "camera_tilt": "turn of the picture against the scene's axes",
    "time_offset": "a frame stamped t shows the state at t + offset",
    "tracking_bias": "shift of all positions",
    "lens_distortion": "how far the lens bends the picture, and about which place",
}
NOISE = 1.3  # an error below this many noise floors is called noise


# ---- numbers ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Fitted:
    """One fitted number with its central 95 %; ``body`` None: one for all that the law acts on.

    ``at_bound``: it lies where its range ends, so the interval is one-sided.
    """

    law: str
    name: str
    body: str | None
    value: float
    low: float
    high: float
    unit: str
    meaning: str
    at_bound: bool


def fitted_numbers(fit: Fit, spread: float, *, adjustable: bool) -> list[Fitted]:
    """The free numbers of a fit: those of the laws added to the scene, or the ``adjustable`` ones.

    ``spread``: by how much variances grow because innovations are larger than the noise, or remember.
    """
    rows = []
    at = 0
    for term in fit.hypothesis.terms:
        if (term.mechanism == "adjustable") == adjustable:
            for k, free in enumerate(term.free):
                value, low, high = fit.interval(at + k, spread)
                name, _, body = free.name.partition("[")
                if not adjustable:
                    group, members = next(((g, m) for g, m in term.groups if k in m), (name, ()))
                    # a vector's numbers are told apart by the names of its components
                    name = group if len(members) == 1 else name.rsplit(".", 1)[-1]
                edge = 1e-6 * max(abs(value), free.scale)
                at_bound = value - free.low <= edge or free.high - value <= edge
                rows.append(
                    Fitted(term.mechanism, name, body.rstrip("]") or None, value, low, high, free.unit,
                           _meaning(term, k), at_bound)
                )  # fmt: skip
        at += len(term.free)
    return rows


def _meaning(term: Term, k: int) -> str:
    if term.mechanism in _APPARATUS_MEANING:
        return _APPARATUS_MEANING[term.mechanism]
    group = next((name for name, members in term.groups if k in members), "")
    law = all_laws().get(term.mechanism)
    for parameter in law.parameters if law else ():
        if parameter.name == group:
            return parameter.meaning
    return ""


def added(diagnosis: Diagnosis) -> list[Term]:
    """The terms that the revised scene has beyond its recalibration."""
    return (
        [t for t in diagnosis.revised.hypothesis.terms if t.mechanism != "adjustable"]
        if diagnosis.found
        else []
    )


def nameless(diagnosis: Diagnosis) -> bool:
    """Whether the revised scene holds a flexible arm, not a law with a name."""
    laws = all_laws()
    return any(t.mechanism in laws and laws[t.mechanism].candidate == "flexible" for t in added(diagnosis))


def _unit(diagnosis: Diagnosis) -> str:
    return diagnosis.cases[0].unit.split()[0]


def _rms(errors: dict[str, Errors], model: str) -> float | None:
    found = errors.get(model)
    return None if found is None else found.rms


# ---- sentences ----------------------------------------------------------------------------------


def headline(diagnosis: Diagnosis) -> str:
    """The verdict in one plain sentence (HTML)."""
    mechanisms = list(dict.fromkeys(t.mechanism for t in diagnosis.found))
    laws = [spoken(m) for m in mechanisms if m not in APPARATUS]
    apparatus = [spoken(m) for m in mechanisms if m in APPARATUS]
    if diagnosis.withdrawn:
        names = listed(list(dict.fromkeys(spoken(t.mechanism) for t in diagnosis.withdrawn)))
        return f"Withdrawn: held-out data are predicted worse with {names} than without, so no law is named."
    if diagnosis.verdict == "missing_physics":
        text = f"The scene leaves out {listed(laws)}{_on_whom(diagnosis)}"
        if not diagnosis.complete:
            text = f"The best approximation so far: the scene leaves out {listed(laws)}{_on_whom(diagnosis)}"
        return text + (f", and the measurement is off: {listed(apparatus)}." if apparatus else ".")
    if diagnosis.verdict == "measurement":
        return f"The measurement is off, not the physics: {listed(apparatus)}."
    if diagnosis.verdict == "unmodelled":
        if diagnosis.closest:
            name, share = spoken(diagnosis.closest[0][0].mechanism), diagnosis.closest[0][1].share
            return (
                "Something is missing from the scene, and no law known here describes it; what comes closest, "
                f"{name}, explains {_percent(share)} of it."
            )
        return "Something is missing from the scene, and no law known here describes it."
    if diagnosis.verdict == "recalibrate":
        moved = [f.name for f in fitted_numbers(diagnosis.recalibrated, 1.0, adjustable=True)]
        need = "needs" if len(moved) == 1 else "need"
        return f"Nothing is missing from the scene; {listed(moved)} {need} another value."
    if diagnosis.white_recalibrated.p < 1e-4:
        return "No missing law is claimed, although what the scene leaves over is not noise."
    return "Nothing is missing: what the scene leaves over is noise."


def _on_whom(diagnosis: Diagnosis) -> str:
    every = {b.id for c in diagnosis.cases for b in c.recording.scene.bodies if b.mobile}
    acting = {b for t in added(diagnosis) if t.mechanism not in APPARATUS for b in (t.bodies or every)}
    if not acting or acting >= every:
        return ""
    return (
        f" on {listed(bodies(sorted(acting)))}"
        if len(acting) <= 2
        else f" on {len(acting)} of its {len(every)} bodies"
    )


def summary(diagnosis: Diagnosis) -> str:
    """One short paragraph (HTML): what helps and by how much, what remains, how sure, what else it may be."""
    unit = _unit(diagnosis)
    parts = _standing(diagnosis)
    part, errors, floor = "held-out", diagnosis.held, diagnosis.floor[1]
    if _rms(errors, "naive") is None:
        part, errors, floor = "training", diagnosis.train, diagnosis.floor[0]
    naive, final = _rms(errors, "naive"), _rms(errors, "revised")
    if final is None:
        parts.append("No run under the final scene could be finished, so nothing is said about its error.")
    elif (
        diagnosis.verdict in ("missing_physics", "measurement", "unmodelled", "recalibrate")
        and naive is not None
    ):
        way = {
            "missing_physics": "With them" if len(diagnosis.found) > 1 else "With it",
            "measurement": "Corrected for it",
            "unmodelled": "With a flexible force that has no name"
            if nameless(diagnosis)
            else "With the best named law, "
            f"{listed([spoken(t.mechanism) for t in diagnosis.found]) or 'none'},",
            "recalibrate": "With the new value" + ("s" if len(diagnosis.recalibrated.values) > 1 else ""),
        }[diagnosis.verdict]
        if final < 0.9 * naive:
            parts.append(
                f"{way} the {part} error falls from {length(naive, unit)} to "
                f"<strong>{length(final, unit)}</strong> rms."
            )
        elif final <= naive:
            parts.append(
                f"{way} the {part} error hardly changes: {length(naive, unit)} before, "
                f"<strong>{length(final, unit)}</strong> rms after. The training data ask for it; the "
                f"{part} data do not confirm it."
            )
        else:
            parts.append(
                f"{way} the {part} error grows from {length(naive, unit)} to "
                f"<strong>{length(final, unit)}</strong> rms: "
                f"the training data ask for it, the {part} data speak against it."
            )
    else:
        parts.append(f"The {part} error of the scene is <strong>{length(final, unit)}</strong> rms.")
    if final is not None:
        quiet = diagnosis.white_revised.p > 1e-3
        left = diagnosis.right_law.tolist() if part == "held-out" else []
        parts.append(remainder(final, naive, floor, part, quiet, left))
    if diagnosis.verdict in ("missing_physics", "measurement") and diagnosis.null is not None:
        null = diagnosis.null
        reach = int(np.sum(null.gains >= null.case))
        tries = len(null.gains)
        often = "in none" if reach == 0 else f"in {reach}"
        chance = p_text(null).replace(" ", NARROW)
        parts.append(f"In noise the same search finds so large a gain {often} of {tries} tries ({chance}).")
    if diagnosis.places and diagnosis.verdict != "no_mismatch":
        parts.append(_shows_most(diagnosis))
    alike = [spoken(t.mechanism) for t, same in diagnosis.rivals if same]
    if alike:
        parts.append(f"These data cannot tell it apart from {listed(alike)}.")
    elif diagnosis.rivals and diagnosis.found:
        best = max((t for t, _ in diagnosis.rivals), key=lambda t: t.gain)
        if best.gain > 0:
            parts.append(f"The nearest rival is {spoken(best.mechanism)}; these data tell the two apart.")
    if diagnosis.dropped_bodies:
        parts.append(
            f"It is not claimed for {listed(bodies(diagnosis.dropped_bodies), 6)} (<a "
            "href='#dropped'>why</a>)."
        )
    if diagnosis.proposal is not None and diagnosis.proposal.d_prime >= DECIDES:
        a, b = (spoken(n) for n in diagnosis.proposal.separates)
        parts.append(f"To measure next, so that {a} and {b} part: {escaped(diagnosis.proposal.change)}.")
    return " ".join(parts)


def _percent(share: float) -> str:
    return f"{100 * max(share, 0.0):.0f}\u00a0%"


def _standing(diagnosis: Diagnosis) -> list[str]:
    """What fails first, then how much is explained and what is left (HTML sentences)."""
    parts = []
    if diagnosis.heldout == "undecided" and diagnosis.verdict in ("missing_physics", "measurement"):
        parts.append("The held-out data do not decide whether it predicts better.")
    told = diagnosis.judged.explained
    if told is not None and told.sure and diagnosis.verdict in ("missing_physics", "measurement", "unmodelled"):
        what = "A force without a name" if diagnosis.verdict == "unmodelled" else "It"
        text = (
            f"{what} explains <strong>{_percent(told.share)}</strong> ({_percent(told.low)} to "
            f"{_percent(told.high)}) of what the scene misses on blocks that the fit did not see"
        )
        form = diagnosis.judged.free_form
        if form is not None and diagnosis.verdict != "unmodelled":
            text += f"; the best force without a name {_percent(form)}"
        parts.append(text + ".")
    left = diagnosis.remains
    if left is not None:
        when = "" if left.t is None else f" from {number(left.t[0])} to {number(left.t[1])} s"
        text = (
            f"What is left is more than noise, {length(left.rms, _unit(diagnosis))} rms on such blocks, "
            f"{times(left.times_floor)} times the floor, most of it on {listed(bodies(left.bodies), 3)}{when}"
        )
        like = "" if left.looks_like.startswith("nothing") else f"; it looks like {escaped(left.looks_like)}"
        parts.append(text + like + ".")
    return parts


def _shows_most(diagnosis: Diagnosis) -> str:
    """One sentence on the clearest place of the mismatch."""
    place = max(diagnosis.places, key=lambda p: p.z)
    text = "The scene fails most clearly"
    if place.bodies:
        text += f" on {listed(bodies(place.bodies), 4)}"
    if len({c.name for c in diagnosis.cases}) > 1:
        text += f" in {escaped(place.case)}"
    t = place.when.get("t")
    if t:
        text += f" from {number(t[0])} to {number(t[1])} s"
    return text + (f" (z = {place.z:.1f})." if place.z <= 37 else " (z over 37).")


def remainder(
    final: float, naive: float | None, floor: float | None, part: str, quiet: bool, right_law: Sequence[float] = ()
) -> str:
    """What is left, held against the noise floor, said plainly (HTML).

    ``quiet``: what remains in training looks like noise. A held-out error starts from a fitted state, so that
    in a single recording it may well be twice its mean. ``right_law``: what is left of simulated recordings in which
    nothing else is wrong, when the numbers are found from frames as noisy as these.
    """
    if not floor:
        return "How large the noise alone would be is not known."
    ratio = final / floor
    if ratio < NOISE:
        return "That is what noise alone would leave: nothing is left to explain."
    if quiet and len(right_law) and final <= max(right_law):
        return (
            f"That is {times(ratio)} times what noise alone would leave, and no more than is left where the law is "
            f"right and its numbers are found from frames as noisy as these ({times(min(right_law) / floor)} to "
            f"{times(max(right_law) / floor)} times): nothing more is claimed."
        )
    if ratio < 2 and quiet:
        return (
            f"That is {times(ratio)} times what noise alone would leave on average, and what remains in "
            "training looks like "
            "noise: nothing more is claimed."
        )
    text = f"Noise alone would leave about {times(ratio)} times less"
    if naive is not None and naive > final and naive > floor:
        share = 1 - (final**2 - floor**2) / (naive**2 - floor**2)
        shown = f"{100 * share:.0f}" if share < 0.99 else f"{min(100 * share, 99.9):.1f}"
        text += f": {shown} % of the {part} misfit (squared) is explained, <strong>the rest is not</strong>"
    else:
        text += ": <strong>that remainder is unexplained</strong>"
    return text + "."


def whiteness_text(white: Whiteness, known: bool) -> str:
    size = f"χ² {number(white.z, 2)} s.d. from that of noise, " if known else ""
    p = "p &lt; 10<sup>−16</sup>" if white.p < 1e-16 else f"p = {number(white.p, 2)}"
    return f"{size}memory {counted_frames(white.memory)}, {p}"


def counted_frames(memory: float) -> str:
    return "none" if memory < 1.05 else f"{memory:.1f} frames" if memory < 10 else f"{memory:.0f} frames"


# ---- parts of the page --------------------------------------------------------------------------


def table(
    head: Sequence[str], rows: Sequence[Sequence[str]], numeric: Sequence[int] = (), kind: str = ""
) -> str:
    def cell(tag: str, k: int, text: str) -> str:
        right = ' class="n"' if k in numeric else ""
        return f"<{tag}{right}>{text}</{tag}>"

    lines = [f'<div class="scroll"><table class="{kind}"><thead><tr>']
    lines += [cell("th", k, text) for k, text in enumerate(head)]
    lines.append("</tr></thead><tbody>")
    for row in rows:
        lines.append("<tr>" + "".join(cell("td", k, text) for k, text in enumerate(row)) + "</tr>")
    lines.append("</tbody></table></div>")
    return "".join(lines)


def _law_box(diagnosis: Diagnosis) -> str:
    """The equation of every added law with its numbers."""
    numbers = fitted_numbers(diagnosis.revised, diagnosis.spread, adjustable=False)
    boxes = []
    flexible = nameless(diagnosis)
    for term in added(diagnosis):
        mine = [f for f in numbers if f.law == term.mechanism]
        lines = [f'<p class="equation">{equation(term.expression)}</p>']
        if flexible and len(mine) > 3:
            lines.append(
                f'<p class="values">{counted(len(mine), "number")} fitted; <a href="#flexible">what they '
                "give</a></p>"
            )
        else:
            lines.append(f'<p class="values">{_values(term, mine, diagnosis)}</p>')
        whom = _acting(term, diagnosis)
        poor = " (the best named law, which leaves too much to count as an explanation)"
        poor = poor if diagnosis.verdict == "unmodelled" and not flexible else ""
        lines.append(f'<p class="who">{escaped(term.mechanism)}{poor}{f" on {whom}" if whom else ""}</p>')
        boxes.append('<div class="law">' + "".join(lines) + "</div>")
    return "".join(boxes)


def _acting(term: Term, diagnosis: Diagnosis) -> str:
    if term.mechanism in APPARATUS:
        return ""
    every = list(dict.fromkeys(b.id for c in diagnosis.cases for b in c.recording.scene.bodies if b.mobile))
    acting = list(term.bodies or every)
    if set(acting) >= set(every) and len(every) > 1:
        return "both bodies" if len(every) == 2 else f"all {len(every)} bodies"
    return listed(bodies(acting), 8)


def _values(term: Term, mine: Sequence[Fitted], diagnosis: Diagnosis) -> str:
    parts = []
    names = list(dict.fromkeys(f.name for f in mine))
    for name in names:
        rows = [f for f in mine if f.name == name]
        if len(rows) > 3:
            low, high = min(rows, key=lambda f: f.value), max(rows, key=lambda f: f.value)
            parts.append(
                f"{equation(name)} = {number(low.value)} ({escaped(low.body)}) to {number(high.value)} "
                f"{unit_text(high.unit)} ({escaped(high.body)}), <a href='#parameters'>one for each body</a>"
            )
            continue
        for f in rows:
            value, between = interval(f.value, f.low, f.high, f.unit)
            whom = f" ({escaped(bodies([f.body])[0])})" if f.body else ""
            parts.append(
                f"{equation(name)}{whom} = {value}"
                + (f" <span class='ci'>[95 %: {between}]</span>" if between else "")
            )
    parts += [f"{equation(k)} = {v:g}" for k, v in term.choices.items()]
    scalars = [(k, v, unit) for k, (v, unit) in term.fixed.items() if np.ndim(v) == 0]
    parts += [f"{equation(k)} = {number(v)} {unit_text(unit)}" for k, v, unit in scalars]
    if any(v for k, v in term.choices.items() if k == "p") or (
        "r_0" in term.expression and term.choices.get("p")
    ):
        radii = {b.id: b.radius for c in diagnosis.cases for b in c.recording.scene.bodies if b.mobile}
        parts.append(f"r<sub>0</sub> = {length(float(np.mean(list(radii.values()))), 'm')}")
    return "; ".join(parts)


def _error_table(diagnosis: Diagnosis) -> str:
    unit = _unit(diagnosis)
    whole = any(e.whole is not None for e in diagnosis.held.values())
    head = ["", "training", "held out"] + (["held out, starts fitted to whole recordings"] if whole else [])
    adjusted = bool(diagnosis.recalibrated.hypothesis.terms)
    labels = {
        "naive": "naive scene, as given",
        "recalibrated": "recalibrated" + ("" if adjusted else " (nothing is adjustable)"),
        "revised": "revised" + ("" if diagnosis.found else " (no law added)"),
    }
    rows = []
    for model, label in labels.items():
        held = diagnosis.held.get(model)
        row = [
            f'<span class="dot {model}"></span>{label}',
            length(_rms(diagnosis.train, model), unit),
            length(_rms(diagnosis.held, model), unit),
        ]
        if whole:
            row.append(length(held.whole if held else None, unit))
        rows.append(row)
    floor = [
        '<span class="dot floor"></span>noise floor',
        length(diagnosis.floor[0], unit),
        length(diagnosis.floor[1], unit),
    ]
    rows.append(floor + (["–"] if whole else []))
    if len(diagnosis.right_law):
        middle = length(float(np.median(diagnosis.right_law)), unit)
        rows.append(["right law, numbers fitted", "–", middle] + (["–"] if whole else []))
    return table(head, rows, numeric=range(1, len(head)), kind="errors")


def _error_text(diagnosis: Diagnosis) -> str:
    held = [c for c in diagnosis.cases if c.held_out]
    split = [c for c in diagnosis.cases if c.scored.any() and not c.held_out]
    text = f"Root mean square of seen minus predicted, in {_unit(diagnosis)}, over all measured numbers. "
    if held:
        text += f"Held out: {counted(len(held), 'whole recording')}; "
        text += "the start is fitted on the first 20 % and the rest is scored. "
    elif split:
        text += (
            "Held out: the last 40 % of the time, into which the simulation runs on from the training part. "
        )
    text += (
        "The noise floor is what the final scene leaves on recordings simulated with it and the same noise."
    )
    if len(diagnosis.right_law):
        text += " Where its numbers, too, are found from the training part of such recordings, more is left."
    if any(not c.sigma_known for c in diagnosis.cases):
        text += " The noise was not given for all recordings; it is estimated from how rough the tracks are."
    return f'<p class="note">{text}</p>'


def _places(diagnosis: Diagnosis) -> str:
    if not diagnosis.places:
        return ""
    seen = {c.name: c.bodies for c in diagnosis.cases}
    # a recording of one body is named by that body, or the other way round
    single = all(len(seen.get(p.case, ())) == 1 for p in diagnosis.places)
    several = len(seen) > 1
    rows = []
    for place in diagnosis.places[:12]:
        t = place.when.get("t")
        where = [
            f"{axis} {number(span[0])} to {number(span[1])} m"
            for axis in "xy"
            if (span := place.where.get(axis)) and span[1] > span[0]
        ]
        row = [] if single and several else [listed(list(place.bodies), 6)]
        row += [escaped(place.case)] if several else []
        rows.append([
            *row, "over 37" if place.z > 37 else f"{place.z:.1f}",
            number(place.p, 2) if place.p > 1e-299 else "below 10<sup>−299</sup>",
            f"{number(t[0])} to {number(t[1])} s" if t else "–", ", ".join(where) or "–",
            f"{number(place.speed[0], 2)} to {number(place.speed[1], 2)} m/s" if place.speed else "–",
        ])  # fmt: skip
    head = ([] if single and several else ["body"]) + (["recording"] if several else [])
    k = len(head)
    text = table([*head, "z", "p", "time", "place", "speed"], rows, numeric=(k, k + 1), kind="tight")
    more = len(diagnosis.places) - 12
    return text + (f'<p class="note">and {counted(more, "place")} more</p>' if more > 0 else "")


def _parameters(diagnosis: Diagnosis) -> str:
    parts = []
    laws = fitted_numbers(diagnosis.revised, diagnosis.spread, adjustable=False) if diagnosis.found else []
    if laws:
        rows = []
        for f in laws:
            value, between = interval(f.value, f.low, f.high)
            rows.append([
                escaped(f.law), equation(f.name),
                escaped(f.body or "all it acts on") if f.law not in APPARATUS else "camera",
                value, between + (" (at its bound)" if f.at_bound else ""), unit_text(f.unit) or "1",
            ])  # fmt: skip
        parts.append(table(["law", "", "body", "value", "central 95 %", "unit"], rows, numeric=(3, 4)))
        meanings = dict.fromkeys(f"{equation(f.name)}: {equation(f.meaning)}" for f in laws if f.meaning)
        if meanings:
            parts.append(f'<p class="note">{"; ".join(meanings)}.</p>')
        if diagnosis.spread > 1.0:
            parts.append(
                f'<p class="note">Intervals are widened {times(math.sqrt(diagnosis.spread))} times, '
                "because what the fit "
                "leaves over is larger than the noise, or remembers.</p>"
            )
    before = fitted_numbers(diagnosis.recalibrated, diagnosis.spread, adjustable=True)
    if before:
        after = (
            fitted_numbers(diagnosis.revised, diagnosis.spread, adjustable=True)
            if diagnosis.found
            else before
        )
        free = [f for t in diagnosis.recalibrated.hypothesis.terms for f in t.free]
        rows = []
        for f, g, given in zip(before, after, free, strict=True):
            value, between = interval(f.value, f.low, f.high)
            row = [
                escaped(f.name) + (f" ({escaped(f.body)})" if f.body else ""), number(given.first), value,
                between + (" (at its bound)" if f.at_bound else ""),
            ]  # fmt: skip
            if diagnosis.found:
                value, between = interval(g.value, g.low, g.high)
                row += [value, between + (" (at its bound)" if g.at_bound else "")]
            rows.append([*row, f"{number(given.low)} to {number(given.high)}", unit_text(f.unit) or "1"])
        head = ["adjustable", "believed", "recalibrated", "central 95 %"]
        head += ["with the law", "central 95 %"] if diagnosis.found else []
        parts.append(table([*head, "allowed", "unit"], rows, numeric=range(1, len(head) + 1)))
    if not parts:
        parts.append(
            "<p>No number was fitted besides the starts of the bodies: nothing is adjustable and no law "
            "was added.</p>"
        )
    if diagnosis.dropped_bodies:
        parts.append('<h3 id="dropped">Bodies for which the law was not kept</h3>')
        parts.append(
            table(
                ["body", "why"], [[escaped(b), escaped(why)] for b, why in diagnosis.dropped_bodies.items()]
            )
        )
    return "".join(parts)


def _next(diagnosis: Diagnosis) -> str:
    proposal = diagnosis.proposal
    if proposal is None:
        return ""
    a, b = (spoken(n) for n in proposal.separates)
    sure = (
        "which would settle it"
        if proposal.d_prime > 4
        else "which would still leave doubt"
        if proposal.d_prime < DECIDES
        else "which is likely to show"
    )
    # d' is an expectation under the winner, the loser refitted
    return (
        f"<h2>The experiment to do next</h2><p>To separate {a} from {b}: "
        f"<strong>{escaped(proposal.change)}</strong>. "
        f"Expected discrimination d′ = {number(proposal.d_prime, 2)} after the other law is refitted, "
        f"{sure}.</p>"
    )


def versions() -> list[str]:
    """The packages that a result rests on, with their versions."""
    found = []
    for package in ("pymunk", "numba", "numpy", "scipy", "matplotlib"):
        try:
            found.append(f"{package} {importlib.metadata.version(package)}")
        except importlib.metadata.PackageNotFoundError:
            continue
    return found


def _made(diagnosis: Diagnosis) -> str:
    rows = []
    for case in diagnosis.cases:
        recording = case.recording
        part = "held out" if case.held_out else "last 40 % held out" if case.scored.any() else "training"
        noise = ", ".join(
            dict.fromkeys(
                length(float(s), "rad" if c.kind == "angle" else "m")
                for s, c in zip(case.sigma, case.channels, strict=True)
            )
        )
        rows.append([
            escaped(case.name), part, str(len(case.t)), f"{number(float(case.t[-1] - case.t[0]))} s",
            noise + ("" if case.sigma_known else " (estimated)"), length(diagnosis.dt.get(case.name), "s"),
            f"<code>{recording.scene.identity[:12]}</code>",
        ])  # fmt: skip
    text = (
        f"granswim_pymunk {__version__}, Python {platform.python_version()}, {', '.join(versions())}; seed "
        f"{diagnosis.seed}; "
        f"{counted(diagnosis.runs, 'simulation')} in {diagnosis.seconds:.0f} s."
    )
    return f"<p>{escaped(text)}</p>" + table(
        ["recording", "used as", "frames", "length", "noise, 1 s.d.", "dt", "scene (SHA-256)"],
        rows,
        numeric=(2, 3, 5),
    )


def captions(diagnosis: Diagnosis) -> dict[str, tuple[str, str]]:
    """Alternative text and caption of every figure."""
    several = len(diagnosis.cases) > 12
    shown = (
        " The recordings shown are the held-out ones, at most 12, those with the largest naive error."
        if several
        else ""
    )
    same = any(alike for _, alike in diagnosis.rivals)
    after = whiteness_text(diagnosis.white_revised, _known(diagnosis))
    curve = diagnosis.flexible is not None and drawn_over(all_laws()[diagnosis.flexible.mechanism]) != "place"
    return {
        "overlay": (
            "Seen track with the naive and the revised simulation over it",
            "Seen track and simulation. Grey: held out, never looked at before the verdict was fixed. In "
            "the plane, disks are "
            "drawn to scale where they start (open) and where they end (filled; coloured rings: where the "
            "simulation ends)."
            + shown,
        ),
        "errors_over_time": (
            "Seen minus predicted over time, before and after",
            "Seen minus predicted over time; with several measured numbers in a frame, their root mean "
            "square.",
        ),
        "innovations": (
            "Innovations over time and by body in standard deviations, before and after",
            "Innovations of the training part: seen minus predicted in standard deviations of the noise, "
            "by body. "
            "Right: their root mean square; noise alone gives 1. Before: "
            f"{whiteness_text(diagnosis.white_recalibrated, _known(diagnosis))}"
            + (f". After: {after}." if diagnosis.found else "."),
        ),
        "windows": (
            "Map of short windows coloured by their misfit",
            "The training part in short windows, each started anew, under the scene as recalibrated: where "
            "a body does not "
            "do what the scene says even over a short time. z is that of χ² against what remains when the "
            "physics is right.",
        ),
        "flexible": (
            "The force that no named law gives",
            "The fitted force without a name, over what the recordings visit"
            + (" (band: central 95 %)." if curve else "."),
        ),
        "candidates": (
            "Candidates ranked by gain, with surviving fraction and inner test",
            "Every candidate refitted by simulation, alone. Bars run from the misfit without it to the "
            "misfit with it (the number: fall in χ²)"
            ", so the longest takes most away. Surviving fraction: the share of its signature that "
            "recalibration cannot imitate. "
            "Inner test: prediction of a part of the training data that the fit did not see; further right "
            "is better. "
            "The choice rests on both, and on few numbers where candidates are alike. ° apparatus"
            + ("; ≈ cannot be told apart from the law named" if same else "") + ".",
        ),
        "held_out": ("Held-out errors by recording", "Errors by recording; the same as in the table, taken "
                                                     "apart."),
        "null": (
            "Histogram of the best gains found in noise, with this case marked",
            "The same search on what remains, with its phases shuffled: the best gain it finds in noise of "
            "the same spectrum.",
        ),
    }  # fmt: skip


def _known(diagnosis: Diagnosis) -> bool:
    return all(c.sigma_known for c in diagnosis.cases if not c.held_out)


def page(diagnosis: Diagnosis, pictures: dict[str, bytes]) -> str:
    """The report as one HTML text; ``pictures``: PNG by figure name, embedded."""
    told = captions(diagnosis)

    def picture(name: str) -> str:
        if name not in pictures:
            return ""
        alt, caption = told[name]
        data = base64.b64encode(pictures[name]).decode("ascii")
        return (
            f'<figure id="{name}"><div class="scroll"><img alt="{escaped(alt)}" '
            f'src="data:image/png;base64,{data}"></div>'
            f"<figcaption>{caption}</figcaption></figure>"
        )

    training = [c.name for c in diagnosis.cases if not c.held_out]
    held = [c.name for c in diagnosis.cases if c.held_out]
    kicker = f"Diagnosis of {listed(training, 6)}" + (f"; held out: {listed(held, 6)}" if held else "")
    body = [
        f'<p class="kicker">{kicker}</p><h1>{headline(diagnosis)}</h1>',
        _law_box(diagnosis),
        f"<p>{summary(diagnosis)}</p>",
        "<h2>Errors</h2>", _error_table(diagnosis), _error_text(diagnosis),
        "<h2>Track and simulation</h2>", player(film_of(diagnosis)), picture("overlay"), picture("errors_over_time"),
        "<h2>Is what remains noise?</h2>", picture("innovations"),
    ]  # fmt: skip
    if diagnosis.places or "windows" in pictures:
        body += ["<h2>Where the mismatch is</h2>"]
        if not diagnosis.places:
            body.append("<p>No part of the data stands out by itself.</p>")
        body += [_places(diagnosis), picture("windows")]
    if "flexible" in pictures:
        body += ["<h2>The force without a name</h2>", picture("flexible")]
    if "candidates" in pictures:
        body += ["<h2>Candidates</h2>", picture("candidates")]
    if "held_out" in pictures:
        body += ["<h2>Held-out errors by recording</h2>", picture("held_out")]
    if "null" in pictures:
        body += ["<h2>Could it be chance?</h2>", picture("null")]
    body += ['<h2 id="parameters">Parameters</h2>', _parameters(diagnosis)]
    if diagnosis.notes:
        body += ["<h2>Notes</h2><ul>", *(f"<li>{escaped(note)}</li>" for note in diagnosis.notes), "</ul>"]
    body += [_next(diagnosis), "<h2>How this was made</h2>", _made(diagnosis)]
    title = (
        f"{diagnosis.verdict.replace('_', ' ')}: {', '.join(training[:3])}{' …' if len(training) > 3 else ''}"
    )
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escaped(title)}</title><style>{STYLE_SHEET}</style></head>\n<body><main>"
        + "\n".join(part for part in body if part)
        + "</main></body></html>\n"
    )


# ---- files --------------------------------------------------------------------------------------


def write_report(diagnosis: Diagnosis, out: Path) -> Path:
    """Write ``out/report.html`` (readable alone) and ``out/figures/*.png``; return the page's path.

    Every file appears whole or not at all; pictures of an earlier report that this one has not are removed.
    Raises InputError where ``out`` cannot be written to.
    """
    out = Path(out)
    pictures: dict[str, bytes] = {}
    for name, draw in figures(diagnosis).items():
        buffer = io.BytesIO()
        draw().savefig(buffer, format="png", dpi=170)
        pictures[name] = buffer.getvalue()
    text = page(diagnosis, pictures)
    folder = out / "figures"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name in NAMES:
            path = folder / f"{name}.png"
            if name in pictures:
                put(path, pictures[name])
            else:
                path.unlink(missing_ok=True)
        put(out / "report.html", text.encode("utf-8"))
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror or error}", file=out) from None
    return out / "report.html"


def put(path: Path, data: bytes) -> None:
    """Write under a temporary name beside, then rename."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        temporary.write_bytes(data)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
