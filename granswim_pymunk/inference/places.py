"""Where a recording and its simulation differ: one statement for every kind of recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

Span = tuple[float, float] | None


@dataclass(frozen=True)
class Place:
    """Somewhere that the mismatch is: an entry of ``mismatch``.

    bodies : ids;  p : that the largest of all places looked at is as large by chance;  z : its normal score, see
        ``after_looks``
    region : in words;  x, y, gap [m];  t [s];  phase : share of the drive's cycle;  before_contact : whether it shows
        before bodies touch;  speed [m/s];  frequency [Hz] of the drive: each None where it does not apply
    recording : that it is in, empty where that is not said
    """

    bodies: Sequence[str]
    z: float
    p: float
    region: str | None = None
    x: Span = None
    y: Span = None
    gap: Span = None
    t: Span = None
    phase: Span = None
    before_contact: bool | None = None
    speed: Span = None
    frequency: Span = None
    recording: str = ""

    def as_dict(self) -> dict[str, Any]:
        """As it stands in verdict.json."""

        def span(pair: Span) -> list[float] | None:
            return None if pair is None else [float(pair[0]), float(pair[1])]

        return {
            "bodies": list(self.bodies),
            "where": {"region": self.region, "x": span(self.x), "y": span(self.y), "gap": span(self.gap)},
            "when": {"t": span(self.t), "phase": span(self.phase), "before_contact": self.before_contact},
            "speed": span(self.speed), "frequency": span(self.frequency), "z": float(self.z), "p": float(self.p),
        }  # fmt: skip
