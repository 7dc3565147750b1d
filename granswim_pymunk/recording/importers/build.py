"""From what a file shows, and what the user says about it, to a recording in SI."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from ...scene import Scene, read_toml, scene_from_dict
from ..folder import RECORDING_KEYS
from ..recording import Recording, rail_axes
from .adjustables import adjusted
from .base import Found, Options
from .commands import commanded
from .stamps import frame_rate, look_rounded, rounded
from .table import some_of
from .templates import TEMPLATES, G, Tracks, parse_gravity, parse_law
from .units import ANGLES, LENGTHS, MASSES, TIMES, factor, measure

TURNS = 4 * math.pi  # a range of angles above which they may be degrees; a pendulum goes round less often
FULL_CIRCLES = 720.0  # and up to which: degrees between -360 and 360
HOLDING = ("pin", "rail", "hinge", "rod", "drive")  # laws that say which way a body can go


@dataclass(frozen=True)
class Built:
    """A recording, and what was decided on the way: one line each, for the user.

    place : scale [m/px], left, top [m] of the picture that positions were read from; None where it is not known
    """

    recording: Recording
    notes: tuple[str, ...]
    place: tuple[float, float, float] | None = None


def build(found: Found, options: Options, source: Path) -> Built:
    """Units, the direction of y, bodies, laws. Raises InputError naming the row, or what has to be said."""
    notes = list(found.notes)
    found = _upright(found, options, notes)
    found = _drop_short(_with_body(found, options, source, notes), options, notes)
    length = _length(found, options, source, notes)
    if (found.length == "px" or "px" in str(options.unit)) and options.flip_y is None and not found.y_down:
        notes.append("y is taken to point up: where it counts from the top of a picture, say --flip-y HEIGHT")
    t = _times(found, options, source, notes)
    notes.extend(_out_of_order(found, t))
    x, y, angle = _flip(found, options, notes)
    x, y = x * length, y * length
    place = _place(found, options, length)
    if angle is not None:
        turn = options.angle_unit if options.angle_unit is not None else (found.turn or "rad")
        least, most = np.nanmin(angle, initial=0.0), np.nanmax(angle, initial=0.0)
        if options.angle_unit is None and not found.turn and TURNS < most - least <= FULL_CIRCLES:
            notes.append(f"angles from {least:.4g} to {most:.4g} are taken for radians (degrees: --angle-unit deg)")
        angle = angle * factor(turn, ANGLES, "angle unit")
    body = list(found.body or ())
    # whether one coordinate is enough is known with the scene
    seen = np.isfinite(x) | np.isfinite(y)
    if angle is not None:
        seen = seen | np.isfinite(angle)
    if not seen.any():
        raise InputError("is empty: no body is seen in any frame", file=source)
    data = _scene_data(found, options, source, length, notes, Tracks(t, body, x, y, angle))
    scene = scene_from_dict(data, file=_template_file(options), strict=False, extra=RECORDING_KEYS)
    placed = set(np.array(body)[np.isfinite(x) | np.isfinite(y)].tolist())
    scene = commanded(scene, options, list(dict.fromkeys(body)), placed, notes)
    scene = adjusted(scene, options.adjustables)
    x, y = _without_unmeasured(found.unmeasured, scene, body, x, y, notes)
    numbers = {key: data[key] for key in ("title", *RECORDING_KEYS) if key in data}
    given = {key: getattr(options, key) for key in ("title", "sampling", "position_noise", "angle_noise")}
    numbers |= {key: value for key, value in given.items() if value is not None}
    numbers.setdefault("title", found.title or source.stem)
    recording = _assemble(source, scene, t, body, x, y, angle, found.rows, numbers)
    return Built(recording, tuple(notes), place)


# ---- one coordinate alone -----------------------------------------------------------------------


def _upright(found: Found, options: Options, notes: list[str]) -> Found:
    """The only coordinate as the vertical one, where its heading names no axis and what is believed acts along y."""
    x, y = (abs(part) for part in _way(options))
    if found.lone is None or y <= x:
        return found
    said = f"{found.lone} is the only coordinate and is taken for y, the way of gravity or of a rail"
    seen = np.flatnonzero(np.isfinite(found.x))
    first, last = np.array_split(found.x[seen[np.argsort(found.clock[seen], kind="stable")]], 2)
    if options.flip_y is None and found.body is None and len(first) and len(last):
        grows = float(np.median(last)) > float(np.median(first))
        said += ", upwards" + ("; it grows: where it counts downwards, say --flip-y 0" if grows else "")
    notes.append(said)
    return replace(found, x=found.y, y=found.x, unmeasured="x")


def _way(options: Options) -> tuple[float, float]:
    """A vector along which bodies move that show one coordinate: their rail, else gravity; (1, 0) where others hold."""
    sideways = (1.0, 0.0)
    file = _template_file(options)
    data = _toml(file) if file is not None else {}
    listed, box = data.get("law"), data.get("scene")
    laws = [*(listed if isinstance(listed, list) else []), *map(parse_law, options.laws)]
    laws = [law for law in laws if isinstance(law, Mapping) and law.get("name") in HOLDING]
    rail = next((law["direction"] for law in laws if law["name"] == "rail" and "direction" in law), None)
    if isinstance(rail, Sequence) and len(rail) == 2 and all(isinstance(part, int | float) for part in rail):
        return float(rail[0]), float(rail[1])
    if laws or (options.scene is not None and file is None and options.scene != "drop"):
        return sideways
    gravity = options.gravity
    if gravity is None and isinstance(box, Mapping):
        gravity = box.get("gravity")
    if gravity is None:
        return (0.0, -G) if options.scene == "drop" else sideways
    return parse_gravity(gravity)


def _without_unmeasured(
    axis: str | None, scene: Scene, body: Sequence[str], x: np.ndarray, y: np.ndarray, notes: list[str]
) -> tuple[np.ndarray, np.ndarray]:
    """Places without the coordinate that was not measured, for bodies whose rail makes up for it; others keep 0."""
    if axis is None:
        return x, y
    xy, names = {"x": x.copy(), "y": y.copy()}, np.array(body)
    railed = [name for name, along in rail_axes(scene).items() if "xy"[along] != axis and name in body]
    xy[axis][np.isin(names, railed)] = np.nan
    if railed:
        notes.append(f"{axis} was not measured and is left out: the rail of {', '.join(railed[:8])} runs across it")
    if set(body) - set(railed):
        notes.append(f"{axis} was not measured and stands as 0 throughout, which a diagnosis takes for not measured")
    return xy["x"], xy["y"]


# ---- bodies that are not told apart, short tracks -----------------------------------------------


def _by_its_name(found: Found, options: Options, notes: list[str]) -> Found:
    """The only body by the name that the user gave it: to the file it is "mass A", "Angle of arm", or a film's name.

    Several by the headings of their coordinates: body 1, whose heading is x1, may be called that.
    """
    names, named = set(found.body or ()), [text.partition(":")[0].strip() for text in options.bodies]
    called = {n[1:]: n for n in named if n not in names and n[:1] in tuple("xyXY") and n[1:] in {*names} - {*named}}
    if called:
        notes.extend(f"{name!r} is taken for {heading}" for name, heading in called.items())
        return replace(found, body=[called.get(name, name) for name in found.body or ()])
    if len(names) != 1 or len(named) != 1 or named[0] in ("*", *names):
        return found
    (name,), file = names, _template_file(options)
    listed = _toml(file).get("body", []) if file is not None else []
    if any(isinstance(b, Mapping) and b.get("id") == name for b in listed):
        return found
    if options.column_map().keys() - {"t", "body", "x", "y", "z", "angle"}:
        return found  # the user called it so
    notes.append(f"{name!r} is taken for {named[0]}, the only body")
    return replace(found, body=named * len(found.clock))


def _with_body(found: Found, options: Options, source: Path, notes: list[str]) -> Found:
    if found.body is not None:
        return _by_its_name(found, options, notes)
    named = [text.partition(":")[0] for text in options.bodies]
    named = [name for name in named if name != "*"]
    if not named and isinstance(options.scene, str | Path) and Path(options.scene).is_file():
        scene = scene_from_dict(_toml(options.scene), file=options.scene, strict=False, extra=RECORDING_KEYS)
        named = [b.id for b in scene.bodies if b.mobile]
    twice = np.flatnonzero(np.diff(np.sort(found.clock)) == 0)
    if len(twice):
        rows = np.flatnonzero(found.clock == np.sort(found.clock)[twice[0]])[:2]
        which = "some rows" if found.rows is None else f"rows {found.rows[rows[0]]} and {found.rows[rows[1]]}"
        if found.counts == "time" and look_rounded(found.clock, found.x, found.y, found.angle):
            raise InputError(rounded(_times(found, options, source, []), which), file=source)
        raise InputError(
            f"has several rows at one time ({which}), and no column that tells bodies apart by its name: say which "
            "one does (--columns body=NAME)",
            file=source,
        )
    if len(named) > 1:
        raise InputError("has no column body, and the scene has more than one", file=source)
    return replace(found, body=[named[0] if named else "body"] * len(found.clock))


def _drop_short(found: Found, options: Options, notes: list[str]) -> Found:
    if options.min_frames <= 1:
        return found
    names = np.array(found.body)
    seen = np.isfinite(found.x) & np.isfinite(found.y)
    if found.angle is not None:
        seen = seen | np.isfinite(found.angle)
    listed, counts = np.unique(names[seen], return_counts=True)
    keep = np.isin(names, listed[counts >= options.min_frames])
    dropped = int((counts < options.min_frames).sum())
    if dropped:
        notes.append(f"{dropped} tracks are seen in fewer than {options.min_frames} frames and left out")
    rows = None if found.rows is None else np.asarray(found.rows)[keep].tolist()
    return replace(
        found, clock=found.clock[keep], body=names[keep].tolist(), x=found.x[keep], y=found.y[keep],
        angle=None if found.angle is None else found.angle[keep], rows=rows,
    )  # fmt: skip


# ---- units --------------------------------------------------------------------------------------


def _length(found: Found, options: Options, source: Path, notes: list[str]) -> float:
    if options.unit is not None:
        return factor(options.unit, LENGTHS, "unit")
    if found.length == "px" and np.isfinite(found.x).any():
        raise InputError(
            "its positions are in pixels: say how large one is, as --unit 0.1mm/px (or --unit 1e-4, in metres)",
            file=source,
        )
    if found.length is not None and found.length != "px":
        notes.append(f"positions are in {found.length}, as the file says")
        return factor(found.length, LENGTHS, "unit")
    return 1.0


def _times(found: Found, options: Options, source: Path, notes: list[str]) -> np.ndarray:
    fps = options.fps
    if fps is not None and not (math.isfinite(fps) and fps > 0):
        raise InputError(f"should be above zero [Hz], got {fps!r}", where="fps")
    if fps is None and found.counts == "frame" and options.time_unit is None:
        fps = found.rate
        if fps is None:
            raise InputError("its clock counts frames and needs the frame rate (--fps)", file=source)
        notes.append(f"frame rate {fps:g} Hz, as the file says")
    if fps is not None:
        if found.counts == "step":
            # steps between stored frames do not matter: every stored frame is one of the film's
            return np.unique(found.clock, return_inverse=True)[1] / fps
        return found.clock / fps
    if found.counts == "step" and options.time_unit is None:
        raise InputError(
            "its clock counts time steps: say how long one is (--time-unit 1e-6, in seconds), or the rate of the "
            "stored frames (--fps)",
            file=source,
        )
    unit = options.time_unit if options.time_unit is not None else (found.time or "s")
    return found.clock * factor(unit, TIMES, "time unit")


def _out_of_order(found: Found, t: np.ndarray) -> list[str]:
    """A line for a body whose rows are not in the order of time: one stamp alone is a slip, many are another column."""
    names, of = np.unique(np.array(found.body or ()), return_inverse=True)
    by_body = np.argsort(of, kind="stable")
    back = (np.diff(of[by_body]) == 0) & (np.diff(t[by_body]) < 0)
    how_often = np.bincount(of[by_body][1:][back], minlength=len(names))
    once, often = np.flatnonzero(how_often == 1), np.flatnonzero((how_often > 1) & (found.counts == "time"))
    ends, said = np.searchsorted(of[by_body], np.arange(len(names) + 1)), list[str]()
    for body in once[:3].tolist():
        rows = by_body[ends[body] : ends[body + 1]]
        k = int(np.argmin(np.diff(t[rows])))
        late, early = (len(rows) < 3 or not (np.diff(np.delete(t[rows], j)) < 0).any() for j in (k, k + 1))
        off = k if late else k + 1
        if late or early:
            row = "" if found.rows is None else f"row {found.rows[rows[off]]}, "
            beside = [f"{t[rows[j]]:.6g} s" for j in (off - 1, off + 1) if 0 <= j < len(rows)]
            said.append(
                f"{row}body {names[body]}: its time, {t[rows[off]]:.6g} s, is not in the order of the rows beside it "
                f"({' and '.join(beside)}): is it a slip? Rows are put in the order of time"
            )
    for body in often[:3]:
        said.append(
            f"body {names[body]}: time goes back in {how_often[body]} of its {ends[body + 1] - ends[body]} rows: is "
            "another column the time (--columns t=NAME)? Rows are put in the order of time"
        )
    return said


def _flip(found: Found, options: Options, notes: list[str]) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """y upwards; angles change their sign with it."""
    flip = options.flip_y
    if flip is None and found.y_down:
        flip = 0.0
        notes.append("y points down in such files and is turned round, y = -y (--flip-y HEIGHT or --flip-y no)")
    if isinstance(flip, float) and not math.isfinite(flip):
        raise InputError(f"should be the height of the picture, got {flip!r}", where="flip_y")
    if flip is None or flip is False:
        return found.x, found.y, found.angle
    # motion along a line has y = 0 throughout, which is no height in a picture
    flat = not np.any(found.y[np.isfinite(found.y)])
    y = found.y if flat else float(flip) - found.y
    return found.x, y, None if found.angle is None else -found.angle


def _place(found: Found, options: Options, length: float) -> tuple[float, float, float] | None:
    """Where the picture lies whose pixels the file counts from its upper left corner; None for other files."""
    flip = options.flip_y if options.flip_y is not None else (0.0 if found.y_down else False)
    pixels = found.length == "px" or (isinstance(options.unit, str) and "px" in options.unit)
    if not pixels or isinstance(flip, bool):
        return None
    return length, 0.0, float(flip) * length


# ---- the scene ----------------------------------------------------------------------------------


def _template_file(options: Options) -> str | Path | None:
    if options.scene is None or str(options.scene) in TEMPLATES:
        return None
    if not Path(options.scene).suffix and not Path(options.scene).exists():
        raise InputError(f"{options.scene} is no file, and none of {', '.join(TEMPLATES)}", where="--scene")
    return options.scene


def _toml(path: str | Path) -> dict[str, Any]:
    data = read_toml(path)
    data.pop("format", None)
    return data


def parse_body(text: str) -> dict[str, Any]:
    """``id:radius:mass[:role]`` as a [[body]] table; the role is ``free`` where not given."""
    parts = [part.strip() for part in text.split(":")]
    if len(parts) not in (3, 4):
        raise InputError(f"should be id:radius:mass[:role], as bob:5mm:10g, got {text!r}", where="body")
    radius = measure(parts[1], LENGTHS, "radius [m] and mass [kg]", "body")
    mass = measure(parts[2], MASSES, "radius [m] and mass [kg]", "body")
    return {"id": parts[0], "role": parts[3] if len(parts) == 4 else "free", "radius": radius, "mass": mass}


def _scene_data(
    found: Found, options: Options, source: Path, length: float, notes: list[str], tracks: Tracks
) -> dict[str, Any]:
    names = _seen_names(tracks)
    file = _template_file(options)
    data: dict[str, Any] = _toml(file) if file is not None else {}
    bodies = [parse_body(text) for text in options.bodies]
    everyone = next((b for b in bodies if b["id"] == "*"), None)
    bodies = [b for b in bodies if b["id"] != "*"]
    listed = data.get("body", [])
    listed = listed if isinstance(listed, list) else []
    told = {str(b.get("id")) for b in (*listed, *bodies) if isinstance(b, Mapping)}
    if everyone is not None:
        own = {b["id"]: b for b in bodies}
        alike = [own.pop(name, everyone | {"id": name}) for name in names if name in own or name not in told]
        bodies = [*alike, *own.values()]  # in the order of the file: a swimmer's disks are a chain
    elif not bodies and file is None and set(names) <= found.radius.keys() & found.mass.keys():
        bodies = [{"id": n, "role": "free", "radius": found.radius[n] * length, "mass": found.mass[n]} for n in names]
        notes.append("radii and masses are those of the file")
    if bodies:
        data["body"] = [*listed, *bodies]
    if not any(key in data for key in ("body", "bodies", "swimmer")):
        some = some_of(names, 8)
        raise InputError(
            f"which bodies are these? The file has {some}: say radius and mass of each, as --body '{names[0]}:5mm:10g' "
            "(all alike: --body '*:5mm:10g'), or --scene TEMPLATE.toml",
            file=source,
        )
    laws = [parse_law(text) for text in options.laws]
    box = dict(data.get("scene", {})) if isinstance(data.get("scene", {}), Mapping) else {}
    if found.period is not None and "periodic_x" not in box:
        period = found.period * length
        if period < 10 * max(float(np.ptp(tracks.x[np.isfinite(tracks.x)])), 1e-12):
            box["periodic_x"] = period
            notes.append(f"the box is periodic along x: {period:g} m")
    if options.gravity is not None:
        box["gravity"] = list(parse_gravity(options.gravity))
    if box:
        data["scene"] = box
    if options.scene is not None and file is None:
        template = TEMPLATES[str(options.scene)].make(tracks, data["body"], laws, box)
        data |= template.data
        notes += template.notes
        laws = template.left_over
    if laws:
        data["law"] = [*data.get("law", []), *laws]
    return data


def _seen_names(tracks: Tracks) -> list[str]:
    """Bodies that are seen, in the order of the file; numbers in their order."""
    seen = np.isfinite(tracks.x) if tracks.angle is None else np.isfinite(tracks.x) | np.isfinite(tracks.angle)
    names = list(dict.fromkeys(np.array(tracks.body)[seen].tolist()))
    return sorted(names, key=int) if all(name.isdigit() for name in names) else names


# ---- tracks -------------------------------------------------------------------------------------


def _assemble(
    source: Path,
    scene: Scene,
    t: np.ndarray,
    body: Sequence[str],
    x: np.ndarray,
    y: np.ndarray,
    angle: np.ndarray | None,
    rows: Sequence[int] | None,
    numbers: Mapping[str, Any],
) -> Recording:
    """A recording from long columns in SI. Raises InputError naming the row."""
    order = {name: row for row, name in enumerate(scene.ids)}
    placed = np.isfinite(x) & np.isfinite(y)
    names = np.array(body)
    for name, axis in rail_axes(scene).items():
        # along a rail the other coordinate may be missing
        placed |= (names == name) & np.isfinite((x, y)[axis])
    seen = placed if angle is None else placed | np.isfinite(angle)
    kept = np.flatnonzero(seen)
    if not len(kept):
        raise InputError("is empty: every position has one coordinate only", file=source)

    def where(k: int) -> str | None:
        return None if rows is None else f"row {rows[k]}"

    place = np.array([order.get(body[k], -1) for k in kept.tolist()])
    if (place < 0).any():
        k = int(kept[int(np.argmax(place < 0))])
        listed = ", ".join(scene.ids[:8])
        raise InputError(
            f"body {body[k]!r} is not in the scene; it has: {listed} (--body '{body[k]}:RADIUS:MASS' adds it, "
            "--body '*:RADIUS:MASS' all that are not named)",
            file=source,
            where=where(k),
        )
    used, column = np.unique(place, return_inverse=True)
    times, frame = np.unique(t[kept], return_inverse=True)
    key = frame * len(used) + column
    sorting = np.argsort(key, kind="stable")
    twice = np.flatnonzero(np.diff(key[sorting]) == 0)
    if len(twice):
        first, second = (int(kept[sorting[twice[0] + n]]) for n in (0, 1))
        own = kept[names[kept] == names[second]]
        if look_rounded(t[own], x[own], y[own], None if angle is None else angle[own]):
            which = "some rows" if rows is None else f"rows {rows[first]} and {rows[second]}"
            raise InputError(rounded(t[own], which), file=source)
        other = "" if rows is None else f" (the other is row {rows[first]})"
        raise InputError(
            f"two rows for body {body[second]} at t = {t[second]:g} s{other}", file=source, where=where(second)
        )
    xy = np.full((len(times), len(used), 2), np.nan)
    both = placed[kept]
    xy[frame[both], column[both], 0] = x[kept][both]
    xy[frame[both], column[both], 1] = y[kept][both]
    angles = None
    if angle is not None:
        angles = np.full((len(times), len(used)), np.nan)
        angles[frame, column] = angle[kept]
    known: dict[str, Any] = {key: numbers.get(key) for key in RECORDING_KEYS}
    if known["sampling"] is None and len(times) > 1:
        known["sampling"] = float(f"{frame_rate(times):.6g}")
    return Recording(
        name=source.stem,
        title=str(numbers.get("title") or source.stem),
        scene=scene,
        t=times,
        ids=tuple(scene.ids[row] for row in used.tolist()),
        xy=xy,
        angle=angles,
        **known,
    )
