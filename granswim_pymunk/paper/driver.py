"""The claims, run, judged, drawn and written down."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..analysis.resonance import linearised_modes
from ..errors import InputError
from ..recording.folder import read_curve
from ..report.style import STYLE
from ..sweep import read_dataset, write_dataset
from . import checks, f2, f3, f4, f5, f6, f7, f8, f9, f10, readings, t1
from .calibrate import Calibration, calibrate
from .claim import CALIBRATED, FAILS, HOLDS, OPEN, Claim, Verdict, number
from .compare import FORMAT, Other, differing, read_other, scale_in_words
from .plans import FIRST, LOOSE, SETTINGS, Setting, points_of
from .results import Results, jobs_of, keep, kept_rows, labelled, load, mean_maps, run_points
from .scenes import MU_EFF, paper_scene

CLAIMS: dict[str, Claim] = {
    c.name: c
    for c in (
        t1.CLAIM, f2.CLAIM, f3.CLAIM_A, f3.CLAIM_B, f4.CLAIM, f5.CLAIM, f6.CLAIM, f7.CLAIM, f8.CLAIM, f9.CLAIM,
        f10.CLAIM, readings.READING, readings.CONVERGED, checks.CLAIM,
    )
}  # fmt: skip
Say = Callable[[str], None]


def choose(names: Sequence[str]) -> list[Claim]:
    """Claims by name, in the paper's order; F3 is F3a and F3b; none: all. Raises InputError."""
    if not names:
        return list(CLAIMS.values())
    wanted = set()
    for name in names:
        found = [c for c in CLAIMS if c.lower() == name.lower() or (name.upper() == "F3" and c.startswith("F3"))]
        if not found:
            raise InputError(f"unknown claim {name!r}; known: {', '.join(CLAIMS)}")
        wanted |= set(found)
    return [c for c in CLAIMS.values() if c.name in wanted]


def paper(
    claims: Sequence[str] = (),
    *,
    setting: str | Setting = "pocket",
    out: str | Path = "out/paper",
    runs: str | Path | None = None,
    pages: str | Path | None = None,
    json_file: str | Path | None = None,
    curve: str | Path | None = None,
    k_B_scale: float = 1.0,
    mu_eff: float = MU_EFF,
    compare: str | Path | None = None,
    run: bool = True,
    say: Say = print,
    **how: Any,
) -> list[Verdict]:
    """Compute what the claims need, judge and draw them.

    claims : names (default: all);  setting : "pocket", "paper" or a Setting
    out : figures, sweep.nc (labelled arrays), runs.nc (every run's numbers), maps.nc (mean fields)
    runs : run files (default: OUT/runs); what runs.nc has is not run again
    pages : where paper.md and readings.md go (default: OUT);  json_file : verdicts with every number
    curve : a curve.csv to which mu_eff is calibrated besides;  run : False takes only what is finished
    k_B_scale : times the default's k_B in all runs;  mu_eff : the calibrated one [s/m], which goes with k_B
    compare : claims.json of another run, to stand beside this one
    how : executor, processes, dask, retry_failed, quiet, as ``sweep.run_jobs``

    Raises InputError before anything is run.
    """
    chosen = choose(claims)
    if isinstance(setting, str):
        if setting not in SETTINGS:
            raise InputError(f"setting should be one of {', '.join(SETTINGS)}, got {setting!r}")
        setting = SETTINGS[setting]
    if not (np.isfinite(k_B_scale) and k_B_scale > 0):
        raise InputError(f"should be above zero, got {k_B_scale!r}", where="k_B scale")
    if k_B_scale != 1.0:
        # the scale that was taken first is known by three digits
        first = FIRST["k_B_scale"]
        scale = first if f"{first:.3g}" == f"{k_B_scale:g}" else k_B_scale
        setting = replace(setting, usual={**setting.usual, "k_B_scale": scale})
    if not (np.isfinite(mu_eff) and mu_eff > 0):
        raise InputError(f"should be above zero, got {mu_eff!r}", where="mu_eff")
    if mu_eff != MU_EFF:
        setting = replace(setting, usual={**setting.usual, "mu_eff": mu_eff})
    other = read_other(compare) if compare is not None else None
    measured = read_curve(Path(curve)) if curve is not None else None
    out = Path(out)
    folder = Path(runs) if runs is not None else out / "runs"
    pages = Path(pages) if pages is not None else out
    if json_file is not None and not Path(json_file).resolve().parent.is_dir():
        raise InputError("its folder does not exist", file=json_file)
    for place in (out, pages):
        try:
            place.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"cannot make this folder: {error.strerror}", file=place) from None

    everything = jobs_of(points_of(setting), setting, folder)
    wanted = {b for claim in chosen for b in claim.blocks}
    names = {tuple(p.values()) for p in points_of(setting, sorted(wanted))} if wanted else set()
    jobs = [job for job in everything if tuple(job.point.values()) in names]
    kept = kept_rows(out / "runs.nc")
    missing = [job for job in jobs if not job.done and job.key not in kept]
    if jobs:
        say(f"{setting.name}: {len(jobs)} runs of {setting.plan.duration:g} s, {len(jobs) - len(missing)} finished")
    again = how.get("retry_failed", False)
    if run and (missing or again):
        run_points([j for j in jobs if again or j in missing], setting, **how)
    # what other claims have left there comes along
    results = load(everything, setting, folder, kept)
    if (out / "maps.nc").exists():
        results.maps = read_dataset(out / "maps.nc")
    calibrated = None
    if measured is not None:
        calibrated = calibrate(measured, setting, folder, **how)
        say(
            f"mu_eff for {curve}: {calibrated.text}, rms misfit {1e3 * calibrated.rms:.2f} mm/s, "
            f"{calibrated.packings} packings"
        )
    verdicts = [_judge(claim, results, out) for claim in chosen]
    for verdict in verdicts:
        say(in_words(verdict))
    if results.runs:
        keep(results, everything, out / "runs.nc")
        write_dataset(labelled(results), out / "sweep.nc")
        maps = mean_maps(results, [name for name, *_ in f8.ROWS], f8.THREE) if f8.CLAIM in chosen else None
        if maps is not None:
            write_dataset(maps, out / "maps.nc")
    record = {
        "format": FORMAT, "version": __version__, "setting": setting.name, "packings": len(setting.seeds),
        "k_B_scale": setting.k_B_scale, "mu_eff_s_per_m": setting.mu_eff,
        "duration_s": setting.plan.duration, "settle_s": setting.plan.settle, "softness": setting.softness,
        "claims": [v.to_dict() for v in verdicts],
    }  # fmt: skip
    if calibrated is not None:
        record["calibration"] = _calibration(calibrated, str(curve))
    text = json.dumps(record, indent=1, ensure_ascii=False) + "\n"
    _write(Path(json_file) if json_file is not None else out / "claims.json", text)
    _write(pages / "paper.md", page(verdicts, setting, out, pages, other))
    if any(v.claim is readings.READING for v in verdicts):
        figure = next(v.figure for v in verdicts if v.claim is readings.READING)
        _write(pages / "readings.md", readings_page(results, figure, out, pages, other))
    return verdicts


