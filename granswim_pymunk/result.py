"""What a diagnosis found, as one object whatever was recorded: the verdict, a report in words, figures.

It reads the verdict of the contract, and draws by the figure functions of the report.
"""

from __future__ import annotations

import copy
import html
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .errors import InputError
from .inference.criteria import DEFAULT, Criteria
from .inference.mechanisms import (
    CLAIMED,
    NONE_DIFFERS,
    NOTHING,
    forms_in_words,
    nameless,
    none_differs,
    not_told_apart,
    parts_of,
    worse_rivals,
)
from .inference.result import not_tried

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .inference.result import Diagnosis

MOST_BODIES = 8  # named one by one
MOST_NUMBERS = 6  # told one by one in a line
MORE = 1.5  # noise floors from which a held-out error is said to be more than noise
CENTRAL_95 = 1.959964  # standard errors to each side of a value that hold 95 % of a normal distribution
SPOKEN = {
    "no_mismatch": "nothing is missing",
    "recalibrate": "a declared parameter was off; with it mended nothing is missing",
    "missing_physics": "the scene leaves out physics that has a name",
    "unmodelled": "something is missing that no known law explains",
    "measurement": "the camera, the clock or the tracker is off",
}
OPEN = "something is missing; the time was up before all known laws were tried"
LARGEST_VERDICT = 50_000_000  # bytes


class Text(str):
    """Text that a shell or a notebook shows as it is, not as a quoted string."""

    def __repr__(self) -> str:
        return str(self)


