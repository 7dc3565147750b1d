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
from ..errors import InputError
from ..recording.folder import read_curve
from ..report.style import STYLE
from ..sweep import read_dataset, write_dataset
from . import checks, f2, f3, f4, f5, f6, f7, f8, f9, f10, readings, t1
from .calibrate import Calibration, calibrate
from .claim import Claim, Verdict
from .compare import FORMAT, read_other
from .pages import page, readings_page
from .plans import FIRST, SETTINGS, Setting, points_of
from .results import Results, jobs_of, keep, kept_rows, labelled, load, mean_maps, run_points
from .scenes import MU_EFF

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


def _scaled(setting: str | Setting, k_B_scale: float, mu_eff: float) -> Setting:
    """The setting with other usual values, see ``paper``. Raises InputError."""
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
    return setting


def _record(setting: Setting, verdicts: Sequence[Verdict]) -> dict[str, Any]:
    """The content of claims.json."""
    return {
        "format": FORMAT, "version": __version__, "setting": setting.name, "packings": len(setting.seeds),
        "k_B_scale": setting.k_B_scale, "mu_eff_s_per_m": setting.mu_eff,
        "duration_s": setting.plan.duration, "settle_s": setting.plan.settle, "softness": setting.softness,
        "claims": [v.to_dict() for v in verdicts],
    }  # fmt: skip


def _make_folders(*places: Path) -> None:
    for place in places:
        try:
            place.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"cannot make this folder: {error.strerror}", file=place) from None


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
    setting = _scaled(setting, k_B_scale, mu_eff)
    other = read_other(compare) if compare is not None else None
    measured = read_curve(Path(curve)) if curve is not None else None
    out = Path(out)
    folder = Path(runs) if runs is not None else out / "runs"
    pages = Path(pages) if pages is not None else out
    if json_file is not None and not Path(json_file).resolve().parent.is_dir():
        raise InputError("its folder does not exist", file=json_file)
    _make_folders(out, pages)

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
    record = _record(setting, verdicts)
    if calibrated is not None:
        record["calibration"] = _calibration(calibrated, str(curve))
    text = json.dumps(record, indent=1, ensure_ascii=False) + "\n"
    _write(Path(json_file) if json_file is not None else out / "claims.json", text)
    _write(pages / "paper.md", page(verdicts, setting, out, pages, other))
    for figure in [v.figure for v in verdicts if v.claim is readings.READING][:1]:
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
