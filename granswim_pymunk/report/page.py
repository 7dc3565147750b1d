"""The report: one HTML file that needs nothing beside it, in the order in which a person asks.

It reads a ``Diagnosis`` and nothing else, and simulates nothing. Every kind of recording has the same page; what its
figures are drawn from is its own, see ``PICTURES``.
"""

from __future__ import annotations

import base64
import html
import importlib
import importlib.metadata
import io
import math
import platform
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import __version__
from ..errors import InputError
from ..files import written_whole
from ..inference.criteria import Criteria, using
from ..inference.mechanisms import NONE_DIFFERS, meaning, none_differs
from ..inference.result import MODELS, PARTLY, Diagnosis, Table, write_verdict
from ..laws import all_laws
from .glossary import linked
from .player import player
from .sentences import BEYOND, answers, headline, is_apparatus, mobile, unit_of, unit_shown
from .sheet import STYLE_SHEET
from .style import Drawing
from .words import bodies, counted, equation, escaped, interval, length, listed, number, times, unit_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# where the figures of each kind are drawn: a function of its evidence, see ``Drawing``
PICTURES = {"bodies": "figures", "bed": "bed_figures", "unseen": "unseen_figures", "together": "together_figures"}
# where what plays in the page is made of the evidence, for kinds that have a film
FILMS = {"bodies": "films", "bed": "bed_films", "unseen": "unseen_films"}
SECTIONS = (
    "Seen and simulated", "Is what remains noise?", "Where the mismatch is", "The force without a name", "Candidates",
    "Held-out errors", "Could it be chance?",
)  # fmt: skip
SHOWN = 12  # places in the table
SEVERAL = 3  # bodies with a number each, beyond which the box shows the range


def pictures(d: Diagnosis) -> dict[str, Drawing]:
    """The figures of a diagnosis by name, in the order of the page; none where there is nothing to draw."""
    if d.evidence is None or d.kind not in PICTURES:
        return {}
    found: dict[str, Drawing] = _module(d.kind).pictures(d.evidence)
    order = {name: k for k, name in enumerate(SECTIONS)}
    ordered = sorted(found.items(), key=lambda item: order[item[1].section])
    return {name: replace(drawing, draw=partial(_drawn, drawing, d.criteria)) for name, drawing in ordered}


def _drawn(drawing: Drawing, criteria: Criteria) -> Figure:
    """A figure with lines where the diagnosis had its thresholds."""
    with using(criteria):
        return drawing.draw()


def film(d: Diagnosis) -> str:
    """Recording and simulations, playing side by side; empty for kinds that have no film."""
    if d.evidence is None or d.kind not in FILMS:
        return ""
    return player(importlib.import_module(f".{FILMS[d.kind]}", __package__).film_of(d.evidence))


def _module(kind: str) -> Any:
    """Where the figures of a kind are; loaded when they are wanted."""
    return importlib.import_module(f".{PICTURES[kind]}", __package__)


# ---- parts of the page --------------------------------------------------------------------------


def table(
    head: Sequence[str], rows: Sequence[Sequence[str]], numeric: Sequence[int] = (), kind: str = ""
) -> str:
    def cell(tag: str, k: int, text: str) -> str:
        right = ' class="n"' if k in numeric else ""
        # on a narrow screen each row is a card, with the name of its column before each cell
        named = f' data-name="{head[k]}"' if cards and tag == "td" else ""
        text = f"<span>{text}</span>" if named else text
        return f"<{tag}{right}{named}>{text}</{tag}>"

    cards = len(head) > 3
    kind = " ".join(filter(None, (kind, "cards" if cards else "")))
    lines = [f'<div class="scroll"><table class="{kind}"><thead><tr>']
    lines += [cell("th", k, text) for k, text in enumerate(head)]
    lines.append("</tr></thead><tbody>")
    for row in rows:
        lines.append("<tr>" + "".join(cell("td", k, text) for k, text in enumerate(row)) + "</tr>")
    lines.append("</tbody></table></div>")
    return "".join(lines)


def _filled(head: Sequence[str], rows: Sequence[Sequence[str]], numeric: Sequence[str], kind: str) -> str:
    """A table without the columns in which nothing stands."""
    keep = [k for k in range(len(head)) if any(row[k] for row in rows)]
    shown = [[row[k] or "–" for k in keep] for row in rows]
    right = [n for n, k in enumerate(keep) if head[k] in numeric]
    return table([head[k] for k in keep], shown, numeric=right, kind=kind)


