"""Is a recording in the units it should be in, and do its bodies leave each other room?

Each criterion compares two lengths or times that the recording states twice. It speaks only where they
differ by a factor that no experiment gives and a slip of units does (mm or cm for m, frames for s).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from ..errors import InputError
from ..touching import overlapping
from .clock import check_clock
from .recording import Recording

SLIPS = {1e3: "mm", 1e2: "cm", 1e6: "micrometres", 1e-3: "km"}
LATE = {1e3: "ms", 1e6: "microseconds"}
FAR = 30.0  # lengths that should agree, and are further apart than this, are in different units
LIGHTEST = 1e-5  # kg/m^3; steel with its radius in mm has 7.8e-6
FASTEST = 340.0  # m/s, median over a whole track: the speed of sound
FAST = 50.0  # m/s, too fast for bodies that have room between them for dozens of others
FORCE_FREE = {
    "gravity", "linear_drag", "quadratic_drag", "coulomb_substrate", "contact_linear", "contact_hertz",
    "contact_elastic",
}  # fmt: skip

ENOUGH = 2000  # bodies whose tracks are looked at, evenly among all of them
MANY = 20  # bodies: where there are more, single ones may be wrong


def check_plausible(recording: Recording, rows: Sequence[int] | None = None) -> None:
    """Raise InputError for stray times, mixed units and bodies that overlap by more than half a radius.

    rows : line of the first row of each frame, for the messages.
    """
    check_clock(recording, rows)
    recording = recording.on_rails()
    _check_radii(recording)
    _check_initial(recording)
    _check_drive(recording)
    _check_joints(recording)
    _check_angles(recording)
    _check_box(recording)
    _check_motion(recording)
    recording.scene.check_overlaps()
    _check_first_frame(recording)


def _mixed(recording: Recording, what: str, factor: float) -> InputError:
    near = min(SLIPS, key=lambda slip: abs(math.log(factor / slip)))
    unit = SLIPS[near] if abs(math.log10(factor / near)) < 0.35 else "another unit"
    return InputError(
        f"units look mixed: {what}, a factor of {factor:.3g}; are the tracks in {unit}? "
        "Everything should be in m",
        file=recording.folder,
    )


def _check_radii(recording: Recording) -> None:
    for body in recording.scene.bodies:
        density = body.mass / (4 / 3 * math.pi * body.radius) / body.radius / body.radius
        if body.mobile and density < LIGHTEST:
            raise InputError(
                f"units look mixed: a sphere of this radius ({body.radius:g} m) and mass ({body.mass:g} kg) "
                f"would weigh {density:.2g} kg/m^3; is the radius in mm? It should be in m",
                file=recording.folder,
                where=f"body {body.id}",
            )


def _check_initial(recording: Recording) -> None:
    """First positions and speeds against ``initial``: the same up to a factor of 100 or 1000?"""
    seen, believed = [], []
    moved, expected = [], []
    for column, row in enumerate(recording.track_rows):
        initial = recording.scene.bodies[row].initial
        frames = np.flatnonzero(np.isfinite(recording.xy[:, column, 0]))
        if initial is None or not len(frames):
            continue
        seen.append(recording.xy[frames[0], column])
        believed.append(initial[:2])
        if len(frames) > 1:
            moved.append(recording.xy[frames[1], column] - recording.xy[frames[0], column])
            expected.append(np.array(initial[2:]) * (recording.t[frames[1]] - recording.t[frames[0]]))
    for a, b, what in ((believed, seen, "starts"), (expected, moved, "starting velocities")):
        factor = _common_factor(np.array(a), np.array(b))
        if factor is not None:
            raise _mixed(recording, f"the tracks' {what} are those of `initial`, but larger by", factor)


def _check_drive(recording: Recording) -> None:
    """The way of a driven body against the integral of its command."""
    scene = recording.scene
    for item in scene.laws_named("drive"):
        values = scene.resolved(item)
        direction = np.array(values["direction"], dtype=float)
        for name in item.bodies or ():
            if name not in recording.ids or name not in scene.inputs:
                continue
            t, xy, _ = recording.unwrapped().body(name)
            t, xy = t[np.isfinite(xy[:, 0])], xy[np.isfinite(xy[:, 0])]
            if len(t) < 3:
                continue
            at, values_then = scene.inputs[name]
            command = np.interp(t, np.array(at), np.array(values_then))
            way = values["gain"] * np.cumsum(0.5 * (command[1:] + command[:-1]) * np.diff(t))
            expected = way[:, None] * direction / np.hypot(*direction)
            factor = _common_factor(expected, xy[1:] - xy[0])
            if factor is not None:
                raise _mixed(recording, f"body {name} moves as its input says, but farther by", factor)


def _check_angles(recording: Recording) -> None:
    """A pinned body that swings back and forth stays within one turn; in degrees it seems to make many."""
    scene = recording.scene
    if recording.angle is None or scene.laws_named("drive"):
        return
    for item in scene.laws_named("pin"):
        for name in item.bodies or ():
            if name not in recording.ids:
                continue
            angle = recording.angle[:, recording.ids.index(name)]
            angle = angle[np.isfinite(angle)]
            if len(angle) < 4 or np.ptp(angle) < 3 * math.pi:
                continue
            middle = 0.5 * (angle.max() + angle.min())
            sides = np.sign(angle - middle)[np.abs(angle - middle) > np.ptp(angle) / 8]
            if np.count_nonzero(np.diff(sides)) >= 3:
                raise InputError(
                    f"units look mixed: body {name} swings back and forth over {np.ptp(angle):.3g}; "
                    "are the angles in degrees? They should be in rad",
                    file=recording.folder,
                )


def _common_factor(a: np.ndarray, b: np.ndarray) -> float | None:
    """The factor s of b = s a, where it is one of the slips and fits within 5 %; None otherwise."""
    square = float(np.sum(a * a)) if a.size else 0.0
    size = float(np.sqrt(np.sum(b * b))) if b.size else 0.0
    if square <= 0 or size <= 0:
        return None
    s = float(np.sum(a * b)) / square
    if np.sqrt(np.sum((b - s * a) ** 2)) > 0.05 * size:
        return None
    return s if any(abs(s / slip - 1) < 0.05 for slip in SLIPS) else None


def _check_joints(recording: Recording) -> None:
    """Distances that the scene fixes: from disk to disk of a swimmer, from a pin's anchor to its body."""
    scene = recording.scene
    column = {row: k for k, row in enumerate(recording.track_rows.tolist())}
    for item in scene.laws_named("union"):
        length = float(scene.resolved(item)["length"])
        for chain in scene.chains:
            joints = itertools.pairwise(chain)
            pairs = [(column[i], column[j]) for i, j in joints if {i, j} <= column.keys()]
            if pairs and length > 0:
                i, j = np.array(pairs).T
                _compare(
                    recording,
                    recording.xy[:, j] - recording.xy[:, i],
                    length,
                    "consecutive disks of the swimmer",
                )
    for item in scene.laws_named("pin"):
        for name in item.bodies or ():
            if name in recording.ids and item.values["length"] > 0:
                arm = recording.xy[:, recording.ids.index(name)] - np.array(item.values["anchor"])
                _compare(recording, arm, item.values["length"], f"anchor and body {name} of the pin")


