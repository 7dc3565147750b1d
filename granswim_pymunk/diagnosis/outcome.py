"""What a diagnosis hands over to be written: verdict, revised scenes, and the parts of its report.

Diagnoses of beds end in it, whichever way they compare: by windows, by statistics over packings, by curves.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import tomli_w
from matplotlib.figure import Figure

from ..scene import Scene
from .driver import Diagnosis
from .verdict import verdict_dict, write_text

FORMAT = "granswim-verdict/2"
VERDICTS = ("no_mismatch", "recalibrate", "missing_physics", "unmodelled", "measurement")
MODELS = ("naive", "recalibrated", "revised", "noise_floor")


@dataclass(frozen=True)
class Table:
    """A table of the report: plain text in its cells; ``numeric``: columns set to the right."""

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    numeric: Sequence[int] = ()
    note: str = ""


@dataclass
class Outcome:
    """Everything that was found, ready to be written.

    verdict : the content of verdict.json, see ``check_verdict``;  revised : for each recording the scene that
    runs as it is and the camera found wanting (empty where it was not);  headline : one plain sentence;
    answers : (question, answer) pairs of the first screen, plain text;
    figures : name to (figure, caption), in the order of the page;  seconds : the time it took
    """

    verdict: dict[str, Any]
    revised: dict[str, tuple[Scene, Mapping[str, Any]]]
    headline: str
    answers: list[tuple[str, str]]
    figures: dict[str, tuple[Figure, str]] = field(default_factory=dict)
    tables: list[Table] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    training: list[str] = field(default_factory=list)
    held_out: list[str] = field(default_factory=list)
    seconds: float = 0.0
    runs: int = 0
    seed: int = 0


def empty_verdict(verdict: str, unit: str | None = "m rms") -> dict[str, Any]:
    """A verdict in which nothing was found yet: every field of the contract is there."""
    nothing = dict.fromkeys(MODELS)
    return {
        "format": FORMAT, "verdict": verdict, "mismatch": [], "mechanisms": [], "rivals": [],
        "heldout": None, "explained": None, "complete": verdict in ("no_mismatch", "recalibrate"), "remains": None,
        "fit": {"train": dict(nothing), "heldout": dict(nothing), "unit": unit, "window": None},
        "null": None, "next_experiment": None, "recalibrated": {}, "notes": [],
    }  # fmt: skip


def mechanism_entry(
    name: str,
    expression: str,
    bodies: Sequence[str],
    parameters: Mapping[str, tuple[Any, Any, Any, str]],
    surviving: float | None,
    gain: float | None,
) -> dict[str, Any]:
    """One entry of ``mechanisms``; ``parameters``: name to (value, low, high, unit), bounds None for a choice."""
    return {
        "name": name, "expression": expression, "bodies": list(bodies),
        "parameters": {
            key: {"value": value, "low": low, "high": high, "unit": unit}
            for key, (value, low, high, unit) in parameters.items()
        },
        "surviving_fraction": surviving, "gain_heldout": gain,
    }  # fmt: skip


def mismatch_entry(
    bodies: Sequence[str],
    z: float,
    p: float,
    *,
    region: str | None = None,
    x: Sequence[float] | None = None,
    y: Sequence[float] | None = None,
    gap: Sequence[float] | None = None,
    t: Sequence[float] | None = None,
    phase: Sequence[float] | None = None,
    before_contact: bool | None = None,
    speed: Sequence[float] | None = None,
    frequency: Sequence[float] | None = None,
) -> dict[str, Any]:
    """One entry of ``mismatch``; spans are [low, high], None where the field does not apply."""

    def span(pair: Sequence[float] | None) -> list[float] | None:
        return None if pair is None else [float(pair[0]), float(pair[1])]

    return {
        "bodies": list(bodies), "where": {"region": region, "x": span(x), "y": span(y), "gap": span(gap)},
        "when": {"t": span(t), "phase": span(phase), "before_contact": before_contact},
        "speed": span(speed), "frequency": span(frequency), "z": float(z), "p": float(p),
    }  # fmt: skip


def check_verdict(verdict: Mapping[str, Any]) -> None:
    """Raise ValueError where a verdict is not of the contract's form: a fault of the diagnosis, not of its user."""
    wanted = empty_verdict("no_mismatch")
    lacking = [key for key in wanted if key not in verdict]
    if lacking:
        raise ValueError(f"a verdict needs {', '.join(lacking)}")
    if verdict["verdict"] not in VERDICTS:
        raise ValueError(f"a verdict is one of {', '.join(VERDICTS)}, not {verdict['verdict']!r}")
    if verdict["verdict"] in ("missing_physics", "measurement") and not verdict["mechanisms"]:
        raise ValueError(f"{verdict['verdict']} needs an entry in mechanisms")
    for part in ("train", "heldout"):
        if set(verdict["fit"][part]) < set(MODELS):
            raise ValueError(f"fit.{part} needs {', '.join(MODELS)}")
    for entry in verdict["mechanisms"]:
        for name, parameter in entry["parameters"].items():
            if set(parameter) != {"value", "low", "high", "unit"}:
                raise ValueError(f"parameter {name} needs value, low, high and unit")
    for entry in verdict["mismatch"]:
        if not entry["bodies"] and not entry["where"].get("region"):
            raise ValueError("a mismatch needs the bodies, or the region, where it is")


def plain_numbers(value: Any) -> Any:
    """The same with plain Python numbers; what is not finite is None, which JSON can say."""
    if isinstance(value, Mapping):
        return {str(k): plain_numbers(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain_numbers(v) for v in value]
    if hasattr(value, "tolist"):
        return plain_numbers(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value


def verdict_of(found: Diagnosis | Outcome) -> dict[str, Any]:
    """The content of verdict.json."""
    if isinstance(found, Outcome):
        verdict = plain_numbers(found.verdict)
        verdict["notes"] = list(dict.fromkeys([*verdict.get("notes", []), *found.notes]))
        check_verdict(verdict)
        return verdict
    return verdict_dict(found)


def write_outcome(outcome: Outcome, out: Path) -> None:
    """Write verdict.json, revised.toml (with several recordings revised/NAME.toml too), report.html, figures/*.png.

    Every file appears whole or not at all. Raises InputError where ``out`` cannot be written to.
    """
    from ..report.outcome_page import write_outcome_report

    verdict = verdict_of(outcome)
    out.mkdir(parents=True, exist_ok=True)
    scenes = {}
    for name, (scene, camera) in outcome.revised.items():
        shown = {k: list(v) if isinstance(v, tuple) else v for k, v in camera.items()}
        scenes[name] = replace(scene, adjustable=(), camera=shown)
    if scenes:
        write_text(out / "revised.toml", tomli_w.dumps(next(iter(scenes.values())).to_dict()))
    if len(scenes) > 1:
        for name, scene in scenes.items():
            write_text(out / "revised" / f"{name}.toml", tomli_w.dumps(scene.to_dict()))
    write_outcome_report(outcome, verdict, out)
    write_text(out / "verdict.json", json.dumps(verdict, indent=1, allow_nan=False) + "\n")
