"""Quantities as a person writes them: ``5mm``, ``10 g``, ``0.1mm/px``, ``1/30 s``, ``deg``."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from decimal import Decimal

from ...errors import InputError

LENGTHS = {
    "m": 1.0, "dm": 0.1, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "μm": 1e-6, "nm": 1e-9, "km": 1e3,
    "in": 0.0254, "inch": 0.0254, "ft": 0.3048,
    "metre": 1.0, "meter": 1.0, "metres": 1.0, "meters": 1.0, "micron": 1e-6, "microns": 1e-6,
    "centimeter": 1e-2, "centimetre": 1e-2, "millimeter": 1e-3, "millimetre": 1e-3,
    "centimeters": 1e-2, "centimetres": 1e-2, "millimeters": 1e-3, "millimetres": 1e-3, "zentimeter": 1e-2,
    "metro": 1.0, "metros": 1.0, "metri": 1.0, "mètre": 1.0, "mètres": 1.0, "centimetros": 1e-2, "centímetros": 1e-2,
    "centimetri": 1e-2, "centimètres": 1e-2, "milimetros": 1e-3, "milímetros": 1e-3, "millimetri": 1e-3,
    "millimètres": 1e-3,
}  # fmt: skip
TIMES = {
    "s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0,
    "sec": 1.0, "second": 1.0, "seconds": 1.0, "msec": 1e-3, "millisecond": 1e-3, "milliseconds": 1e-3,
    "sekunden": 1.0, "secondes": 1.0, "segundos": 1.0,
}  # fmt: skip
ANGLES = {
    "rad": 1.0, "deg": math.pi / 180, "rev": 2 * math.pi, "°": math.pi / 180,
    "degree": math.pi / 180, "degrees": math.pi / 180, "radian": 1.0, "radians": 1.0,
    # with a capital only: a grad of 1/400 turn is another unit
    "Grad": math.pi / 180, "graus": math.pi / 180, "grados": math.pi / 180, "gradi": math.pi / 180,
    "degrés": math.pi / 180,
}  # fmt: skip
MASSES = {"kg": 1.0, "g": 1e-3, "mg": 1e-6, "ug": 1e-9, "µg": 1e-9, "t": 1e3, "oz": 0.028349523125, "lb": 0.45359237}
PIXELS = ("px", "pixel", "pixels", "pix", "píxeles", "pixeles")
SHOWN = {"unit": "m, cm, mm, um, in, ft", "time unit": "s, ms, us, min", "angle unit": "rad, deg, rev"}

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?:/\d+\.?\d*)?"
_QUANTITY = re.compile(rf"\s*({_NUMBER})?\s*([^\d\s/.+-]*)\s*(?:/\s*(\w+))?\s*")


def quantity(text: str | float, units: Mapping[str, float], *, per: tuple[str, ...] = ()) -> float | None:
    """SI value of ``5mm``, ``mm`` (one of them), ``0.005`` (SI already) or ``0.1mm/px``; None where it is none.

    per : what a unit may be divided by without a change (pixels, frames)
    """
    if isinstance(text, int | float) and not isinstance(text, bool):
        return float(text)
    match = _QUANTITY.fullmatch(str(text))
    if match is None or (match[1] is None and not match[2]):
        return None
    number, unit, divisor = match.groups()
    if divisor is not None and divisor.lower() not in per:
        return None
    above, _, below = (number or "1").partition("/")
    if below and float(below) == 0.0:
        return None
    if not unit or unit.lower() in per:
        return None if number is None else float(above) / float(below or 1)
    size = units.get(unit, units.get(unit.lower()))
    # in decimals: 179.3 g are 0.1793 kg and not 0.17930000000000001
    return None if size is None else float(Decimal(above) * Decimal(repr(size))) / float(below or 1)


def factor(text: str | float, units: Mapping[str, float], what: str) -> float:
    """SI per unit: ``mm``, ``0.5 mm``, ``0.1mm/px`` or a number (metres per pixel, seconds per tick)."""
    value = quantity(text, units, per=(*PIXELS, "frame", "frames", "step", "tick", "count", "unit"))
    if value is None or not (math.isfinite(value) and value > 0):
        raise InputError(
            f"should be one of {SHOWN.get(what, ', '.join(units))}, a number above zero, or both (0.1mm/px), "
            f"got {text!r}",
            where=what,
        )
    return value


def measure(text: str, units: Mapping[str, float], what: str, where: str) -> float:
    """SI value of a radius or a mass: ``5mm``, ``10g``, or a number in SI. Raises InputError."""
    value = quantity(text, units)
    if value is None or not math.isfinite(value):
        raise InputError(f"{what} should be numbers, as 5mm, 10g or in SI, got {text!r}", where=where)
    return value


# the sensor of a heading of PASCO: "Angle, Ch 1+2 (rad) Run #1", "Voltage, ChA"
SENSOR = re.compile(r",\s*ch\s*([a-z]|\d+(?:\s*[+&]\s*\d+)?)(?![^\W_])", re.IGNORECASE)
# what Logger Pro, Graphical Analysis and Capstone put around a heading
_AROUND = re.compile(
    r"^\s*(?:latest|run\s*#?\s*\d+|data\s*set(?:\s*\d+)?|video\s*analysis(?:\s*\d+)?)\s*:\s*"
    rf"|,?\s*run\s*#?\s*\d+\s*(?=\(|$)|{SENSOR.pattern}",
    re.IGNORECASE,
)


def split_unit(name: str) -> tuple[str, str | None]:
    """``x (mm)``, ``x [mm]``, ``x/mm``, ``x_mm``, ``x in mm`` as the name and its unit; None where no unit is said."""
    name = _AROUND.sub("", name)
    match = re.fullmatch(r"\s*(.*?)\s*(?:\(([^()]+)\)|\[([^\[\]]+)\])\s*", name)
    if match and match[1]:
        return match[1], (match[2] or match[3]).strip()
    match = re.fullmatch(r"\s*(.+?)(?: in |[_/ ])([^_/ ]+)\s*", name)
    if match and is_unit(match[2]):
        return match[1], match[2]
    return name.strip(), None


def is_unit(text: str) -> bool:
    return text in LENGTHS or text in TIMES or text in ANGLES or text.lower() in PIXELS