def _compare(recording: Recording, apart: np.ndarray, length: float, who: str) -> None:
    if recording.scene.periodic_x:
        apart = apart.copy()
        # a neighbour is one image away at most; farther away it is in other units
        image = np.round(apart[..., 0] / recording.scene.periodic_x)
        apart[..., 0] -= recording.scene.periodic_x * np.where(np.abs(image) == 1, image, 0.0)
    distance = np.hypot(apart[..., 0], apart[..., 1])
    distance = distance[np.isfinite(distance)]
    if not len(distance):
        return
    typical = float(np.median(distance))
    if typical > FAR * length or typical < length / FAR:
        raise _mixed(
            recording,
            f"{who} are {typical:.3g} apart in the tracks, {length:.3g} m in the scene",
            typical / length,
        )


def _check_box(recording: Recording) -> None:
    """Walls at both y ends of a periodic box hold everything: nothing is seen many boxes away."""
    scene = recording.scene
    walls = [b.initial[1] for b in scene.bodies if b.role == "wall" and b.initial is not None]
    if not walls or scene.periodic_x is None or not recording.xy.size:
        return
    height = max(walls) - min(walls)
    y = recording.xy[..., 1]
    y = y[np.isfinite(y)]
    if height > 0 and len(y):
        away = float(np.max(np.abs(y - 0.5 * (max(walls) + min(walls)))))
        if away > FAR * height:
            raise _mixed(
                recording,
                f"bodies are {away:.3g} from the middle of walls that are {height:.3g} m apart",
                away / height,
            )


