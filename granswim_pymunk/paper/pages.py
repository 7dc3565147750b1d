"""The pages of the claims and of the readings, in Markdown."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..analysis.resonance import linearised_modes
from . import readings, t1
from .claim import CALIBRATED, FAILS, HOLDS, OPEN, Verdict, number
from .compare import Other, differing, scale_in_words
from .plans import FIRST, LOOSE, Setting
from .results import Results
from .scenes import K_B_FIRST, K_B_PER_LABEL, MU_EFF, paper_scene

MARK = {HOLDS: "**holds**", FAILS: "**does not hold**", OPEN: "not decided", CALIBRATED: "calibrated"}


def page(verdicts: Sequence[Verdict], setting: Setting, out: Path, pages: Path, other: Other | None = None) -> str:
    """The page of all claims, in Markdown; beside those of another run, where one is given."""
    plan = setting.plan
    scaled = "" if setting.k_B_scale == 1.0 else f" --k-b-scale {setting.k_B_scale:.3g}"
    scaled += "" if setting.mu_eff == MU_EFF else f" --mu-eff {setting.mu_eff:g}"
    lines = [
        "# The paper's claims, measured",
        "",
        f"Made by `granswim paper --setting {setting.name}{scaled}`; do not edit. The paper is "
        "Echeverría-Huarte, Telo da Gama & Araújo, *Optimal frequency for undulatory motion in granular media*.",
        "",
        f"Up to {len(setting.seeds)} packings, {plan.duration:g} s each, the first {plan.settle:g} s left out; "
        f"contacts {setting.softness:g} times softer than the paper's. Errors are 95 % (Student t over packings; "
        "differences packing by packing). A statement holds or fails where its interval is on one side; else it is "
        f"not decided. Open points in figures are of two packings or one. {scale_in_words(setting.k_B_scale)}: why, "
        "tells [readings.md](readings.md). Nothing here uses the experiment's curves, which are not available.",
        "",
    ]
    beside = ""
    if other is not None:
        beside = f" with {scale_in_words(other.k_B_scale)} |"
        lines += [
            f"The last column is another run of the command: {other.name} ([page]"
            f"({_link(other.file.with_name('paper.md'), pages)}), [numbers]({_link(other.file, pages)})).", "",
        ]  # fmt: skip
    lines.append("| claim | | verdict | fewest packings | runs missing |" + beside)
    lines.append("|---|---|---|---|---|" + "---|" * bool(beside))
    for v in verdicts:
        name = v.claim.name
        packings = v.packings if v.claim.blocks else "–"
        cells = [f"[{name}](#{name.lower()})", v.claim.title, v.verdict, str(packings), str(v.missing or "–")]
        if other is not None:
            cells.append(other.verdict(name) or "–")
        lines.append("| " + " | ".join(cells) + " |")
    if other is not None:
        lines += ["", *_differences(differing(verdicts, other), setting, other)]
    for v in verdicts:
        lines += ["", f"## {v.claim.name}", "", f"{v.claim.title}, {v.claim.where}: {v.verdict}.", ""]
        if v.figure:
            lines += [f"![{v.claim.name}: {v.claim.title}]({_link(out / v.figure, pages)})", ""]
        lines += ["| the paper says | measured | packings | verdict |", "|---|---|---|---|"]
        for f in v.findings:
            note = f" ({f.note})" if f.note else ""
            cells = [f.says, f.measured + note, str(f.packings or "–"), MARK.get(f.verdict, f.verdict)]
            lines.append("| " + " | ".join(c.replace("|", "\\|") for c in cells) + " |")
        lines += ["", *[f"Failed: {reason}" for reason in v.failed]]
    return "\n".join(lines).rstrip() + "\n"


def _differences(rows: list[tuple[str, str, str, str, str, str]], setting: Setting, other: Other) -> list[str]:
    """The statements on which two runs of the command disagree."""
    if not rows:
        return ["Every statement has the same verdict in both."]
    here, there = f"{setting.name}, {scale_in_words(setting.k_B_scale)}", other.name
    lines = ["Statements with another verdict:", "", f"| | the paper says | {here} | {there} |", "|---|---|---|---|"]
    for name, says, measured, verdict, theirs, their_verdict in rows:
        cells = [
            name, says, f"{MARK.get(verdict, verdict)}: {measured}",
            f"{MARK.get(their_verdict, their_verdict)}: {theirs}",
        ]  # fmt: skip
        lines.append("| " + " | ".join(c.replace("|", "\\|") for c in cells) + " |")
    return lines


def _link(file: Path, pages: Path) -> str:
    return Path(os.path.relpath(file, pages)).as_posix()


def free_speed_section(results: Results) -> list[str]:
    """The free speed, by definition, numerics and reading, beside that of an independent code (k_B as first taken)."""
    frequency = list(readings.INDEPENDENT)
    plan = results.setting.plan

    def cell(mean: float, error: float, n: int) -> str:
        return f"{number(mean, error, '', 1e3)} (n = {n})" if n else "–"

    lines = [
        "", "## The free speed", "",
        "An independent code with the same laws and numbers gave the first line, in one sample of 2.5 s at each "
        f"frequency, with k_B as first taken ({scale_in_words(FIRST['k_B_scale'])}). "
        f"Here runs last {plan.duration:g} s, {plan.settle:g} s of it settling. mm/s, 95 %.", "",
        "| | " + " | ".join(f"{f:g} Hz" for f in frequency) + " |", "|---" * (len(frequency) + 1) + "|",
        "| independent code | " + " | ".join(f"{1e3 * v:.1f}" for v in readings.INDEPENDENT.values()) + " |",
    ]  # fmt: skip
    for what, row in readings.free_speeds(results):
        if any(n for *_, n in row):
            lines.append(f"| {what} | " + " | ".join(cell(*c) for c in row) + " |")
    single = [readings.spread(results, f) for f in frequency]
    cells = [f"{1e3 * s:.1f}" if np.isfinite(s) else "–" for s in single]
    lines.append("| standard deviation over packings, k_B as first taken | " + " | ".join(cells) + " |")
    away = [
        f"{(results.mean('speed', **FIRST, frequency=f)[0] - v) / s:.1f} at {f:g} Hz"
        for (f, v), s in zip(readings.INDEPENDENT.items(), single, strict=True)
        if np.isfinite(s) and s > 0
    ]
    if away:
        lines += [
            "", "With k_B as first taken the swimmer is faster than the independent sample by, in those standard "
            f"deviations: {', '.join(away)}.",
        ]  # fmt: skip
    speeds = {f: results.mean("speed", frequency=f) for f in results.frequencies()}
    behind = [f"{f:g}" for f, (mean, error, _) in speeds.items() if mean + error < 0]
    if behind:
        used = scale_in_words(results.setting.k_B_scale)
        lines += ["", f"With {used} the free swimmer goes tail first at {', '.join(behind)} Hz."]
    d, e, n = results.difference("speed", {"frequency": 9.0}, {**LOOSE, "frequency": 9.0})
    if n > 2 and d > 0:
        less = 0.80 - LOOSE["packing_fraction"]
        gap = results.mean("speed", **FIRST, frequency=9.0)[0] - readings.INDEPENDENT[9.0]
        worth = (
            f", so that the {1e3 * gap:.1f} mm/s by which it is faster than the independent sample with k_B as first "
            f"taken are {gap / d * less:.3f} of packing fraction" if np.isfinite(gap) and gap > 0 else ""
        )  # fmt: skip
        lines += [
            "", f"What the free speed hangs on is the area to spare: {less:.2g} less of the packing fraction makes the "
            f"swimmer slower by {number(d, e, 'mm/s', 1e3)} at 9 Hz (n = {n}){worth}; a longer box "
            "at the same packing fraction has more to spare too (convergence in [paper.md](paper.md#convergence)).",
        ]  # fmt: skip
    return lines


def readings_page(results: Results, figure: str, out: Path, pages: Path, other: Other | None = None) -> str:
    """Which reading of the bending law gives which claim, in Markdown."""
    columns = {name: readings.statements(results, reading) for name, reading in readings.NAMES.items()}
    lines = [
        "# Readings of the bending law",
        "",
        "Made by `granswim paper readings`; do not edit.",
        "",
        "The paper's Eq. 3 can be read in several ways. `leader`: each pair of disks is turned towards the segment "
        "before it. `elastic`: forces of a bending energy, on trimers. `head_axis`: each pair towards the head's axis. "
        "γ_B is printed as 10³ 1/s, but the table of resonances needs 10².",
        "",
        *_scale_of_k_B(results, other, pages),
        "",
    ]
    if figure:
        lines += [f"![speeds and shapes of each reading]({_link(out / figure, pages)})", ""]
    names = list(columns)
    lines += ["| statement | " + " | ".join(names) + " |", "|---" * (len(names) + 1) + "|"]
    for k in range(len(columns[names[0]])):
        cells = []
        for name in names:
            _, measured, verdict, n = columns[name][k]
            cells.append(f"{MARK.get(verdict, verdict)}: {measured} (n = {n})" if n else "no runs")
        says = columns[names[0]][k][0].replace("|", "\\|")
        lines.append(f"| {says} | " + " | ".join(cells) + " |")
    score = {
        name: (sum(v == HOLDS for _, _, v, _ in rows), sum(v == FAILS for _, _, v, _ in rows), len(rows))
        for name, rows in columns.items()
    }
    lines += ["", "| reading | holds | does not hold | not decided |", "|---|---|---|---|"]
    lines += [f"| {name} | {h} | {f} | {n - h - f} |" for name, (h, f, n) in score.items()]
    best = max(h - f for h, f, _ in score.values())
    leaders = [name for name, (h, f, _) in score.items() if h - f == best]
    lines += ["", f"Most statements, refuted ones counted against: {' and '.join(leaders)}."]
    lines[-1] += f" All other claims are judged with the first reading ({names[0]})."
    lines += free_speed_section(results)
    return "\n".join(lines) + "\n"


def _scale_of_k_B(results: Results, other: Other | None, pages: Path) -> list[str]:
    """How the scale of k_B was come by, and the modes that go with it."""
    used, first = results.setting.k_B_scale, FIRST["k_B_scale"]

    def second(**reading: Any) -> float:
        return float(linearised_modes(paper_scene(**{"k_B_scale": used, **reading})).natural[1])

    text = (
        f"The scale of k_B is not given in SI. First {1e5 * K_B_FIRST:.2f} mN per radian was taken for the label 100: "
        "an independent code had its optimum near 9 to 11 Hz with it, in single samples. The default now, "
        f"{1e5 * K_B_PER_LABEL:.2f} mN per radian, is {1 / first:.2f} of that: **one number, fitted to claims** with "
        "`leader`, so that the free swimmer of label 100 is fastest at the table's second resonance, and taken "
        "because more statements of the table below hold with it. So neither F4 for this label nor that table is "
        "evidence for it; the labels 150, 200 and 500 of F4, and what the table does not list, are. The calibrated "
        f"μ_eff goes along (F3a): {MU_EFF:g} s/m in place of 0.16. The other forms have the stiffness of `leader`, not "
        "one fitted to each."
    )
    if other is not None and np.isclose(other.k_B_scale, first):
        scale = other.measured("F4", "the optimum is the second resonance")
        text += (
            f" Every claim with k_B as first taken: [page]({_link(other.file.with_name('paper.md'), pages)}), "
            f"[numbers]({_link(other.file, pages)}), side by side in [paper.md](paper.md); the other "
            f"readings with that stiffness: [page]({_link(other.file.with_name('readings.md'), pages)})"
            + (f"; there F4 has: {scale}." if scale else ".")
        )
    modes = ", ".join(f"`{form}` {second(form=form):.1f}" for form in t1.FORMS)
    here = (
        f"Here: {scale_in_words(used)}. Second modes of the straight swimmer, linearised: {modes} Hz (T1 in "
        "[paper.md](paper.md#t1)), not the table's 9.1 Hz; "
        f"`leader` comes to {second(k_B_scale=0.25):.1f} Hz with 0.25 of the default."
    )
    return [text, "", here]
