"""The claims judged here beside those of another run of the command, by its claims.json."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import InputError
from .claim import Verdict
from .scenes import bending_stiffness

FORMAT = "granswim-paper/1"


@dataclass(frozen=True)
class Other:
    """What another run of the command found: its claims.json, and where it lies."""

    file: Path
    record: dict[str, Any]

    @property
    def k_B_scale(self) -> float:
        return float(self.record.get("k_B_scale", 1.0))

    @property
    def name(self) -> str:
        return f"{self.record['setting']}, {scale_in_words(self.k_B_scale)}"

    def verdict(self, claim: str) -> str:
        """Of a claim as a whole; empty where it was not judged there."""
        return next((str(c["verdict"]) for c in self.record["claims"] if c["claim"] == claim), "")

    def measured(self, claim: str, says: str) -> str:
        """What was measured there for the first statement that begins so; empty where there is none."""
        found = (f for c in self.record["claims"] if c["claim"] == claim for f in c["findings"])
        return next((str(f["measured"]) for f in found if f["says"].startswith(says)), "")


def scale_in_words(k_B_scale: float) -> str:
    """``k_B 1.36 mN per radian for label 100``."""
    return f"k_B {1e3 * bending_stiffness(100.0, k_B_scale):.2f} mN per radian for label 100"


def read_other(file: str | Path) -> Other:
    """A claims.json that ``granswim paper`` wrote. Raises InputError."""
    file = Path(file)
    try:
        record = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"cannot read it: {error.strerror}", file=file) from None
    except ValueError:
        raise InputError("is no JSON", file=file) from None
    if not isinstance(record, dict) or record.get("format") != FORMAT:
        raise InputError(f"should be a claims.json of this command, format {FORMAT}", file=file)
    return Other(file, record)


def differing(verdicts: Sequence[Verdict], other: Other) -> list[tuple[str, str, str, str, str, str]]:
    """(claim, statement, measured here, verdict here, measured there, verdict there) where verdicts differ.

    The k-th statement with the same words in a claim is taken for the same; one that only one of them has, or has
    runs for, is left out.
    """
    theirs: dict[tuple[str, str, int], dict[str, Any]] = {}
    for claim in other.record["claims"]:
        theirs |= {
            (claim["claim"], said, k): finding
            for said, k, finding in _counted([(f["says"], f) for f in claim["findings"]])
        }
    rows = []
    for v in verdicts:
        for said, k, f in _counted([(f.says, f) for f in v.findings]):
            there = theirs.get((v.claim.name, said, k))
            # where only one of them has runs there is nothing to compare
            if there is None or bool(there["packings"]) != bool(f.packings):
                continue
            if there["verdict"] != f.verdict:
                rows.append((v.claim.name, said, f.measured, f.verdict, there["measured"], there["verdict"]))
    return rows


def _counted(said: Sequence[tuple[str, Any]]) -> Iterator[tuple[str, int, Any]]:
    seen: dict[str, int] = {}
    for text, finding in said:
        seen[text] = seen.get(text, -1) + 1
        yield text, seen[text], finding