def _check_motion(recording: Recording) -> None:
    """Bodies under gravity and drag alone fall with g, not 1000 g or a millionth; nothing granular is supersonic."""
    scene = recording.scene
    g = np.array(scene.gravity)
    size = float(np.hypot(*g))
    free = {item.name for item in scene.laws} <= FORCE_FREE
    speeds = []
    for column in range(0, len(recording.ids), 1 + len(recording.ids) // ENOUGH):
        name = recording.ids[column]
        frames = np.flatnonzero(np.isfinite(recording.xy[:, column, 0]))
        if len(frames) < 3:
            continue
        t, xy = recording.t[frames], recording.xy[frames, column]
        # over many frames at a time, or a fast camera makes speeds of noise
        some = np.linspace(0, len(frames) - 1, min(len(frames), 20)).astype(int)
        steps = np.diff(xy[some], axis=0)
        if scene.periodic_x:
            steps[:, 0] -= scene.periodic_x * np.round(steps[:, 0] / scene.periodic_x)
        speeds.append(float(np.median(np.hypot(steps[:, 0], steps[:, 1]) / np.diff(t[some]))))
        if not (free and size > 0 and len(frames) >= 6) or scene.periodic_x:
            continue
        s = (t - t.mean()) / np.ptp(t)
        design = np.vander(s, 3)
        fit, *_ = np.linalg.lstsq(design, xy, rcond=None)
        acceleration = 2 * fit[0] / np.ptp(t) ** 2
        misfit = float(np.sqrt(np.mean((xy - design @ fit) ** 2)))
        along = float(acceleration @ g) / size
        straight = along > 0.95 * float(np.hypot(*acceleration))
        if straight and misfit < 0.05 * float(np.ptp(xy, axis=0).max()):
            for slip in (1e2, 1e3):
                if abs(along / (slip * size) - 1) < 0.35:
                    raise _mixed(
                        recording, f"body {name} falls with {along:.3g} where g is {size:.3g} m/s^2", slip
                    )
            for late, unit in LATE.items():
                if abs(along * late**2 / size - 1) < 0.35:
                    raise InputError(
                        f"units look mixed: body {name} falls with {along:.3g} where g is {size:.3g} m/s^2, a factor "
                        f"of {late:g} in time; are the times in {unit}? They should be in s",
                        file=recording.folder,
                    )
    speed = float(np.median(speeds)) if speeds else 0.0
    if speed > FASTEST or (speed > FAST and _is_sparse(recording)):
        raise InputError(
            f"units look mixed: bodies move at {speed:.3g} m/s; are the tracks in mm? They should be in m",
            file=recording.folder,
        )


def _is_sparse(recording: Recording) -> bool:
    """Two or more bodies that are there to collide, and never come within 20 diameters of each other."""
    if not any(item.law.kind in ("pair", "impulse") for item in recording.scene.laws):
        return False
    radius = max(recording.scene.bodies[row].radius for row in recording.track_rows)
    together = [xy[np.isfinite(xy[:, 0])] for xy in recording.xy]
    together = [xy for xy in together if len(xy) > 1]
    return bool(together) and min(cKDTree(xy).query(xy, k=2)[0][:, 1].min() for xy in together) > 40 * radius


def _check_first_frame(recording: Recording) -> None:
    """Overlaps where starts come from the tracks.

    0.6 of a radius and four standard deviations of the noise are let pass: a rough calibration puts
    touching disks inside each other.
    """
    scene = recording.scene
    if not any(item.law.kind in ("pair", "impulse") for item in scene.laws):
        return
    found: list[tuple[int, tuple[float, ...], bool]] = []
    column = {row: k for k, row in enumerate(recording.track_rows.tolist())}
    for row, body in enumerate(scene.bodies):
        if body.initial is not None:
            found.append((row, body.initial[:2], False))
        elif row in column and np.isfinite(recording.xy[0, column[row], 0]):
            found.append((row, tuple(recording.xy[0, column[row]]), True))
    if len(found) < 2 or not any(tracked for _, _, tracked in found):
        return
    rows = [row for row, _, _ in found]
    measured = [tracked for _, _, tracked in found]
    xy = np.array([place for _, place, _ in found])
    period = scene.periodic_x
    raw = xy[:, 0].copy()
    if period:
        xy[:, 0] %= period
        xy[xy[:, 0] >= period, 0] = 0.0
        xy[:, 1] -= xy[:, 1].min()
    radius = np.array([scene.bodies[row].radius for row in rows])
    allowance = 4 * math.sqrt(2) * (recording.position_noise or 0.0)
    wrong: list[tuple[str, str, float]] = []
    for i, j in sorted(overlapping(xy, radius, period)):
        a, b = scene.bodies[rows[i]], scene.bodies[rows[j]]
        if not (measured[i] or measured[j]) or {a.role, b.role} <= {"head", "tail"}:
            continue
        dx, dy = xy[j] - xy[i]
        dx -= round(dx / period) * period if period else 0.0
        if period and len(found) > MANY and abs(raw[j] - raw[i]) > 0.5 * period:
            continue  # a picture with a wrong scale does not close at the seam
        if len(found) > MANY and measured[i] != measured[j]:
            continue  # nor does it fit between walls whose places are told
        overlap = a.radius + b.radius - math.hypot(dx, dy)
        if overlap > 0.6 * min(a.radius, b.radius) + allowance:
            wrong.append((a.id, b.id, overlap))
    # among many bodies a few may carry the labels of others
    if len(wrong) > 0.01 * len(found):
        first, second, overlap = wrong[0]
        raise InputError(
            f"overlaps body {second} by {overlap:.3g} m in the first frame, more than half a radius "
            "(or radii and tracks are in different units)",
            file=recording.folder,
            where=f"body {first}",
        )