def _given(value: Any, low: Any, high: Any, unit: str) -> tuple[str, str]:
    """A number, a vector or a choice with its unit, and its central 95 %, where it has one."""
    if isinstance(value, list):
        parts = [
            _given(v, low[k] if isinstance(low, list) else None, high[k] if isinstance(high, list) else None, "")
            for k, v in enumerate(value)
        ]
        between = f"({', '.join(b or '–' for _, b in parts)})" if any(b for _, b in parts) else ""
        shown = f"({', '.join(v for v, _ in parts)})"
        return shown + (f"\u00a0{unit_text(unit)}" if unit_text(unit) else ""), between
    if isinstance(value, str | bool) or value is None:
        return escaped("–" if value is None else value), ""
    if low is None and high is None:
        shown = str(value) if isinstance(value, int) else number(value)
        return shown + (f"\u00a0{unit_text(unit)}" if unit_text(unit) else ""), ""
    return interval(
        float(value), -math.inf if low is None else float(low), math.inf if high is None else float(high), unit
    )


def _value(p: Mapping[str, Any]) -> str:
    shown, between = _given(p["value"], p.get("low"), p.get("high"), p.get("unit") or "")
    return shown + (f" <span class='ci'>[95 %: {between}]</span>" if between else "")


def _law_boxes(d: Diagnosis, drawn: Mapping[str, Any]) -> str:
    """The equation of every law that was found, with its numbers."""
    groups: dict[str, list[Mapping[str, Any]]] = {}
    for entry in d.verdict["mechanisms"]:
        groups.setdefault(entry["name"], []).append(entry)
    return "".join(_law_box(d, entries, drawn) for entries in groups.values())


def _law_box(d: Diagnosis, entries: Sequence[Mapping[str, Any]], drawn: Mapping[str, Any]) -> str:
    first = entries[0]
    # the first part is the equation; what follows a semicolon are numbers, which come below with their intervals
    equation_alone, *more = (first["expression"] or "").split("; ")
    lines = [f'<p class="equation">{equation(equation_alone)}</p>']
    values = []
    if first["name"] == "unknown" and len(first["parameters"]) > SEVERAL:
        told = '; <a href="#flexible">what they give</a>' if "flexible" in drawn else ""
        values.append(f"{counted(len(first['parameters']), 'number')} fitted{told}")
        values += [NONE_DIFFERS] if none_differs(first["parameters"]) else []
    else:
        for name, p in first["parameters"].items():
            if len(entries) == 1 or p.get("low") is None:
                values.append(f"{equation(name)}\u00a0=\u00a0{_value(p)}")
            elif len(entries) <= SEVERAL:
                values += [
                    f"{equation(name)} ({listed(bodies(e['bodies']), 2)}) = {_value(e['parameters'][name])}"
                    for e in entries
                ]
            else:
                values.append(_range(name, entries))
    if "r_0" in equation_alone and (first["parameters"].get("p") or {}).get("value"):
        values.append(f"r<sub>0</sub> = {length(float(np.mean(list(mobile(d).values()))), 'm')}")
    # what is told of a number that has no interval of its own
    values += [equation(said) for said in more if " = " not in said]
    if values:
        lines.append(f'<p class="values">{"; ".join(values)}</p>')
    whom = _acting(d, entries)
    lines.append(f'<p class="who">{escaped(first["name"])}{f" on {whom}" if whom else ""}</p>')
    return '<div class="law">' + "".join(lines) + "</div>"


def _range(name: str, entries: Sequence[Mapping[str, Any]]) -> str:
    numbers = [(e["parameters"][name]["value"], e["bodies"][0], e["parameters"][name]["unit"]) for e in entries]
    low, high = min(numbers), max(numbers)
    return (
        f"{equation(name)} = {number(low[0])} ({escaped(low[1])}) to {number(high[0])} {unit_text(high[2])} "
        f"({escaped(high[1])}), <a href='#parameters'>one for each body</a>"
    )


def _acting(d: Diagnosis, entries: Sequence[Mapping[str, Any]]) -> str:
    if is_apparatus(entries[0]["name"]):
        return ""
    acting = list(dict.fromkeys(b for e in entries for b in e["bodies"]))
    every = mobile(d)
    if set(acting) >= set(every) and len(every) > 1:
        return "both bodies" if len(every) == 2 else f"all {len(every)} bodies"
    return listed(bodies(acting), 8) if acting else ""


