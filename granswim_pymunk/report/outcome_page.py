"""The report of a bed: the same page as that of single bodies, made of the parts its diagnosis hands over."""

from __future__ import annotations

import base64
import html
import io
import math
import platform
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import __version__
from ..errors import InputError
from ..laws import all_laws
from .page import put, table, versions
from .sheet import STYLE_SHEET
from .words import bodies, counted, equation, escaped, interval, length, listed, number, spoken, unit_text

if TYPE_CHECKING:
    from ..diagnosis.outcome import Outcome, Table

_LABELS = {
    "naive": "naive scene, as given", "recalibrated": "recalibrated", "revised": "revised",
    "noise_floor": "noise floor",
}  # fmt: skip


def _law_box(entry: Mapping[str, Any]) -> str:
    """The equation of one entry of ``mechanisms`` with its numbers."""
    # the first part is the equation; what follows a semicolon are numbers, which come below with their intervals
    expression = entry["expression"].split("; ")[0]
    lines = [f'<p class="equation">{equation(expression)}</p>']
    values = []
    for name, p in entry["parameters"].items():
        value = p["value"]
        if isinstance(value, list):
            shown = []
            for k, part in enumerate(value):
                low = p["low"][k] if isinstance(p["low"], list) else None
                high = p["high"][k] if isinstance(p["high"], list) else None
                shown.append(_value(part, low, high, p["unit"]))
            values.append(f"{equation(name)} = ({', '.join(shown)})")
        else:
            values.append(f"{equation(name)} = {_value(value, p['low'], p['high'], p['unit'])}")
    if values:
        lines.append(f'<p class="values">{"; ".join(values)}</p>')
    whom = listed(bodies(entry["bodies"]), 8) if entry["bodies"] else ""
    lines.append(f'<p class="who">{escaped(entry["name"])}{f" on {whom}" if whom else ""}</p>')
    return '<div class="law">' + "".join(lines) + "</div>"


def _value(value: Any, low: float | None, high: float | None, unit: str) -> str:
    if isinstance(value, str):
        return escaped(value)
    if isinstance(value, int):
        return str(value)
    if low is None or high is None or not all(map(math.isfinite, (low, high))):
        return number(value) + (f" {unit_text(unit)}" if unit_text(unit) else "")
    shown, between = interval(value, low, high, unit)
    return shown + (f" <span class='ci'>[95 %: {between}]</span>" if between else "")


def _answers(outcome: Outcome) -> str:
    return "".join(f"<p><strong>{escaped(q)}</strong> {escaped(a)}</p>" for q, a in outcome.answers)


def _errors(verdict: Mapping[str, Any]) -> str:
    fit = verdict["fit"]
    if not any(v is not None for part in ("train", "heldout") for v in fit[part].values()):
        return ""
    unit = (fit["unit"] or "").split()[0] if fit["unit"] else ""
    rows = []
    for model, label in _LABELS.items():
        dot = f'<span class="dot {"floor" if model == "noise_floor" else model}"></span>'
        rows.append([dot + label] + [length(fit[part].get(model), unit) for part in ("train", "heldout")])
    return "<h2>Errors</h2>" + table(["", "training", "held out"], rows, numeric=(1, 2), kind="errors")


def _places(verdict: Mapping[str, Any]) -> str:
    rows = []
    for place in verdict["mismatch"][:12]:
        where = place["where"].get("region") or ""
        spans = []
        for key, unit in (("t", "s"), ("phase", "cycle")):
            pair = place["when"].get(key)
            if pair:
                spans.append(f"{number(pair[0])} to {number(pair[1])} {unit}")
        if place.get("frequency") and place["frequency"][1] > place["frequency"][0]:
            spans.append(f"{number(place['frequency'][0])} to {number(place['frequency'][1])} Hz")
        z = "over 37" if place["z"] > 37 else f"{place['z']:.1f}"
        rows.append([listed(bodies(place["bodies"]), 3), escaped(where) or "–", z, number(place["p"], 2),
                     ", ".join(spans) or "–"])  # fmt: skip
    if not rows:
        return ""
    return "<h2>Where the mismatch is</h2>" + table(
        ["body", "region", "z", "p", "when"], rows, numeric=(2, 3), kind="tight"
    )


def _rivals(verdict: Mapping[str, Any]) -> str:
    def said(rival: Mapping[str, Any]) -> str:
        if rival.get("withdrawn"):
            return "withdrawn: held-out data are predicted worse with it"
        if rival.get("share") is not None:
            return f"not accepted: explains {100 * max(rival['share'], 0.0):.0f} %"
        return "cannot be told apart" if rival["indistinguishable"] else "worse"

    rows = [[escaped(r["name"]), number(r["gain_heldout"]), said(r)] for r in verdict["rivals"]]
    return "<h2>Rivals</h2>" + table(["law", "gain", "on these data"], rows, numeric=(1,)) if rows else ""


