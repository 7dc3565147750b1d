"""The score as one HTML page that needs nothing beside it."""

from __future__ import annotations

import base64
import html
import io
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure as Drawing

from ..report.sheet import STYLE_SHEET
from ..report.style import COLOURS, MUTED, REVISED, SEEN, legend_above, styled
from .score import (
    NULLS,
    STRONG,
    Row,
    confusion,
    detection,
    figures_of_merit,
    held_out,
    is_failure,
    proportion,
)


@styled
def draw_detection(rows: Sequence[Row]) -> Drawing:
    """Share of concealed mechanisms that were noticed, and rightly named, against their standard errors."""
    figure = Drawing(figsize=(6.8, 2.9), layout="constrained")
    axis = figure.subplots()
    bins = detection(rows)
    middle = [float(np.sqrt(max(low, 1.2) * min(high, 120.0))) for low, high, *_ in bins]
    for column, colour, label in ((3, SEEN, "a mismatch was reported"), (4, REVISED, "right name or class")):
        shares = [proportion(b[column], b[2]) for b in bins]
        y = np.array([s[0] for s in shares if s])
        error = np.array([[s[0] - s[1], s[2] - s[0]] for s in shares if s]).T
        shift = 0.97 if column == 3 else 1.03
        axis.errorbar(np.array(middle) * shift, y, error, fmt="o-", color=colour, ms=4, capsize=2, label=label)
    for x, b in zip(middle, bins, strict=True):
        axis.annotate(f"n = {b[2]}", (x, -0.12), ha="center", fontsize=7.5, color="#555555")
    axis.axvline(STRONG, color=MUTED, lw=0.8, ls="--")
    axis.set(
        xscale="log", ylim=(-0.18, 1.08), xlabel="standard errors of the concealed effect", ylabel="share of cases"
    )
    _plain_ticks(axis)
    legend_above(figure, axis.get_legend_handles_labels()[0])
    return figure


def _plain_ticks(axis: Any) -> None:
    """Standard errors as plain numbers on a logarithmic scale."""
    axis.set_xlim(1.0, 170.0)
    axis.set_xticks((1, 2, 5, 10, 20, 50, 100), ("1", "2", "5", "10", "20", "50", "100"))
    axis.minorticks_off()


@styled
def draw_confusion(rows: Sequence[Row]) -> Drawing:
    """What was concealed against what was named."""
    truths, answers, table = confusion(rows)
    figure = Drawing(figsize=(6.8, 1.7 + 0.24 * len(truths)), layout="constrained")
    axis = figure.subplots()
    share = table / np.maximum(table.sum(axis=1, keepdims=True), 1)
    axis.imshow(share, cmap="Blues", vmin=0, vmax=1.3, aspect="auto")
    for i, j in zip(*np.nonzero(table), strict=True):
        axis.text(j, i, str(table[i, j]), ha="center", va="center", fontsize=8)
    axis.set_xticks(range(len(answers)), [a.replace("_", " ") for a in answers], rotation=60, ha="right")
    axis.set_yticks(range(len(truths)), [t.replace("_", " ") for t in truths])
    axis.set(xlabel="named first", ylabel="concealed")
    for spine in axis.spines.values():
        spine.set_visible(False)
    return figure


@styled
def draw_held_out(rows: Sequence[Row]) -> Drawing:
    """Held-out errors over the noise floor, one column of points for each stage."""
    figure = Drawing(figsize=(6.8, 2.7), layout="constrained")
    axis = figure.subplots()
    good = [r for r in rows if r.category == "mechanism" and r.right_name and r.held.get("noise_floor")]
    good.sort(key=lambda r: r.sigma)
    for key in ("naive", "recalibrated", "revised"):
        x = [r.sigma for r in good if r.held.get(key)]
        y = [r.held[key] / r.held["noise_floor"] for r in good if r.held.get(key)]  # type: ignore[operator]
        axis.plot(x, y, "o", ms=4, color=COLOURS[key], label=key, alpha=0.85)
    axis.axhline(1.0, color=COLOURS["floor"], lw=0.8)
    axis.set(xscale="log", yscale="log", xlabel="standard errors of the effect", ylabel="held-out error / floor")
    _plain_ticks(axis)
    legend_above(figure, axis.get_legend_handles_labels()[0])
    return figure