def _errors(d: Diagnosis) -> str:
    fit, unit = d.verdict["fit"], unit_of(d)
    whole = fit.get("heldout_start_fitted_to_whole")
    if not any(v is not None for part in ("train", "heldout") for v in fit[part].values()):
        return ""
    labels = {
        "naive": "naive scene, as given",
        "recalibrated": "recalibrated" + ("" if d.verdict["recalibrated"] else " (nothing is adjustable)"),
        "revised": "revised" + ("" if d.verdict["mechanisms"] else " (no law added)"),
        "noise_floor": "noise floor",
    }
    rows = []
    for model in MODELS:
        dot = f'<span class="dot {"floor" if model == "noise_floor" else model}"></span>'
        row = [length(fit[part].get(model), unit) for part in ("train", "heldout")]
        rows.append([dot + labels[model], *row, *([length(whole.get(model), unit)] if whole else [])])
    if d.right_law is not None:
        low, high = (length(v, unit) for v in d.right_law)
        rows.append(["right law, numbers fitted", "–", f"{low} to {high}", *(["–"] if whole else [])])
    head = ["", "training", "held out", *(["held out, starts fitted to whole recordings"] if whole else [])]
    return "<h2>Errors</h2>" + table(head, rows, numeric=range(1, len(head)), kind="errors") + _error_text(d)


def _error_text(d: Diagnosis) -> str:
    window = d.verdict["fit"]["window"]
    text = f"Root mean square of seen minus predicted, over all numbers measured in {unit_of(d)}"
    text += f" of windows of {length(window, 's')}. " if window else ". "
    if d.held_out:
        text += f"Held out: {counted(len(d.held_out), 'whole recording')}. "
    elif any(u.part == PARTLY for u in d.used):
        text += "Held out: a part of each recording, of tracks the last of their time. "
    text += "The noise floor is what the final scene leaves of recordings simulated with it and the same noise."
    if d.right_law is not None:
        text += " Where its numbers, too, are found from the training part of such recordings, more is left."
    if any(u.estimated for u in d.used):
        text += " Where noise was not given, or the tracks show another, it is estimated from how rough they are."
    return f'<p class="note">{text}</p>'


def _places(d: Diagnosis) -> str:
    def span(pair: Sequence[float] | None, unit: str, digits: int = 3) -> str:
        return f"{number(pair[0], digits)} to {number(pair[1], digits)} {unit}".strip() if pair else ""

    rows = []
    places = d.verdict["mismatch"]
    for k, place in enumerate(places[:SHOWN]):
        where, when = place["where"], place["when"]
        at = [
            f"{axis} {span(pair, 'm')}" for axis in ("x", "y", "gap") if (pair := where.get(axis)) and pair[1] > pair[0]
        ]
        frequency = place.get("frequency")
        rows.append([
            listed(bodies(place["bodies"]), 6) if place["bodies"] else "", escaped(where.get("region") or ""),
            escaped(d.places_in[k]) if len(d.used) > 1 and k < len(d.places_in) else "",
            f"over {BEYOND:.0f}" if place["z"] > BEYOND else f"{place['z']:.1f}",
            number(place["p"], 2) if place["p"] > 1e-299 else "below 10<sup>−299</sup>",
            span(when.get("t"), "s"), span(when.get("phase"), "", 2), "<br>".join(at),
            span(place.get("speed"), "m/s", 2),
            span(frequency, "Hz") if frequency and frequency[1] > frequency[0] else "",
        ])  # fmt: skip
    if not rows:
        return ""
    head = ("body", "region", "recording", "z", "p", "time", "phase", "place", "speed", "frequency")
    more = len(places) - SHOWN
    rest = f'<p class="note">and {counted(more, "place")} more</p>' if more > 0 else ""
    return _filled(head, rows, ("z", "p"), "tight") + rest


def _rivals(d: Diagnosis) -> str:
    def said(rival: Mapping[str, Any]) -> str:
        if rival.get("withdrawn"):
            return "withdrawn: held-out data are predicted worse with it"
        if rival.get("share") is not None:
            return f"not accepted: explains {100 * max(rival['share'], 0.0):.0f} %"
        return "cannot be told apart" if rival["indistinguishable"] else "worse"

    rows = [[escaped(r["name"]), number(r["gain_heldout"]), said(r)] for r in d.verdict["rivals"]]
    head = ["law", "half the fall of χ² on held-out data", "on these data"]
    return "<h2>Rivals</h2>" + table(head, rows, numeric=(1,)) if rows else ""


