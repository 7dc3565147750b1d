"""What a diagnosis came to, whatever was recorded: one frozen result with numbers only, and the verdict's fields."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from ..files import written_whole
from ..recording import Recording
from ..scene import Scene, Time
from .criteria import Criteria, current
from .hypothesis import NO_CAMERA
from .mechanisms import CLAIMED

Progress = Callable[[str, float], None]
FORMAT = "granswim-verdict/2"
VERDICTS = ("no_mismatch", "recalibrate", "missing_physics", "unmodelled", "measurement")
MODELS = ("naive", "recalibrated", "revised", "noise_floor")
TOLD = ("missing_physics", "measurement", "unmodelled")  # verdicts that say that something is missing or off
NOT_TRIED = "not tried, the time was up: "  # how a note begins that names candidates which the time did not suffice for
PAIRS = "pairs of laws"
TRAINING, PARTLY, HELD_OUT = "training", "part held out", "held out"


@dataclass(frozen=True)
class Table:
    """A table of the report: plain text in its cells; ``numeric``: columns set to the right."""

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    numeric: Sequence[int] = ()
    note: str = ""


@dataclass(frozen=True)
class Used:
    """How one recording was used.

    part : "training", "held out", or "part held out" (of tracks the last of their time)
    frames : how many;  length [s];  dt [s] of its runs
    noise : size of the camera's noise [m] or [rad], with its unit, one entry for each size;  estimated : not given
    identity : of the scene, SHA-256
    """

    name: str
    part: str
    frames: int
    length: float
    identity: str
    noise: tuple[tuple[float, str], ...] = ()
    estimated: bool = False
    dt: float | None = None

    @classmethod
    def of(cls, recording: Recording, part: str, dt: float | None = None) -> Used:
        """Of a recording whose noise is as stated."""
        stated = ((recording.position_noise, "m"), (recording.angle_noise, "rad"))
        return cls(
            recording.name, part, len(recording.t), float(np.ptp(recording.t)) if len(recording.t) else 0.0,
            recording.scene.identity, tuple((size, unit) for size, unit in stated if size is not None), dt=dt,
        )  # fmt: skip


@dataclass(frozen=True)
class Diagnosis:
    """Everything that was found, ready to be told and written: numbers only, whatever kind of recording.

    kind : how recordings were compared: "bodies", "bed", "unseen", or "together" for several of these
    verdict : the content of verdict.json, see ``check_verdict``, in plain numbers
    revised : for each recording the scene with what was found, and the camera in it; it runs as it is
    evidence : what figures are drawn from, each kind its own numbers;  tables : further tables of the report
    used : how each recording was used;  believed : adjustable to (value, low, high) before anything was fitted
    places_in : for each entry of ``mismatch`` the recording it is in, empty where that is not said
    right_law : smallest and largest held-out error where the law is right and its numbers come from frames as noisy
    widened : by how many times intervals are wider, because what is left is larger than the noise or remembers
    instead : numbers of the scene, in words, that nobody declared adjustable and that would do as well
    runs : simulations;  seconds : the time it took;  seed : of the nulls
    criteria : what decided
    """

    kind: str
    verdict: Mapping[str, Any]
    revised: Mapping[str, Scene] = field(default_factory=dict)
    evidence: Any = None
    tables: tuple[Table, ...] = ()
    used: tuple[Used, ...] = ()
    believed: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    places_in: tuple[str, ...] = ()
    right_law: tuple[float, float] | None = None
    widened: float = 1.0
    instead: tuple[str, ...] = ()
    seconds: float = 0.0
    runs: int = 0
    seed: int = 0
    criteria: Criteria = field(default_factory=current)

    def __post_init__(self) -> None:
        plain = plain_numbers(self.verdict)
        plain["notes"] = list(dict.fromkeys(plain.get("notes") or ()))
        object.__setattr__(self, "verdict", plain)

    @property
    def training(self) -> list[str]:
        """Names of the recordings that were learnt from."""
        return [u.name for u in self.used if u.part != HELD_OUT]

    @property
    def held_out(self) -> list[str]:
        """Names of the recordings that were held out as a whole."""
        return [u.name for u in self.used if u.part == HELD_OUT]


# ---- the fields of the verdict ---------------------------------------------------------------


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


def rival_entries(
    withdrawn: Sequence[tuple[str, float | None]],
    near: Sequence[tuple[str, float | None, float]],
    others: Sequence[tuple[str, float | None, bool]],
) -> list[dict[str, Any]]:
    """``rivals``: what was named and did not stand comes first, then what does worse or as well.

    withdrawn : name and gain;  near : name, gain and share of what was not accepted
    others : name, gain and whether these data cannot tell it from what was named; each name is told once, as it
        comes first
    """
    entries: list[dict[str, Any]] = [
        {"name": name, "gain_heldout": gain, "indistinguishable": False, "withdrawn": True} for name, gain in withdrawn
    ]
    entries += [
        {"name": name, "gain_heldout": gain, "indistinguishable": False, "share": share} for name, gain, share in near
    ]
    entries += [{"name": name, "gain_heldout": gain, "indistinguishable": same} for name, gain, same in others]
    once: dict[str, dict[str, Any]] = {}
    for entry in entries:
        once.setdefault(entry["name"], entry)
    return list(once.values())


def check_verdict(verdict: Mapping[str, Any]) -> None:
    """Raise ValueError where a verdict is not of the contract's form: a fault of the diagnosis, not of its user."""
    wanted = empty_verdict("no_mismatch")
    lacking = [key for key in wanted if key not in verdict]
    if lacking:
        raise ValueError(f"a verdict needs {', '.join(lacking)}")
    if verdict["verdict"] not in VERDICTS:
        raise ValueError(f"a verdict is one of {', '.join(VERDICTS)}, not {verdict['verdict']!r}")
    if verdict["verdict"] in CLAIMED and not verdict["mechanisms"]:
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