@styled
def draw_calibration(rows: Sequence[Row]) -> Drawing:
    """p-values of nulls and decoys against what they should be, and the time that a diagnosis took."""
    figure = Drawing(figsize=(6.8, 2.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    p = np.sort([r.p for r in rows if r.category in ("null", "decoy_adjustable") and r.p is not None])
    left.plot([0, 1], [0, 1], color=MUTED, lw=0.8)
    if len(p):
        left.step(np.append(p, 1.0), np.append(np.arange(1, len(p) + 1) / len(p), 1.0), where="post", color=REVISED)
    left.set(xlabel="reported p of a null", ylabel="share at or below", xlim=(0, 1), ylim=(0, 1.02))
    left.set_title(f"{len(p)} nulls")
    right.hist([r.seconds for r in rows], bins=20, color=MUTED)
    right.set(xlabel="seconds a case", ylabel="cases")
    return figure


def _picture(figure: Drawing) -> str:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()


def _table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    lines = [
        '<div class="scroll"><table><thead><tr>',
        *(f"<th>{html.escape(h)}</th>" for h in head),
        "</tr></thead><tbody>",
    ]
    for row in rows:
        lines.append("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>")
    return "".join([*lines, "</tbody></table></div>"])


def _share(share: tuple[float, float, float] | None) -> str:
    return "no cases" if share is None else f"{100 * share[0]:.0f} % ({100 * share[1]:.0f} to {100 * share[2]:.0f})"


def _words(name: str) -> str:
    return html.escape(name.replace("_", " ").replace("+", " and ")) or "nothing"


def write_page(
    rows: Sequence[Row], results: Sequence[Mapping[str, Any]], real: Mapping[str, Mapping[str, Any]], path: Path
) -> None:
    """Write the page; a note where there is nothing to show."""
    from .conceal import write_beside

    parts = [*_opening(rows), *_merit(rows), *_drawings(rows), *_failures(rows), *_real(real), *_cases(rows, results)]
    write_beside(path, "\n".join([*parts, "</main></body></html>"]))


def _opening(rows: Sequence[Row]) -> list[str]:
    """The head of the page: what was done, and of which recordings."""
    parts = [
        "<!doctype html><html lang='en'><head><meta charset='utf-8'>"
        "<meta name='viewport' content='width=device-width, initial-scale=1'>"
        f"<title>Concealed effects</title><style>{STYLE_SHEET}</style></head><body><main>",
        "<p class='kicker'>granswim prove</p>",
        f"<h1>{len(rows)} recordings with something concealed, or nothing</h1>",
        "<p>Each recording was computed by a simulator that is not the engine, its truth sealed under a published "
        "hash, and diagnosed by a process that was given the recording alone. Half of the effects have another "
        "functional form than the laws that a diagnosis knows.</p>",
    ]
    mix = Counter(r.setup for r in rows)
    if mix:
        kinds = ", ".join(f"{n} {name}" for name, n in sorted(mix.items()))
        parts.append(f"<p>The mix: {kinds}. A full bed has about 2200 grains, a small one 200 to 300; unseen: films "
                     "of the swimmer alone; curve: its speeds alone.</p>")  # fmt: skip
    return parts


def _merit(rows: Sequence[Row]) -> list[str]:
    """The figures that are asked for, and how they were reached."""
    merit = figures_of_merit(rows)
    missed = [f.what for f in merit if f.reached is False]
    empty = [f.what for f in merit if f.reached is None]
    rows_of_merit = []
    for f in merit:
        mark = "" if f.reached is None else "reached" if f.reached else "<strong>not reached</strong>"
        rows_of_merit.append([html.escape(f.what), f.asked, f"{f.hits} of {f.n}", _share(f.share), mark])
    held = held_out(rows)
    if "revised" in held:
        mark = "reached" if held["revised"] <= 1.1 else "<strong>not reached</strong>"
        forms = [
            f"{label} {held[key]:.2f}"
            for key, label in (("revised_known", "of a known form"), ("revised_other", "of another form"))
            if key in held
        ]
        beside = [f"naive {held['naive']:.1f}", f"recalibrated {held['recalibrated']:.1f}", *forms]
        shown = f"{held['revised']:.2f} ({', '.join(beside)})"
        rows_of_merit.append(
            ["held-out error over the floor, median", "at most 1.1", f"{held['n']:.0f} cases", shown, mark]
        )
    parts = ["<h2>The figures</h2>", _table(("what", "asked", "cases", "found (95 %)", ""), rows_of_merit)]
    if missed:
        parts.append(f"<p><strong>Not reached:</strong> {html.escape('; '.join(missed))}.</p>")
    if empty:
        parts.append(f"<p>No cases yet: {html.escape('; '.join(empty))}.</p>")
    parts.append(
        "<p class='note'>Standard errors: root of the chi2 that is left on tracks without noise when starts and "
        "adjustable numbers are fitted, on the 60 % of the time that a diagnosis learns from; in beds the same to "
        "first order, from windows of 16 ms (seen beds) or from common packings (unseen ones). d': the same with a "
        "rival refitted, beyond what the mechanism's own form leaves; not computed for curves and for films of full "
        "unseen beds, which do not count for the figures on naming. Both were computed by the proof's simulator and "
        "sealed with the truth, before the diagnosis. Class: the laws within d' 2 of the truth, or those that the "
        "verdict itself calls indistinguishable. Intervals are counted where the name is right and the form is the "
        "contract's.</p>"
    )
    return parts


def _drawings(rows: Sequence[Row]) -> list[str]:
    """Figures with their captions, and the false alarms."""
    parts: list[str] = []
    held = held_out(rows)
    if detection(rows):
        parts += _figure("Detection against strength", draw_detection(rows), "Concealed mechanisms, bins of their "
                         "standard errors, with central 95 % of a proportion.")  # fmt: skip
    if rows:
        parts += _figure("Named against concealed", draw_confusion(rows), "Effects of five standard errors and "
                         "more, and all nulls. none: no law was named; unknown: the verdict was unmodelled."
                         )  # fmt: skip
    if held["n"]:
        parts += _figure("Held-out errors", draw_held_out(rows), "Rightly named mechanisms; 1 is what perfect "
                         "knowledge of the physics would leave.")  # fmt: skip
    if rows:
        parts += _figure("Calibration and time", draw_calibration(rows), "Left: the share of nulls with a p at or "
                         "below its value; on the diagonal p is right, below it cautious. Right: wall time of a case."
                         )  # fmt: skip
    nulls = [r for r in rows if r.category in NULLS]
    if nulls:
        alarms = [r for r in nulls if r.physics_named]
        parts.append(f"<p>False alarms: {len(alarms)} of {len(nulls)} nulls and decoys had physics named, "
                     f"{_share(proportion(len(alarms), len(nulls)))}.</p>")  # fmt: skip
    return parts


def _failures(rows: Sequence[Row]) -> list[str]:
    """Every case that was not explained as it should have been."""
    failures = [r for r in rows if is_failure(r)]
    parts = [f"<h2>Failures ({len(failures)})</h2>"]
    if failures:
        table = []
        for r in failures:
            rival = f"{_words(r.rival)} {r.d_prime:.1f}" if r.rival else ""
            size = "" if math.isnan(r.sigma) else f"{r.sigma:.1f}"
            answer = html.escape(r.failed) if r.failed else f"{_words(r.verdict)}: {_words('+'.join(r.named))}"
            table.append([f"<a href='reports/{r.case}/report.html'>{r.case}</a>", _words(r.setup), _words(r.category),
                          _words("+".join(r.truth)), size, rival, answer])  # fmt: skip
        parts.append(
            _table(("case", "apparatus", "category", "concealed", "standard errors", "best rival, d'", "answer"), table)
        )
    else:
        parts.append("<p>None.</p>")
    return parts


def _real(real: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """What is told of the real recordings."""
    parts = ["<h2>Real recordings</h2>"]
    if real:
        table = []
        for name, result in real.items():
            v = result.get("verdict") or {}
            fit = (v.get("fit") or {}).get("heldout") or {}
            numbers = ", ".join(f"{k.replace('_', ' ')} {x:.3g}" for k, x in fit.items() if x is not None)
            named = ", ".join(dict.fromkeys(m["name"] for m in v.get("mechanisms", [])))
            table.append([_words(name), _words(v.get("verdict", "failed")), _words(named),
                          f"{numbers} [{(v.get('fit') or {}).get('unit', '')}]"])  # fmt: skip
        parts.append(_table(("recording", "verdict", "named", "held-out error"), table))
    else:
        parts.append("<p>Not run here (<code>granswim prove --full</code> does).</p>")
    parts.append("<p>No recording of a real bed has been available.</p>")
    return parts


def _cases(rows: Sequence[Row], results: Sequence[Mapping[str, Any]]) -> list[str]:
    """Every case with its truth, its answer and the hash of its seal."""
    table = []
    for r, result in zip(rows, results, strict=True):
        table.append([r.case, _words(r.setup), _words("+".join(r.truth)) + (" (other form)" if r.other_form else ""),
                      f"{r.sigma:.1f}" if r.sigma > 0 else "", _words(r.verdict), _words("+".join(r.named)),
                      f"<code>{result['commitment'][:12]}</code>"])  # fmt: skip
    header = ("case", "apparatus", "concealed", "standard errors", "verdict", "named", "hash")
    return ["<h2>Every case</h2>", _table(header, table)]


def _figure(title: str, drawing: Drawing, caption: str) -> list[str]:
    return [
        f"<h2>{html.escape(title)}</h2><div class='scroll'><figure><img alt='{html.escape(title)}' "
        f"src='{_picture(drawing)}'><figcaption>{html.escape(caption)}</figcaption></figure></div>"
    ]