def _judge(claim: Claim, results: Results, out: Path) -> Verdict:
    mine = {tuple(p.values()) for p in _points(claim, results.setting)}
    have = {tuple(p.values()) for p, _ in results.runs}
    failed = [f"{_differs(p)}: {reason}" for p, reason in results.failed if tuple(p.values()) in mine]
    missing = len(mine - have) - len(failed)
    figure = claim.draw(results)
    name = ""
    if figure is not None:
        name = f"{claim.name}.png"
        beside = out / f".{claim.name}.part.png"
        # without a date or a version, so that equal numbers give an equal file
        figure.savefig(beside, dpi=STYLE["savefig.dpi"], metadata={"Software": None})
        os.replace(beside, out / name)
    return Verdict(claim, claim.judge(results), name, missing, failed)


def _points(claim: Claim, setting: Setting) -> list[dict[str, Any]]:
    return points_of(setting, list(claim.blocks)) if claim.blocks else []


def _differs(point: dict[str, Any]) -> str:
    return ", ".join(f"{k} {v}" for k, v in point.items() if k in ("frequency", "k_B", "layers", "seed", "form"))


def _calibration(found: Calibration, file: str) -> dict[str, Any]:
    return {
        "file": file, "mu_eff_s_per_m": found.mu_eff, "error": found.error if np.isfinite(found.error) else None,
        "rms_m_per_s": found.rms, "packings": found.packings,
    }  # fmt: skip


def _write(file: Path, text: str) -> None:
    beside = file.with_name(f".{file.name}.part")
    try:
        beside.write_text(text, encoding="utf-8")
        os.replace(beside, file)
    except OSError as error:
        raise InputError(f"cannot write it: {error.strerror}", file=file) from None


# ---- words ------------------------------------------------------------------------------------


def in_words(verdict: Verdict) -> str:
    """A claim as the command prints it."""
    lines = [f"{verdict.claim.name}  {verdict.claim.title} ({verdict.claim.where}): {verdict.verdict}"]
    for f in verdict.findings:
        lines.append(f"  the paper: {f.says}")
        packings = f", {f.packings} packings" if f.packings else ""
        lines.append(f"    measured: {f.measured}{packings}: {f.verdict}")
        if f.note:
            lines.append(f"    ({f.note})")
    if verdict.missing > 0:
        lines.append(f"  {verdict.missing} runs are missing")
    lines += [f"  failed: {reason}" for reason in verdict.failed]
    return "\n".join(lines)


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
        "The scale of k_B is not given in SI. First 2.00 mN per radian was taken for the label 100, before anything "
        "was measured. The default, 1.36 mN per radian, is 0.68 of that: **one number, fitted** so that the free "
        "swimmer of label 100 is fastest at the table's second resonance. F4 is no evidence for this label then; the "
        "labels 150, 200 and 500, and everything else, are."
    )
    if other is not None and np.isclose(other.k_B_scale, first):
        scale = other.measured("F4", "the optimum is the second resonance")
        text += (
            f" Every claim with k_B as first taken: [page]({_link(other.file.with_name('paper.md'), pages)}), "
            f"[numbers]({_link(other.file, pages)}), side by side in [paper.md](paper.md)"
            + (f"; there F4 has: {scale}." if scale else ".")
        )
    modes = ", ".join(f"`{form}` {second(form=form):.1f}" for form in t1.FORMS)
    here = (
        f"Here: {scale_in_words(used)}. Second modes of the straight swimmer, linearised: {modes} Hz (T1 in "
        "[paper.md](paper.md#t1)), not the table's 9.1 Hz; "
        f"`leader` comes to {second(k_B_scale=0.25):.1f} Hz with 0.25 of the default."
    )
    return [text, "", here]