def _parameters(d: Diagnosis) -> str:
    rows, meanings = [], []
    for entry in d.verdict["mechanisms"]:
        whom = "camera" if is_apparatus(entry["name"]) else listed(bodies(entry["bodies"]), 3)
        for name, p in entry["parameters"].items():
            shown, between = _given(p["value"], p["low"], p["high"], "")
            rows.append([escaped(entry["name"]), equation(name), whom, shown, between, unit_shown(p["unit"] or "")])
            if told := meaning(entry["name"], name):
                meanings.append(f"{equation(name)}: {equation(told)}")
    parts = []
    if rows:
        head = ("law", "number", "body", "value", "central 95 %", "unit")
        parts.append(_filled(head, rows, ("value", "central 95 %"), ""))
    if meanings:
        parts.append(f'<p class="note">{"; ".join(dict.fromkeys(meanings))}.</p>')
    if d.widened > 1.0 and (rows or d.verdict["recalibrated"]):
        parts.append(
            f'<p class="note">Intervals are widened {times(d.widened)} times, because what the fit leaves over is '
            "larger than the noise, or depends on what it was a frame before.</p>"
        )
    parts.append(_adjustables(d))
    if not any(parts):
        parts = [
            "<p>No number was fitted besides the starts of the bodies: nothing is adjustable and no law was added.</p>"
        ]
    return '<h2 id="parameters">Parameters</h2>' + "".join(parts)


def _adjustables(d: Diagnosis) -> str:
    rows = []
    for name, p in d.verdict["recalibrated"].items():
        shown, between = _given(p["value"], p["low"], p["high"], "")
        before, allowed = "", ""
        if name in d.believed:
            value, low, high = d.believed[name]
            before, allowed = number(value), f"{number(low)} to {number(high)}"
            edge = 1e-6 * max(abs(p["value"]), abs(high - low))
            between += " (at its bound)" if p["value"] - low <= edge or high - p["value"] <= edge else ""
        rows.append([escaped(name), before, shown, between, allowed, _unit_of_adjustable(name)])
    head = ("adjustable", "believed", "recalibrated", "central 95 %", "allowed", "unit")
    return _filled(head, rows, head[1:-1], "") if rows else ""


def _unit_of_adjustable(name: str) -> str:
    """Of ``pin.length`` what the law declares; nothing where the name is no law's."""
    law, _, parameter = name.partition(".")
    declared = all_laws().get(law)
    parameters = declared.parameters if declared else ()
    return next((unit_shown(p.unit) for p in parameters if parameter in (p.name, *p.arguments)), "")


def _own_table(given: Table) -> str:
    cells = [[escaped(c) for c in row] for row in given.rows]
    note = f'<p class="note">{escaped(given.note)}</p>' if given.note else ""
    shown = table([escaped(h) for h in given.header], cells, numeric=tuple(given.numeric))
    return f"<h2>{escaped(given.title)}</h2>{shown}{note}"


def _references(d: Diagnosis) -> str:
    laws = all_laws()
    found = dict.fromkeys(
        f"<li>{escaped(e['name'])}: {escaped(laws[e['name']].reference)}</li>"
        for e in d.verdict["mechanisms"] if e["name"] in laws and laws[e["name"]].reference
    )  # fmt: skip
    return "<h2>References</h2><ul>" + "".join(found) + "</ul>" if found else ""


def versions() -> list[str]:
    """The packages that a result rests on, with their versions."""
    found = []
    for package in ("pymunk", "numba", "numpy", "scipy", "matplotlib"):
        try:
            found.append(f"{package} {importlib.metadata.version(package)}")
        except importlib.metadata.PackageNotFoundError:
            continue
    return found


def _made(d: Diagnosis) -> str:
    rows = []
    for used in d.used:
        noise = ", ".join(dict.fromkeys(length(size, unit) for size, unit in used.noise))
        rows.append([
            escaped(used.name), used.part, str(used.frames), f"{number(used.length)} s",
            noise + (" (estimated)" if used.estimated else ""), "" if used.dt is None else length(used.dt, "s"),
            f"<code>{used.identity[:12]}</code>",
        ])  # fmt: skip
    text = (
        f"granswim_pymunk {__version__}, Python {platform.python_version()}, {', '.join(versions())}; seed {d.seed}; "
        f"{counted(d.runs, 'simulation')} in {d.seconds:.0f} s."
    )
    head = ("recording", "used as", "frames", "length", "noise, 1 s.d.", "dt", "scene (SHA-256)")
    shown = _filled(head, rows, ("frames", "length", "dt"), "") if rows else ""
    return f"<h2>How this was made</h2><p>{escaped(text)}</p>{shown}"