class Result(Mapping[str, Any]):
    """What ``diagnose`` found, or what ``load_verdict`` read. A mapping: its items are those of the verdict.

    verdict : the content of verdict.json, plain numbers and texts
    found : the whole result, with what its figures are drawn from; None where it was read from a file
    out : folder with report and figures, None where nothing was written
    """

    def __init__(
        self, verdict: Mapping[str, Any], found: Diagnosis | None = None, out: str | Path | None = None
    ) -> None:
        self.verdict = dict(verdict)
        self.found = found
        self.out = None if out is None else Path(out)

    # ---- a mapping ----------------------------------------------------------------------------

    def __getitem__(self, key: str) -> Any:
        return self.verdict[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self.verdict)

    def __len__(self) -> int:
        return len(self.verdict)

    def to_dict(self) -> dict[str, Any]:
        """A copy of the verdict: plain dictionaries, lists, numbers and texts, as they stand in verdict.json."""
        return copy.deepcopy(self.verdict)

    @property
    def names(self) -> tuple[str, ...]:
        """The laws that were named, each once: ("linear_drag",)."""
        return tuple(dict.fromkeys(entry["name"] for entry in self.verdict["mechanisms"]))

    @property
    def criteria(self) -> Criteria:
        """What decided; a file does not say it: the usual criteria."""
        return DEFAULT if self.found is None else self.found.criteria

    # ---- words --------------------------------------------------------------------------------

    def __repr__(self) -> str:
        entries = self.verdict["mechanisms"]
        laws = [f"{entry['name']}{_on(entry['bodies'])}" for entry in entries[:3]]
        laws += [f"{len(entries) - 3} more"] if len(entries) > 3 else []
        told = self.verdict.get("explained")
        share = f" ({_percent(told['share'])} explained)" if told else ""
        return f"<Result {self.verdict['verdict']}{': ' if laws else ''}{', '.join(laws)}{share}>"

    def summary(self) -> Text:
        """All of it in words and numbers, section by section.

        A number has its standard error, a quarter of the width of its central 95 % (1/3.92), and that interval.
        """
        v = self.verdict
        sections = [
            ("Verdict", [f"{v['verdict']}: {_spoken(v)}".rstrip(": ")]),
            ("Laws", [line for entry in v["mechanisms"] for line in _law_lines(entry)]),
            ("Explained", standing(v)),
            ("Recalibrated", _parameter_lines(v.get("recalibrated") or {})),
            (f"Errors in {v['fit']['unit']}", _error_lines(v["fit"])),
            ("Rivals", _rival_lines(v)),
            ("Where", [_place_line(place) for place in v["mismatch"]]),
            ("Chance", _chance_lines(v.get("null"))),
            ("Next experiment", _next_lines(v.get("next_experiment"), self.criteria.verdict.decides)),
            ("Notes", list(v.get("notes") or ())),
        ]
        lines: list[str] = []
        for title, content in sections:
            if content:
                lines += [f"[[{title}]]", *(f"    {line}" for line in content)]
        return Text("\n".join(lines))

    def _repr_html_(self) -> str:
        """The first screen of a notebook: verdict, laws with their numbers, how much is explained."""
        from .report.words import equation, escaped

        v = self.verdict
        rows = []
        for entry in v["mechanisms"]:
            numbers = "<br>".join(html.escape(line) for line in _parameter_lines(entry["parameters"]))
            rows.append(
                f"<tr><td>{escaped(entry['name'])}</td><td>{escaped(_bodies(entry['bodies']))}</td>"
                f"<td>{equation(entry['expression'] or '')}</td><td>{numbers}</td></tr>"
            )
        head = "<tr><th>law</th><th>on</th><th>expression</th><th>numbers</th></tr>"
        table = f"<table>{head}{''.join(rows)}</table>" if rows else ""
        said = "".join(f"<li>{escaped(line)}</li>" for line in (*standing(v), *_rival_lines(v)))
        return (
            f"<div><p><b>{escaped(v['verdict'])}</b>: {escaped(_spoken(v))}</p>{table}"
            f"{f'<ul>{said}</ul>' if said else ''}</div>"
        )

    # ---- figures ------------------------------------------------------------------------------

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the figures that ``plot`` can draw, in the order of the report; empty where there are none."""
        return tuple(self._figures())

    def plot(self, part: str | None = None) -> Figure:
        """One figure of the report, the first where not said: usually recording and simulations laid over each other.

        part : one of ``parts``
        Of a verdict that was read from a file it is the picture that lies beside it in ``figures``.
        Raises InputError where there is no such figure.
        """
        figures = self._figures()
        if not figures:
            raise InputError("this result has no figures: they are not in verdict.json, but in figures beside it")
        name = next(iter(figures)) if part is None else part
        if name not in figures:
            raise InputError(f"no figure {name!r}; there are: {', '.join(figures)}", where="plot")
        return figures[name]()

    def _figures(self) -> dict[str, Any]:
        """Name to a function that draws, in the order of the page."""
        if self.found is None:
            folder = None if self.out is None else self.out / "figures"
            files = sorted(folder.glob("*.png")) if folder is not None and folder.is_dir() else []
            files.sort(key=lambda file: file.stem != "overlay")
            return {file.stem: (lambda file=file: _picture(file)) for file in files}
        from .report import pictures

        return {name: drawing.draw for name, drawing in pictures(self.found).items()}


def load_verdict(path: str | Path) -> Result:
    """A verdict that was written: the folder of a diagnosis, or a verdict.json. Figures are those beside it.

    Raises InputError where there is none, or where it is not of the contract's form.
    """
    from .inference.result import FORMAT, check_verdict

    file = Path(path)
    if file.is_dir():
        file = file / "verdict.json"
    try:
        if not file.is_file():
            raise InputError("no such verdict; give the folder of a diagnosis, or its verdict.json", file=path)
        if file.stat().st_size > LARGEST_VERDICT:
            raise InputError(f"is larger than a verdict can be ({LARGEST_VERDICT} bytes)", file=file)
        verdict = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read: {getattr(error, 'strerror', None) or error}", file=file) from None
    except (ValueError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"is not JSON: {error}", file=file) from None
    if not isinstance(verdict, dict) or verdict.get("format") != FORMAT:
        raise InputError(f'should be a verdict with format = "{FORMAT}"', file=file)
    try:
        check_verdict(verdict)
        result = Result(verdict, out=file.parent)
        result.summary()
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"is not a whole verdict: {error}", file=file) from None
    return result


# ---- words ---------------------------------------------------------------------------------------


def standing(verdict: Mapping[str, Any]) -> list[str]:
    """How much is explained, whether it is complete, what is left, and what held-out data say: one line each."""
    lines = []
    withdrawn = list(dict.fromkeys(r["name"] for r in verdict["rivals"] if r.get("withdrawn")))
    if withdrawn:
        lines.append(f"withdrawn, as held-out data are predicted worse with it: {', '.join(withdrawn)}")
    told, left = verdict.get("explained"), verdict.get("remains")
    if told:
        form = told["best_free_form"]
        beside = "" if form is None else f"; the best force without a name {_percent(form)}"
        undecided = verdict.get("heldout") == "undecided"
        part = ", of the training part; held-out data do not decide" if undecided else ""
        lines.append(
            f"explains {_percent(told['share'])} ({100 * told['low']:.0f} to {_percent(told['high'])}) "
            f"of the mismatch on blocks that the fit did not see{part}{beside}"
        )
    if left and left.get("alike"):
        lines.append(f"what is left passes for noise; but {forms_in_words(left['alike'])}: its form is not told")
    elif left:
        ratio, bodies, why = left["times_floor"], ", ".join(left["bodies"][:MOST_BODIES]), left.get("why") or ()
        much = f"{_times(ratio)} times the noise is left, most" if ratio is not None else "more than noise is left"
        if ratio is not None and ratio < DEFAULT.left.as_small:
            no_noise = "" if why else ", yet not all noise"
            much = f"what is left is as small as the noise ({_times(ratio)} times){no_noise}, most"
        # where nothing is named there is no approximation to call the best
        so_far = "the best approximation so far: " if verdict["verdict"] in CLAIMED else ""
        like = "" if why and left["looks_like"] == NOTHING else f"; it looks like {left['looks_like']}"
        because = f"; not complete, as {' and '.join(why)}" if why else ""
        lines.append(f"{so_far}{much} on {bodies}{like}{because}")
    elif verdict.get("complete"):
        lines.append("what is left passes for noise")
    if verdict.get("heldout"):
        lines.append(f"held-out data: {verdict['heldout']}{_left_there(verdict['fit']['heldout'])}")
    return lines


def law_line(entry: Mapping[str, Any]) -> str:
    """The expression of a law with its numbers and their intervals; of many numbers the first, and how many more."""
    if not entry["expression"] or not entry["parameters"]:
        return str(entry["expression"])
    # behind the equation stand the numbers, which are given anew
    said, numbers, told = entry["expression"].split("; "), f"{next(iter(entry['parameters']))} = ", []
    at = next((k for k, text in enumerate(said) if text.startswith(numbers)), len(said))
    for name, p in entry["parameters"].items():
        unit = p.get("unit") or ""
        for part, value, low, high in parts_of(name, p):
            if value is None or isinstance(value, str | bool):
                told.append(f"{part} = {value}")
            else:
                told.append(f"{part} = {in_digits(value, low, high)}{'' if unit in ('', '1') else f' {unit}'}")
    said[at : at + 1] = [shortly(told)]
    form = nameless(entry["name"]) and none_differs(entry["parameters"])
    return "; ".join(said + ([NONE_DIFFERS] if form else []))


def adjusted(verdict: Mapping[str, Any], believed: Mapping[str, Sequence[float]]) -> str:
    """The adjustables as they were fitted, and what was believed of them (value, low, high); empty without any."""
    told = []
    for name, p in (verdict.get("recalibrated") or {}).items():
        before = f", believed {believed[name][0]:.4g}" if name in believed else ""
        told += [f"{part} = {in_digits(*numbers)}{before}" for part, *numbers in parts_of(name, p)]
    return f"adjusted: {shortly(told, '; ')}" if told else ""


def shortly(told: Sequence[str], between: str = ", ") -> str:
    """The first of them, and how many there are more."""
    more = len(told) - MOST_NUMBERS
    return between.join(told[:MOST_NUMBERS]) + (f"{between.rstrip()} and {more} more" if more > 0 else "")


def in_digits(value: float, low: float | None, high: float | None) -> str:
    """ "0.873 (0.830 to 0.916)": as many digits as the interval allows, and at least two of each number."""
    if low is None and high is None:
        return f"{value:.4g}"
    if low is None or high is None:
        return f"{value:.3g} ({f'below {high:.3g}' if low is None else f'above {low:.3g}'})"
    last = math.floor(math.log10((high - low) / 2)) - 1 if high > low else 0  # power of ten of the last digit told

    def shown(x: float) -> str:
        if x == 0:
            return "0"
        first = math.floor(math.log10(abs(x)))
        digits = min(max(first - last + 1, 2), 6)
        decimals = digits - 1 - first
        return f"{round(x, decimals):.{max(decimals, 0)}f}" if -4 <= first < 5 else f"{x:.{digits - 1}e}"

    return f"{shown(value)} ({shown(low)} to {shown(high)})"


def _left_there(errors: Mapping[str, float | None]) -> str:
    """What the revised scene leaves of held-out data, where it is more than the noise."""
    revised, floor = errors.get("revised"), errors.get("noise_floor")
    if not revised or not floor or revised < MORE * floor:
        return ""
    before = errors.get("recalibrated")
    part = f", {_percent(revised / before)} of what the scene without it leaves" if before else ""
    return f", {_times(revised / floor)} times the noise is left there{part}"


def _times(ratio: float) -> str:
    return f"{ratio:.2g}" if ratio < 10 else f"{ratio:.0f}"


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"


def _bodies(names: Sequence[str]) -> str:
    """ "a, b", a long list cut: "a, b ... and 30 more"."""
    more = len(names) - MOST_BODIES
    return ", ".join(names[:MOST_BODIES]) + (f" and {more} more" if more > 0 else "")


def _on(names: Sequence[str]) -> str:
    return f" on {_bodies(names)}" if names else ""


def _spoken(verdict: Mapping[str, Any]) -> str:
    """The verdict in words; that it is open where nothing stands and not all was tried."""
    told = str(verdict["verdict"])
    return OPEN if told == "unmodelled" and not_tried(verdict) else SPOKEN.get(told, "")


def _law_lines(entry: Mapping[str, Any]) -> list[str]:
    said = f": {entry['expression']}" if entry["expression"] else ""
    head = f"{entry['name']}{_on(entry['bodies'])}{said}"
    lines = _parameter_lines(entry["parameters"])
    if nameless(entry["name"]):  # of a form some are chosen, and some may be any
        lines = [line.replace("(chosen)", "(no interval)") for line in lines]
    if nameless(entry["name"]) and none_differs(entry["parameters"]):
        lines.append(NONE_DIFFERS)
    return [head, *(f"    {line}" for line in lines)]


def _parameter_lines(parameters: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """A line for each number: value, standard error, relative error, central 95 %; vectors a line for each part."""
    width = max((len(name) for name in parameters), default=0) + 1
    lines = []
    for name, p in parameters.items():
        unit = p.get("unit") or ""
        if not isinstance(p["value"], list):
            lines.append(f"{name + ':':<{width}} {_with_error(p['value'], p.get('low'), p.get('high'), unit)}")
            continue
        for part, value, low, high in parts_of(name, p):
            told = _with_error(value, low, high, unit)
            if low is None and high is None:  # a component that these data do not show
                told = told.replace("(chosen)", "(no interval)")
            lines.append(f"{part + ':':<{width}} {told}")
    return lines


def _with_error(value: Any, low: Any, high: Any, unit: str) -> str:
    """ "0.00102 +/- 3.1e-05 kg/s (3.0 %), 95 %: 0.00096 to 0.00108"; a choice, or an open interval, as it is."""
    unit = "" if unit in ("", "1") else f" {unit}"
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number:
        return f"{value}{unit}"
    if low is None and high is None:
        return f"{value:.4g}{unit} (chosen)"
    if low is None or high is None:
        end = f"below {high:.4g}" if low is None else f"above {low:.4g}"
        return f"{value:.4g}{unit}, 95 %: {end}"
    error = (high - low) / (2 * CENTRAL_95)
    digits = 4
    if error > 0 and value != 0:
        # the error in two digits, and the value as far as they reach
        digits = min(max(math.floor(math.log10(abs(value))) - math.floor(math.log10(error)) + 2, 2), 8)
    share = f" ({100 * error / abs(value):.2g} %)" if value else ""
    return f"{value:.{digits}g} +/- {error:.2g}{unit}{share}, 95 %: {low:.{digits}g} to {high:.{digits}g}"


def _error_lines(fit: Mapping[str, Any]) -> list[str]:
    """A small table: training and held out, by model."""
    models = [name for name in fit["train"] if any(fit[part].get(name) is not None for part in ("train", "heldout"))]
    if not models:
        return []
    lines = [" " * 10 + "".join(f"{name.replace('_', ' '):>14}" for name in models)]
    for part, title in (("train", "training"), ("heldout", "held out")):
        cells = [fit[part].get(name) for name in models]
        lines.append(f"{title:<10}" + "".join(f"{'-' if c is None else f'{c:.3g}':>14}" for c in cells))
    return lines


def _rival_lines(verdict: Mapping[str, Any]) -> list[str]:
    lines = [said] if (said := not_told_apart(verdict)) else []
    return lines + [f"{how}: {', '.join(names)}" for how, names in worse_rivals(verdict)]


def _place_line(place: Mapping[str, Any]) -> str:
    """Bodies, spans of place, time, phase and speed, z and p of one place of the mismatch."""
    spans = {**place["where"], **place["when"], "speed": place.get("speed"), "frequency": place.get("frequency")}
    units = {"x": "m", "y": "m", "gap": "m", "t": "s", "phase": "", "speed": "m/s", "frequency": "Hz"}
    said = [f"{key} {s[0]:.3g} to {s[1]:.3g} {units[key]}".rstrip() for key in units if (s := spans.get(key))]
    if spans.get("before_contact"):
        said.append("before contact")
    whom = " ".join(filter(None, (spans.get("region"), _bodies(place["bodies"]))))
    return f"{', '.join([whom, *said])}: z = {place['z']:.3g}, p = {place['p']:.2g}"


def _chance_lines(null: Mapping[str, Any] | None) -> list[str]:
    if not null:
        return []
    return [
        f"where nothing is missing, as much is found with p = {null['p_false_alarm']:.2g} "
        f"({null['replicates']} tries in noise)"
    ]


def _next_lines(proposed: Mapping[str, Any] | None, decides: float) -> list[str]:
    """``decides``: d' from which an experiment is expected to tell two laws apart."""
    if not proposed:
        return []
    apart = f", tells {' from '.join(proposed['separates'])}" if proposed.get("separates") else ""
    d_prime = proposed.get("d_prime")
    if d_prime is not None and d_prime < decides:
        return [f"none that was thought of would decide; the best is {proposed['change']} (d' = {d_prime:.2g})"]
    return [f"{proposed['change']}{apart}" + ("" if d_prime is None else f" (d' = {d_prime:.2g})")]


def _picture(file: Path) -> Figure:
    """A stored PNG as a figure of its own size. Raises InputError where it cannot be read."""
    from matplotlib.figure import Figure
    from PIL import Image

    try:
        with Image.open(file) as image:
            image.load()
            figure = Figure(figsize=(image.width / 100, image.height / 100), dpi=100)
            axis = figure.add_axes((0.0, 0.0, 1.0, 1.0))
            axis.imshow(image)
    except OSError as error:
        raise InputError(f"is no picture: {error}", file=file) from None
    axis.set_axis_off()
    return figure
