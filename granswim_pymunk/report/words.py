"""Numbers, laws and verdicts as a person reads them, in HTML."""

from __future__ import annotations

import html
import math
import re
from collections.abc import Iterable, Sequence

from ..inference.mechanisms import plainly

_GREEK = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "theta": "θ", "mu": "μ", "rho": "ρ", "sigma": "σ",
    "tau": "τ", "phi": "φ", "omega": "ω",
}  # fmt: skip
NARROW = "\u202f"  # a thin space at which no line is broken
_UNITS = {"1": "", "kg/s": "kg/s", "m/s^2": "m/s²", "m^2": "m²"}


def escaped(text: object) -> str:
    return html.escape(str(text), quote=True)


def spoken(mechanism: str) -> str:
    """A mechanism in a sentence (HTML): ``uniform_force`` is "a uniform force"."""
    return escaped(plainly(mechanism))


def bodies(names: Iterable[str]) -> list[str]:
    """Names of bodies in a sentence: one that is only a number is called "body 3"."""
    return [f"body {name}" if name.isdigit() else name for name in names]


def unit_text(unit: str) -> str:
    """A unit with its powers raised; nothing for a pure number."""
    if unit in _UNITS:
        return _UNITS[unit]
    return re.sub(r"\^(-?[0-9.]+)", lambda m: f"<sup>{m[1].replace('-', '−')}</sup>", escaped(unit))


def listed(names: Sequence[str], most: int = 4) -> str:
    """ "a, b and c" (HTML); a long list is cut and says how many more there are."""
    names = [html.escape(html.unescape(n), quote=True) for n in names]
    if len(names) > most:
        return ", ".join(names[: most - 1]) + f" and {len(names) - most + 1} others"
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + " and " + names[-1] if names else ""


def counted(count: int, one: str, many: str | None = None) -> str:
    return f"{count} {one if count == 1 else many or one + 's'}"


def _fixed(value: float, decimals: int) -> str:
    text = f"{value:.{max(decimals, 0)}f}"
    if float(text) == 0.0:
        text = text.replace("-", "")
    return text.replace("-", "−")


def _power(exponent: int) -> str:
    return f"{NARROW}×{NARROW}10<sup>{str(exponent).replace('-', '−')}</sup>" if exponent else ""


def number(value: float | None, digits: int = 3) -> str:
    """A number with so many significant digits; a dash where there is none."""
    if value is None or not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    exponent = math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}"))))
    if -3 <= exponent < 5:
        return _fixed(round(value, digits - 1 - exponent), digits - 1 - exponent)
    return _fixed(value / 10.0**exponent, digits - 1) + _power(exponent)


def interval(value: float, low: float, high: float, unit: str = "") -> tuple[str, str]:
    """Value with its unit, and "low to high", with the digits that the width of the interval allows, at least two each.

    An interval without an end is "above low" or "below high".
    """
    if math.isfinite(low) != math.isfinite(high):
        end = f"above {number(low)}" if math.isfinite(low) else f"below {number(high)}"
        return _with_unit(number(value), unit), end
    half = (high - low) / 2
    largest = max(abs(v) for v in (value, low, high))
    if not math.isfinite(half) or half <= 0 or largest == 0:
        return _with_unit(number(value), unit), ""
    exponent = math.floor(math.log10(largest))
    shift = exponent if not -2 <= exponent < 4 else 0
    # two digits of the half-width, yet never more than six of the value
    decimals = max(min(1 - math.floor(math.log10(half)), 5 - exponent) + shift, 0)
    scale = 10.0**shift
    if any(x and abs(x) / scale < 0.995 * 10.0 ** (1 - decimals) for x in (value, low, high)):
        # beside a wide interval a common number of decimals would round one of them away: each has its own
        v, a, b = (number(x, 2) for x in (value, low, high))
        return _with_unit(v, unit), f"{a} to {b}"
    v, a, b = (_fixed(x / scale, decimals) for x in (value, low, high))
    return _with_unit(f"{v}{_power(shift)}", unit), f"{a} to {b}{_power(shift)}"


def _with_unit(text: str, unit: str) -> str:
    shown = unit_text(unit)
    return f"{text}\u00a0{shown}" if shown else text


def length(value: float | None, unit: str) -> str:
    """An error with its unit and a prefix that suits it: 0.00012 m is 0.120 mm."""
    if value is None or not math.isfinite(value):
        return "–"
    size = abs(value)
    for scale, prefix in ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n")):
        if size >= scale * 0.9995:
            return f"{number(value / scale)}\u00a0{prefix}{unit}"
    return f"{number(value)}\u00a0{unit}"


def times(ratio: float) -> str:
    """ "1.2", "35", "2 300": a ratio in two digits."""
    if ratio < 9.95:
        return f"{ratio:.1f}"
    return number(ratio, 2) if ratio >= 1e6 else f"{float(f'{ratio:.2g}'):,.0f}".replace(",", NARROW)


def equation(expression: str) -> str:
    """An expression of a law, its indices lowered, powers raised and Greek letters written.

    Only the look changes: ``F_i = -c (r_i/r_0)^p v_i``.
    """
    text = escaped(expression)
    for name, letter in _GREEK.items():
        text = re.sub(rf"(?<![A-Za-z]){name}(?![a-z])", letter, text)
    text = re.sub(r"_([A-Za-z0-9]+)", r"<sub>\1</sub>", text)
    text = re.sub(r"\^\(([^()]+)\)", r"<sup>\1</sup>", text)
    text = re.sub(r"\^(-?[A-Za-z0-9.]+)", r"<sup>\1</sup>", text)
    text = re.sub(r"(?:(?<=[\s=(])|^)-(?=[\s\[(|A-Za-zα-ω])", "−", text)
    return text