# ---- the page -----------------------------------------------------------------------------------


def page(d: Diagnosis, drawn: Mapping[str, tuple[Drawing, bytes]]) -> str:
    """The report as one HTML text; ``drawn``: for each figure what it shows and its PNG, embedded."""

    def picture(name: str) -> str:
        drawing, data = drawn[name]
        alt = escaped(html.unescape(drawing.alt or drawing.caption.split(". ")[0]))
        encoded = base64.b64encode(data).decode("ascii")
        return (
            f'<figure id="{escaped(name)}"><div class="scroll"><img alt="{alt}" src="data:image/png;base64,{encoded}">'
            f"</div><figcaption>{drawing.caption}</figcaption></figure>"
        )

    kicker = f"Diagnosis of {listed(d.training, 6)}" + (f"; held out: {listed(d.held_out, 6)}" if d.held_out else "")
    body = [
        f'<p class="kicker">{kicker}</p><h1>{headline(d)}</h1>',
        _law_boxes(d, drawn),
        *(f"<p><strong>{question}</strong> {answer}</p>" for question, answer in answers(d)),
        _errors(d),
    ]
    for section in SECTIONS:
        shown = [picture(name) for name, (drawing, _) in drawn.items() if drawing.section == section]
        first = {"Seen and simulated": film, "Where the mismatch is": _places}.get(section, lambda d: "")(d)
        if shown and not first and section == "Where the mismatch is":
            first = "<p>No place stands out from the rest.</p>"
        if shown or first:
            body += [f"<h2>{section}</h2>", first, *shown]
    body += [_rivals(d), _parameters(d), *(_own_table(t) for t in d.tables)]
    if d.verdict["notes"]:
        body += ["<h2>Notes</h2><ul>", *(f"<li>{escaped(note)}</li>" for note in d.verdict["notes"]), "</ul>"]
    body, words = linked([part for part in body if part])
    body += [_references(d), words, _made(d)]
    more = " …" if len(d.training) > 3 else ""
    title = f"{d.verdict['verdict'].replace('_', ' ')}: {', '.join(d.training[:3])}{more}"
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escaped(title)}</title><style>{STYLE_SHEET}</style></head>\n<body><main>"
        + "\n".join(part for part in body if part)
        + "</main></body></html>\n"
    )


# ---- files --------------------------------------------------------------------------------------


def write_report(d: Diagnosis, out: Path) -> Path:
    """Write ``out/report.html`` (readable alone) and ``out/figures/*.png``; return the page's path.

    Every file appears whole or not at all; pictures of an earlier report that this one has not are removed.
    Raises InputError where ``out`` cannot be written to.
    """
    out = Path(out)
    drawn: dict[str, tuple[Drawing, bytes]] = {}
    for name, drawing in pictures(d).items():
        buffer = io.BytesIO()
        drawing.draw().savefig(buffer, format="png", dpi=170)
        drawn[name] = drawing, buffer.getvalue()
    text = page(d, drawn)
    folder = out / "figures"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for old in folder.glob("*.png"):
            if old.stem not in drawn and old.stem in _known():
                old.unlink()
        for name, (_, data) in drawn.items():
            put(folder / f"{name}.png", data)
        put(out / "report.html", text.encode("utf-8"))
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror or error}", file=out) from None
    return out / "report.html"


def _known() -> set[str]:
    """Names of all figures that a report may have."""
    own = {name for kind in PICTURES if kind != "together" for name in _module(kind).NAMES}
    return own | {f"{kind}_{name}" for kind in PICTURES for name in own}


def write_diagnosis(d: Diagnosis, out: Path) -> None:
    """Write verdict and revised scenes first, so that they are there whatever becomes of the pictures; then the page.

    Raises InputError where ``out`` cannot be written to.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        write_verdict(d, out)
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror or error}", file=out) from None
    write_report(d, out)


def put(path: Path, data: bytes) -> None:
    """Write a file that appears whole or not at all."""
    with written_whole(path) as stream:
        stream.write(data)
