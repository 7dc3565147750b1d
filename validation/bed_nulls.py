"""``python -m granswim_pymunk.validation.bed_nulls --out DIR``: how often physics is named where none is missing.

Beds of their own numbers, packings and noise, full ones as in ``bed_effects`` and small ones (some 350 grains, 0.4 s),
simulated by the proof's own code without any effect, filmed, and diagnosed in another process. Of every bed the
adjustable numbers are believed 2 to 6 % off. One folder a bed; finished ones are not run again while the
package's code is the same.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from granswim_pymunk.proof.beds import draw_bed
from granswim_pymunk.validation.bed_effects import Row, code, diagnosed, film_in, keep, recorded, tell

FULL, SMALL = 12, 48
FIRST = 8000  # of the seeds


def make(seed: int, small: bool, folder: Path) -> None:
    """Write the recording of a bed in which nothing is missing."""
    row = Row("nothing", {}, "no_mismatch")
    setup = draw_bed(np.random.default_rng((seed, int(small))), "bed", small)
    recorded(row, setup if small else film_in(setup), seed, folder)


TITLE = "False alarms in beds"
ABOUT = (
    "In none of these beds is anything missing; what is adjustable is believed 2 to 6 % off. A false alarm is a",
    "named law; a false clock or scale is counted apart. p is that of the search, its uniform spread is tested by",
    "Kolmogorov and Smirnov.",
)


def page(
    results: Mapping[str, Mapping[str, Any]], title: str = TITLE, module: str = "bed_nulls",
    about: Sequence[str] = ABOUT, tested: Collection[str] | None = None,
) -> str:  # fmt: skip
    """``tested``: of which results the spread of p is told, None: of all."""
    lines = [
        f"# {title}",
        "",
        f"Made by `python -m granswim_pymunk.validation.{module} --out DIR --page FILE`; do not edit.",
        "",
        *about,
        "",
        "| beds | diagnosed | laws named | clock or scale | `recalibrate` | `unmodelled` | p below 0.05 | p uniform? |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for label, key in (("full", "full"), ("small", "small"), ("all", "")):
        mine = {name: r["verdict"] for name, r in results.items() if name.startswith(key) and "verdict" in r}
        p = [_p(v) for name, v in mine.items() if tested is None or name in tested]
        if mine:
            lines.append(_line(label, list(mine.values()), np.array(p)))
    wrong = [
        f"- {name}: {', '.join(m['name'] for m in r['verdict']['mechanisms'])} (p = {_p(r['verdict']):.3f})"
        for name, r in results.items()
        if "verdict" in r and r["verdict"]["mechanisms"]
    ]
    lines += ["", "What was named:", "", *wrong] if wrong else ["", "Nothing was named."]
    failed = [name for name, r in results.items() if "verdict" not in r]
    if failed:
        lines += ["", f"Failed: {', '.join(failed)}."]
    seconds = {key: [r["seconds"] for n, r in results.items() if n.startswith(key) and "verdict" in r]
               for key in ("full", "small")}  # fmt: skip
    told = [f"{key} {np.median(s):.0f} s, at most {max(s):.0f} s" for key, s in seconds.items() if s]
    lines += ["", f"Time of a diagnosis, in the median: {'; '.join(told)}.", ""]
    return "\n".join(lines)


def _p(verdict: Mapping[str, Any]) -> float:
    return float(verdict["null"]["p_false_alarm"])


def _line(label: str, verdicts: Sequence[Mapping[str, Any]], p: np.ndarray) -> str:
    said = [v["verdict"] for v in verdicts]
    count = len(said)
    alarms = said.count("missing_physics")
    high = float(stats.beta.ppf(0.975, alarms + 1, count - alarms)) if alarms < count else 1.0
    low = float(stats.beta.ppf(0.025, alarms, count - alarms + 1)) if alarms else 0.0
    uniform = f"p = {stats.kstest(p, 'uniform').pvalue:.2g}" if len(p) > 4 else "–"
    low_p = f"{int(np.sum(p < 0.05))}" + (f" of {len(p)}" if len(p) < count else "")
    return (
        f"| {label} | {count} | {alarms} ({100 * low:.0f} to {100 * high:.0f} %) | {said.count('measurement')} | "
        f"{said.count('recalibrate')} | {said.count('unmodelled')} | {low_p} | {uniform} |"
    )


def main(argv: list[str] | None = None, say: Callable[[str], None] = print) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", required=True, metavar="DIR")
    parser.add_argument("--full", type=int, default=FULL, metavar="N")
    parser.add_argument("--small", type=int, default=SMALL, metavar="N")
    parser.add_argument("--first", type=int, default=0, metavar="K", help="begin with the K-th of each")
    parser.add_argument("--step", type=int, default=1, metavar="K", help="every K-th of each, to share the work")
    parser.add_argument("--page", metavar="FILE", help="write the table here")
    parser.add_argument("--minutes", type=float, default=10.0)
    args = parser.parse_args(argv)
    out = Path(args.out)
    stamp = code()
    wanted = [(f"{kind}-{k:02d}", kind == "small", k) for kind, count in (("full", args.full), ("small", args.small))
              for k in range(args.first, count, args.step)]  # fmt: skip
    for name, small, k in wanted:
        file = out / "results" / f"{name}.json"
        if file.exists() and json.loads(file.read_text()).get("code") == stamp:
            continue
        recording = out / "recordings" / name
        if not (recording / "recording.toml").exists():
            make(FIRST + k, small, recording)
        result = diagnosed([recording], out / "reports" / name, args.minutes)
        keep(file, result)
        v = result.get("verdict")
        say(f"{name}: {v['verdict']}, p = {_p(v):.3f}, {result['seconds']} s" if v else f"{name}: {result['failed']}")
    stored = {f.stem: json.loads(f.read_text()) for f in sorted((out / "results").glob("*.json"))}
    results = {name: result for name, result in stored.items() if result.get("code") == stamp}
    return tell(page(results), args.page, say)


if __name__ == "__main__":
    sys.exit(main())