def _recalibrated(verdict: Mapping[str, Any]) -> str:
    rows = []
    for name, p in verdict["recalibrated"].items():
        value = _value(p["value"], p["low"], p["high"], "")
        rows.append([escaped(name), value])
    return "<h2>Adjusted parameters</h2>" + table(["parameter", "value"], rows, numeric=()) if rows else ""


def _next(verdict: Mapping[str, Any]) -> str:
    proposal = verdict["next_experiment"]
    if not proposal:
        return ""
    names = listed([spoken(n) for n in proposal["separates"]])
    d_prime = proposal.get("d_prime")
    sure = f" Expected discrimination d′ = {number(d_prime, 2)}." if d_prime is not None else ""
    return (
        f"<h2>The experiment to do next</h2><p>To separate {names}: <strong>{escaped(proposal['change'])}</strong>."
        f"{sure}</p>"
    )


def _chance(verdict: Mapping[str, Any]) -> str:
    null = verdict["null"]
    if not null:
        return ""
    return (
        f"<p>Chance of a false alarm {number(null['p_false_alarm'], 2)}, "
        f"from {counted(null['replicates'], 'repeat')} without any missing law.</p>"
    )


def _own_table(given: Table) -> str:
    cells = [[escaped(c) for c in row] for row in given.rows]
    note = f'<p class="note">{escaped(given.note)}</p>' if given.note else ""
    shown = table([escaped(h) for h in given.header], cells, numeric=tuple(given.numeric))
    return f"<h2>{escaped(given.title)}</h2>{shown}{note}"


def outcome_page(outcome: Outcome, verdict: Mapping[str, Any], pictures: Mapping[str, bytes]) -> str:
    """The report as one HTML text; ``pictures``: PNG by figure name, embedded."""

    def picture(name: str) -> str:
        caption = outcome.figures[name][1]
        data = base64.b64encode(pictures[name]).decode("ascii")
        alt = escaped(html.unescape(caption.split(". ")[0]))
        return (
            f'<figure id="{escaped(name)}"><div class="scroll"><img alt="{alt}" '
            f'src="data:image/png;base64,{data}"></div><figcaption>{escaped(caption)}</figcaption></figure>'
        )

    kicker = f"Diagnosis of {listed(outcome.training, 6)}"
    if outcome.held_out:
        kicker += f"; held out: {listed(outcome.held_out, 6)}"
    body = [
        f'<p class="kicker">{kicker}</p><h1>{escaped(outcome.headline)}</h1>',
        *(_law_box(entry) for entry in verdict["mechanisms"]),
        _answers(outcome),
        _errors(verdict),
        _places(verdict),
        *(picture(name) for name in outcome.figures),
        _chance(verdict),
        _rivals(verdict),
        _recalibrated(verdict),
        *(_own_table(t) for t in outcome.tables),
    ]
    if verdict["notes"]:
        body += ["<h2>Notes</h2><ul>", *(f"<li>{escaped(note)}</li>" for note in verdict["notes"]), "</ul>"]
    laws = all_laws()
    references = [
        f"<li>{escaped(e['name'])}: {escaped(laws[e['name']].reference)}</li>"
        for e in verdict["mechanisms"]
        if e["name"] in laws and laws[e["name"]].reference
    ]
    if references:
        body += ["<h2>References</h2><ul>", *references, "</ul>"]
    body += [
        _next(verdict),
        "<h2>How this was made</h2>",
        f"<p>granswim_pymunk {__version__}, Python {platform.python_version()}, {escaped(', '.join(versions()))}; "
        f"seed {outcome.seed}; {counted(outcome.runs, 'simulation')} in {outcome.seconds:.0f} s.</p>",
    ]
    title = f"{verdict['verdict'].replace('_', ' ')}: {', '.join(outcome.training[:3])}"
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escaped(title)}</title><style>{STYLE_SHEET}</style></head>\n<body><main>"
        + "\n".join(part for part in body if part)
        + "</main></body></html>\n"
    )


def write_outcome_report(outcome: Outcome, verdict: Mapping[str, Any], out: Path) -> Path:
    """Write ``out/report.html`` and ``out/figures/*.png``; pictures of an earlier report there are removed.

    Raises InputError where ``out`` cannot be written to.
    """
    pictures: dict[str, bytes] = {}
    for name, (figure, _) in outcome.figures.items():
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", dpi=170)
        pictures[name] = buffer.getvalue()
    text = outcome_page(outcome, verdict, pictures)
    folder = out / "figures"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for old in folder.glob("*.png"):
            if old.stem not in pictures:
                old.unlink()
        for name, data in pictures.items():
            put(folder / f"{name}.png", data)
        put(out / "report.html", text.encode("utf-8"))
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror or error}", file=out) from None
    return out / "report.html"
