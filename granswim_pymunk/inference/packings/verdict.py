"""What is written of an unseen bed: entries of laws and places, a curve without a name, scenes that run, tables."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ...laws import has_role
from ...scene import Scene
from ..flow import flow_of, told_flow
from ..result import HELD_OUT, PARTLY, TRAINING, Table, Used, handed_over
from ..swimmer_terms import reported_parameters
from .conclude import Finding
from .state import Search, Trial, change_of
from .summaries import Condition


def used_of(s: Search) -> tuple[Used, ...]:
    """How each recording was used: rows of a curve are one recording."""
    used = {}
    for recording in {c.recording.name: c.recording for c in s.conditions}.values():
        mine = [c for c in s.conditions if c.recording is recording]
        learnt = any(c.view is not None for c in mine)
        split = any(c.test is not None for c in mine)
        used[recording.name] = Used.of(recording, PARTLY if learnt and split else TRAINING if learnt else HELD_OUT)
    return tuple(used.values())


def parameters_of(f: Finding, trial: Trial) -> dict[str, tuple[Any, Any, Any, str]]:
    """Name to (value, low, high, unit) of a found law."""
    values, covariance = f.own(trial)
    if has_role(trial.mechanism, "medium"):
        told = told_flow(flow_of(values, covariance), ("c", "u"))
        return told if values[0] > 0 else {"c": told["c"]}
    return reported_parameters(trial.term, values, covariance)


def curve_text(f: Finding, joint: int | None) -> str:
    """What is left over, as a short expression in the drive's phase theta."""
    s = f.search
    c = s.training[0]
    r, _ = s.base.left[c.name]
    if c.any_view.curve:
        return f"speed seen less predicted at {c.frequency:g} Hz: {1e3 * r[0]:.3g} mm/s"
    at = {(n.kind, n.place, n.harmonic): k for k, n in enumerate(c.numbers)}
    j = joint or 0

    def bend(kind: str, h: int) -> float:
        value = r[at[kind, j, h]]
        return float(value - (r[at[kind, j - 1, h]] if j else 0.0))

    parts = [f"{bend('mean', 0):.3g}"]
    for h in c.any_view.harmonics:
        turn = "theta" if h == 1 else f"{h} theta"
        parts += [f"{bend('cos', h):+.3g} cos({turn})", f"{bend('sin', h):+.3g} sin({turn})"]
    return f"bend at joint {j}, seen less predicted: {' '.join(parts)} rad, theta = 2 pi f t + phase, {c.name}"


def revised_scene(f: Finding, c: Condition) -> Scene:
    """The scene of a recording with what was found; its bed is packed when it is run."""
    s = f.search
    scene: Scene = change_of(c, s.adjust, f.values, f.extra())(c.scene)
    start, end = float(c.frames[0]), float(c.frames[-1])
    dt = s.runner.time_step(c, False)
    spacing = (end - start) / max(len(c.frames) - 1, 1)
    scene = replace(scene, seed=c.recording.scene.seed)
    return handed_over(scene, f.camera(), c.recording, dt=dt, start=start, duration=end - start, output=spacing)


def tables_of(s: Search) -> tuple[Table, ...]:
    """What became of each candidate, and how much was run."""
    rows = []
    for t in sorted(s.trials, key=lambda t: -t.gain):
        state = t.reason or (f"refitted {t.refitted} times" if t.refitted else "first order")
        amount = ""
        if t.fit is not None:
            amount = ", ".join(f"{v:.3g} {x.unit}" for v, x in zip(t.values(), t.term.free, strict=True))
        rows.append([t.label, f"{t.surviving:.2f}", f"{t.gain:.1f}", amount, state])
    tables = [
        Table("Candidates", ["candidate", "surviving", "gain", "amount", "state"], rows, (1, 2),
              "surviving: share of the signature that recalibration cannot imitate; gain: fall of the misfit")
    ]  # fmt: skip
    runs = []
    for c in s.conditions:
        count = sum(len(v) for (name, _, _), v in s.runner.tracks.items() if name == c.name)
        said = "held out" if c.view is None else "training and held out" if c.test is not None else "training"
        runs.append([c.name, f"{c.frequency:g}", said, str(count), str(s.means.dof.get(c.name, 0))])
    header = ["recording", "frequency [Hz]", "use", "runs", "dof of the spread"]
    return (*tables, Table("Recordings", header, runs, (1, 3, 4)))