def not_tried(verdict: Mapping[str, Any]) -> list[str]:
    """Candidates that the time did not suffice for, as the notes name them: where nothing else stands, all is open."""
    told = [note.removeprefix(NOT_TRIED) for note in verdict["notes"] if note.startswith(NOT_TRIED)]
    return list(dict.fromkeys(name for text in told for name in text.split(", ")))


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


# ---- files -----------------------------------------------------------------------------------


def handed_over(scene: Scene, camera: Mapping[str, Any], recording: Recording, **time: float) -> Scene:
    """The scene of a recording with what was found in it, as it is given to the user; ``time``: see ``Time``.

    Of the ``camera`` it says what was found wanting; nothing in it is adjustable any more.
    """
    wanting = {k: list(v) if isinstance(v, tuple) else v for k, v in camera.items() if v != NO_CAMERA[k]}
    return replace(
        scene, adjustable=(), camera=wanting, title=f"{recording.title or recording.name}, revised",
        time=Time(**time, scheme=scene.time.scheme),
    )  # fmt: skip


def put_text(path: Path, text: str) -> None:
    """Write a file that appears whole or not at all, and its folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with written_whole(path) as stream:
        stream.write(text.encode("utf-8"))


def write_verdict(found: Diagnosis, out: Path) -> None:
    """Write verdict.json, revised.toml and, with several recordings, revised/NAME.toml.

    Raises ValueError where the verdict is not of the contract's form, OSError where it cannot be written.
    """
    check_verdict(found.verdict)
    for k, (name, scene) in enumerate(found.revised.items()):
        text = tomli_w.dumps(scene.to_dict())
        if k == 0:
            put_text(out / "revised.toml", text)
        if len(found.revised) > 1:
            put_text(out / "revised" / f"{name}.toml", text)
    put_text(out / "verdict.json", json.dumps(found.verdict, indent=1, allow_nan=False) + "\n")
