"""Recordings made of arrays and tables, and ``diagnose`` for every form in which a recording comes."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike

from .errors import InputError
from .laws import AUTOMATIC, Law
from .recording import Recording
from .recording.importers import TEMPLATES
from .recording.importers.commands import with_commands
from .recording.importers.templates import Tracks, parse_gravity, parse_law
from .recording.importers.units import LENGTHS, MASSES, factor, measure
from .recording.plausible import check_plausible
from .result import Result
from .scene import Adjustable, Body, LawUse, Scene, scene_from_dict, use

if TYPE_CHECKING:
    import pandas as pd

    from .inference.criteria import Criteria

LawLike: TypeAlias = LawUse | Law | str | Mapping[str, Any]
Each: TypeAlias = "float | str | Sequence[float | str] | Mapping[Any, float | str]"
ONE = "body"  # what a body is called that is alone


class More(TypedDict, total=False):
    """What ``diagnose`` hands on to ``make_recording``."""

    angle: ArrayLike
    inputs: Mapping[str, ArrayLike]
    hold: bool | None
    adjustable: Mapping[str, tuple[float, float]]
    periodic_x: float
    position_noise: float
    fps: float
    scale: float | str
    flip_y: bool
    min_frames: int
    name: str
    title: str


# ---- a recording of arrays or of a table -----------------------------------------------------------


def _names(names: str | Sequence[str] | None, scene: Scene | str | None, count: int) -> list[str]:
    """Names of so many bodies of arrays, as they are given, or as the scene has them."""
    if names is not None:
        return [names] if isinstance(names, str) else [str(n) for n in names]
    if isinstance(scene, Scene):
        return [b.id for b in scene.bodies if b.mobile and b.observed]
    return [ONE] if count == 1 else [str(k) for k in range(count)]


def make_recording(
    data: ArrayLike | pd.DataFrame,
    xy: ArrayLike | None = None,
    *,
    radius: Each | None = None,
    mass: Each | None = None,
    laws: LawLike | Sequence[LawLike] = (),
    gravity: float | Sequence[float] | None = None,
    names: str | Sequence[str] | None = None,
    scene: Scene | str | None = None,
    angle: ArrayLike | None = None,
    inputs: Mapping[str, ArrayLike] | None = None,
    hold: bool | None = None,
    adjustable: Mapping[str, tuple[float, float]] | None = None,
    periodic_x: float | None = None,
    position_noise: float | None = None,
    fps: float | None = None,
    scale: float | str | None = None,
    flip_y: bool = True,
    min_frames: int = 1,
    name: str = "tracks",
    title: str = "",
) -> Recording:
    """A recording of arrays, or of a table with trackpy's columns, and the scene as it is believed.

    Parameters
    ----------
    data : (T,) times [s], rising; or a DataFrame with frame, particle, x, y (t [s] instead of frame will do)
    xy : (T, n, 2) positions [m], NaN where not seen; (T, 2) of a single body. None with a table
    radius, mass : [m], [kg], or texts (``"5mm"``, ``"10g"``): one for all, one for each body, or by name
    laws : what acts already: ``use("linear_drag", c=1e-3)``, ``"pin:bob,anchor=0 0,length=0.25"``, or a table
        as in recording.toml
    gravity : its size [m/s^2], then along -y, or (gx, gy)
    names : of the bodies; left out "body", or "0", "1" ... (of a table: its particles)
    scene : a whole Scene in place of radius, mass, laws, gravity; or pendulum, wheel, puck, drop, cart, swimmer
    angle : (T, n) or (T,) angles [rad]
    inputs : commands of a motor by the body that a ``drive`` moves: (T,), one a frame, or (k, 2) with times [s]
    hold : whether a command stays until the next one, or is linear in between; None: as the values look
    adjustable : what recalibration may move, ``{"pin.length": (0.24, 0.26)}``
    periodic_x : period of the scene along x [m];  position_noise : of the camera, one standard deviation [m]
    fps : frames per second of a table;  scale : metres per pixel of a table, or a text (``"0.1mm/px"``)
    flip_y : the table counts y downwards, as pictures do, and is turned round, y = -y
    min_frames : particles of a table that are seen in fewer frames are left out
    name, title : of the recording

    Raises InputError naming what does not fit: shapes, a body, units that look mixed.

    >>> import granswim_pymunk as gs
    >>> t = [0.0, 0.1, 0.2]
    >>> recording = gs.make_recording(t, [[0.0, 0.0], [0.1, 0.0], [0.2, 0.0]], radius="5mm", mass="10g", names="puck")
    >>> recording.ids, recording.xy.shape, recording.scene.bodies[0].mass
    (('puck',), (3, 1, 2), 0.01)
    """
    if _is_table(data):
        if xy is not None or names is not None or angle is not None:
            raise InputError("of a table are its own: xy, names and angle belong to arrays", where="make_recording")
        (t, places, found), angles = _of_table(data, fps, scale, flip_y, min_frames), None
    else:
        if fps is not None or scale is not None:
            raise InputError("belong to a table; arrays are in seconds and metres", where="fps, scale")
        t, places, angles = _of_arrays(data, xy, angle)
        found = _names(names, scene, places.shape[1])
    if len(found) != places.shape[1]:
        raise InputError(f"{len(found)} names for {places.shape[1]} bodies in xy", where="names")
    if isinstance(scene, Scene):
        _check_says_all(radius=radius, mass=mass, laws=laws or None, gravity=gravity, periodic_x=periodic_x)
    else:
        bodies = _bodies(found, radius, mass)
        box = {"gravity": _gravity(gravity), "periodic_x": periodic_x}
        scene = _scene(scene, bodies, _laws(laws), box, (t, places, angles))
    scene = _with_adjustables(with_commands(scene, _commands(inputs or {}, t), hold), adjustable or {})
    order = [found.index(body.id) for body in scene.bodies if body.id in found]
    if unknown := set(found) - set(scene.ids):
        raise InputError("the scene has no such body", where=f"body {min(unknown)}")
    recording = Recording(
        name=name, scene=scene, t=t, ids=tuple(found[k] for k in order), xy=places[:, order],
        angle=None if angles is None else angles[:, order], title=title, position_noise=position_noise,
    )  # fmt: skip
    check_plausible(recording)
    return recording


def _check_says_all(**given: Any) -> None:
    """Raise InputError where something is given beside a whole Scene that says it."""
    if said := [key for key, value in given.items() if value is not None]:
        raise InputError(f"says {', '.join(said)} already: leave them out", where="scene")


def _is_table(data: Any) -> bool:
    """Whether it is a DataFrame (of pandas, or one that looks like it)."""
    return hasattr(data, "columns") and hasattr(data, "__getitem__")


def _numbers(values: Any, where: str, unit: str) -> np.ndarray:
    """Numbers as floats, NaN where an array is masked. Raises InputError."""
    try:
        if isinstance(values, np.ma.MaskedArray):
            values = np.ma.filled(values.astype(float), np.nan)
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"should be numbers [{unit}]", where=where) from None


def _of_arrays(t: Any, xy: Any, angle: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Times (T,), places (T, n, 2), angles (T, n) or None. Raises InputError where shapes do not fit."""
    if xy is None:
        raise InputError("t (T,) [s] and xy (T, n, 2) [m] belong together, or give a DataFrame", where="xy")
    t, xy = _numbers(t, "t", "s"), _numbers(xy, "xy", "m")
    if t.ndim != 1 or len(t) == 0:
        raise InputError(f"should have the shape (T,), got {t.shape}", where="t")
    if xy.shape == (len(t), 2):
        xy = xy[:, None]
    if xy.ndim != 3 or xy.shape[0] != len(t) or xy.shape[1] == 0 or xy.shape[2] != 2:
        raise InputError(f"should have the shape (T, n, 2) with T = {len(t)}, got {xy.shape}", where="xy")
    if angle is None:
        return t, xy, None
    angle = _numbers(angle, "angle", "rad")
    angle = angle[:, None] if angle.shape == (len(t),) else angle
    if angle.shape != xy.shape[:2]:
        raise InputError(f"should have the shape (T, n) = {xy.shape[:2]}, got {angle.shape}", where="angle")
    return t, xy, angle


def _of_table(
    table: Any, fps: float | None, scale: float | str | None, flip_y: bool, min_frames: int
) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Times (T,) [s], places (T, n, 2) [m] and names of a table with a row for each particle and frame."""
    columns = set(map(str, table.columns))
    clock = "frame" if "frame" in columns and (fps is not None or "t" not in columns) else "t"
    missing = [key for key in (clock, "particle", "x", "y") if key not in columns]
    if missing:
        raise InputError(
            f"should have the columns frame (or t), particle, x, y; it lacks {', '.join(missing)}"
            + ("" if "particle" not in missing else ": trackpy.link(features, search_range) adds particle"),
            where="table",
        )
    if clock == "frame" and (fps is None or not 0 < fps < math.inf):
        raise InputError(f"a table that counts frames needs the frames per second, got {fps!r}", where="fps")
    if scale is None:
        raise InputError("a table needs metres per pixel: a number, or a text (0.1mm/px); 1 where it is in m",
                         where="scale")  # fmt: skip
    size = factor(scale, LENGTHS, "scale")
    counted = _numbers(table[clock], clock, "s")
    x, y = (_numbers(table[key], key, "px") * size for key in ("x", "y"))
    if not np.isfinite(counted).all():
        raise InputError("should be a finite number in every row", where=f"column {clock}")
    who = [str(int(p)) if isinstance(p, float) and p.is_integer() else str(p) for p in table["particle"].tolist()]
    seen = np.isfinite(x) & np.isfinite(y)
    names, counts = np.unique(np.array(who)[seen], return_counts=True)
    names = names[counts >= min_frames]
    kept = seen & np.isin(who, names)
    if not kept.any():
        raise InputError("no particle is seen" + (f" in {min_frames} frames" if min_frames > 1 else ""), where="table")
    listed = sorted(names.tolist(), key=lambda n: (0, int(n), "") if n.isdigit() else (1, 0, n))
    clocks, row = np.unique(counted[kept], return_inverse=True)
    column = np.array([listed.index(w) for w in np.array(who)[kept]])
    cell, times = np.unique(row * len(listed) + column, return_counts=True)
    if (times > 1).any():
        twice = int(cell[int(np.argmax(times > 1))])
        raise InputError(
            f"particle {listed[twice % len(listed)]} stands twice in {clock} {clocks[twice // len(listed)]:g}",
            where="table",
        )
    xy = np.full((len(clocks), len(listed), 2), np.nan)
    xy[row, column] = np.stack([x[kept], -y[kept] if flip_y else y[kept]], axis=-1)
    return (clocks / fps if clock == "frame" and fps is not None else clocks), xy, listed


# ---- the scene as it is believed -------------------------------------------------------------------


def _each(value: Any, names: Sequence[str], what: str, units: Mapping[str, float]) -> list[float]:
    """One number for each body. Raises InputError naming the body that has none."""
    if value is None:
        raise InputError(
            "is not said: one number for all bodies, one for each, or by name (texts as 5mm and 10g will do)",
            where=what,
        )
    if isinstance(value, Mapping):
        by_name = {str(key): entry for key, entry in value.items()}
        lost = [name for name in names if name not in by_name]
        if lost:
            raise InputError(f"body {lost[0]} has none", where=what)
        found = [by_name[name] for name in names]
    elif isinstance(value, str) or np.ndim(value) == 0:
        found = [value] * len(names)
    else:
        found = list(value)
    if len(found) != len(names):
        raise InputError(f"{len(found)} numbers for {len(names)} bodies", where=what)
    return [measure(v if isinstance(v, str) else float(v), units, "it", what) for v in found]  # type: ignore[arg-type]


def _bodies(names: Sequence[str], radius: Any, mass: Any) -> list[Body]:
    radii, masses = _each(radius, names, "radius", LENGTHS), _each(mass, names, "mass", MASSES)
    return [Body(name, "free", radius=r, mass=m) for name, r, m in zip(names, radii, masses, strict=True)]


def _gravity(gravity: float | Sequence[float] | None) -> tuple[float, float] | None:
    if gravity is None:
        return None
    if isinstance(gravity, int | float) and gravity < 0:
        raise InputError(f"a single number is its size, along -y; give (0, {-abs(gravity):g}) otherwise",
                         where="gravity")  # fmt: skip
    return parse_gravity(gravity)


def _laws(laws: LawLike | Sequence[LawLike]) -> list[LawUse]:
    """Laws put to use, from objects, texts and tables; one may stand for a list. Raises InputError."""
    listed = [laws] if isinstance(laws, LawUse | Law | str | Mapping) else list(laws)
    found = []
    for item in listed:
        if isinstance(item, LawUse):
            found.append(item)
            continue
        if isinstance(item, Law):
            found.append(use(item))
            continue
        if not isinstance(item, str | Mapping):
            raise InputError(f"should be use(...), a text or a table, got {item!r}", where="laws")
        table = parse_law(item) if isinstance(item, str) else dict(item)
        body, bodies = table.pop("body", None), table.pop("bodies", None)
        if "name" not in table:
            raise InputError(f"needs a name, got {item!r}", where="laws")
        found.append(use(table.pop("name"), bodies=bodies if body is None else [body], **table))
    return found


def _table_of(item: LawUse) -> dict[str, Any]:
    """A law as a table of recording.toml, its automatic values left out."""
    who: dict[str, Any] = {}
    if item.bodies is not None:
        who = {"body": item.bodies[0]} if len(item.bodies) == 1 else {"bodies": list(item.bodies)}
    values = {k: list(v) if isinstance(v, tuple) else v for k, v in item.values.items() if v is not AUTOMATIC}
    return {"name": item.name, **who, **values}


def _scene(
    template: str | None,
    bodies: list[Body],
    laws: list[LawUse],
    box: Mapping[str, Any],
    seen: tuple[np.ndarray, np.ndarray, np.ndarray | None],
) -> Scene:
    """The scene of these bodies and laws; a template adds what is believed of such an apparatus."""
    said = {key: list(v) if isinstance(v, tuple) else v for key, v in box.items() if v is not None}
    if template is None:
        gravity = box["gravity"] or (0.0, 0.0)
        return Scene(tuple(bodies), tuple(laws), gravity=gravity, periodic_x=box["periodic_x"])
    if template not in TEMPLATES:
        raise InputError(f"should be a Scene or one of {', '.join(TEMPLATES)}, got {template!r}", where="scene")
    t, xy, angle = seen
    n = len(bodies)
    tracks = Tracks(
        np.repeat(t, n), [b.id for b in bodies] * len(t), xy[..., 0].ravel(), xy[..., 1].ravel(),
        None if angle is None else angle.ravel(),
    )  # fmt: skip
    listed = [{"id": b.id, "role": b.role, "radius": b.radius, "mass": b.mass} for b in bodies]
    filled = TEMPLATES[template].make(tracks, listed, [_table_of(item) for item in laws], said)
    data = {"body": listed, "scene": said, **filled.data}
    data["law"] = [*data.get("law", []), *filled.left_over]
    return scene_from_dict(data)


def _commands(inputs: Mapping[str, ArrayLike], t: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Times [s] and commands of each body, from one a frame or from rows of both. Raises InputError naming the body."""
    found = {}
    for name, series in inputs.items():
        values = _numbers(series, f"inputs of {name}", "1")
        rows = np.column_stack([t, values]) if values.shape == t.shape else values
        if rows.ndim != 2 or rows.shape[1] != 2 or not np.isfinite(rows).all() or not (np.diff(rows[:, 0]) > 0).all():
            raise InputError(
                f"should be (T,) = ({len(t)},) finite commands, or (k, 2) rising times [s] and commands, got the shape "
                f"{values.shape}",
                where=f"inputs of {name}",
            )
        found[name] = rows[:, 0], rows[:, 1]
    return found


def _with_adjustables(scene: Scene, adjustable: Mapping[str, tuple[float, float]]) -> Scene:
    """The scene with these in place of its own adjustables of the same names, and beside the others."""
    own = [_adjustable(key, span) for key, span in adjustable.items()]
    kept = tuple(a for a in scene.adjustable if a.name not in {b.name for b in own})
    return replace(scene, adjustable=(*kept, *own))


def _adjustable(key: str, span: tuple[float, float]) -> Adjustable:
    law, _, parameter = str(key).partition(".")
    try:
        low, high = map(float, span)
    except (TypeError, ValueError):
        raise InputError(f"should be (low, high), got {span!r}", where=f"adjustable {key}") from None
    return Adjustable(law, parameter, low, high)


# ---- diagnose ---------------------------------------------------------------------------------------


def diagnose(
    data: Any,
    xy: ArrayLike | None = None,
    *,
    radius: Each | None = None,
    mass: Each | None = None,
    laws: LawLike | Sequence[LawLike] = (),
    gravity: float | Sequence[float] | None = None,
    names: str | Sequence[str] | None = None,
    scene: Scene | str | None = None,
    hold_out: Any = (),
    out: str | Path | None = None,
    minutes: float | None = None,
    seed: int = 0,
    progress: bool | Callable[[str, float], None] = False,
    criteria: Criteria | None = None,
    **more: Unpack[More],
) -> Result:
    """Find the physics that a scene lacks: hold its simulation against what was recorded.

    Parameters
    ----------
    data : times (T,) [s] with ``xy``, a DataFrame of trackpy's columns, a Recording, a folder, the name of a shipped
        recording; or a list of these, all explained together by one set of missing laws. In a list arrays are pairs
        (t, xy)
    xy : (T, n, 2) [m], see ``make_recording``
    radius, mass, laws, gravity, names, scene : of the bodies in arrays and tables, see ``make_recording``
    hold_out : recordings that are not looked at before the verdict is fixed, in the forms of ``data``
    out : folder for report.html, verdict.json, figures and the revised scene; None: nothing is written
    minutes : time budget;  seed : of the nulls
    progress : True: a line on stderr; or a function of what is being done and the share that is done
    criteria : what decides, where it is not as usual, see ``inference.criteria``
    more : what else ``make_recording`` takes: fps, scale, angle, adjustable, periodic_x, position_noise ...

    Raises InputError for what cannot be used.

    >>> import granswim_pymunk as gs
    >>> gs.diagnose("no such thing")
    Traceback (most recent call last):
    granswim_pymunk.errors.InputError: no such thing: no such folder, and no shipped recording; shipped: ...
    """
    from .inference.entry import ProgressLine
    from .inference.entry import diagnose as explain

    told = {"radius": radius, "mass": mass, "gravity": gravity, "names": names, "scene": scene, "laws": laws or None}
    said: dict[str, Any] = {key: value for key, value in told.items() if value is not None} | dict(more)
    training = [(data, xy)] if xy is not None else _listed(data)
    held = _listed(hold_out) if _given(hold_out) else []
    if not training:
        raise InputError("no recording is given")
    if said and not any(map(_bare, (*training, *held))):
        raise InputError(f"a recording says its own {', '.join(said)}: they belong to arrays and tables")
    stem = said.pop("name", "tracks")
    found = explain(
        _made(training, stem, said), out, hold_out=_made(held, f"{stem}_held_out", said), minutes=minutes, seed=seed,
        progress=ProgressLine() if progress is True else progress or None, criteria=criteria,
    )  # fmt: skip
    return Result(found.verdict, found, out)


def _given(items: Any) -> bool:
    """Whether anything stands there: an empty list does not."""
    return items is not None and not (isinstance(items, list | tuple) and not len(items))


def _bare(item: Any) -> bool:
    """Whether it is a table, or a pair of arrays (t, xy), to which a scene has to be said."""
    if _is_table(item):
        return True
    return isinstance(item, tuple) and len(item) == 2 and not any(isinstance(p, str | Path | Recording) for p in item)


def _listed(data: Any) -> list[Any]:
    """What is to be explained, as a list; one of it may stand for a list. Raises InputError."""
    items = list(data) if isinstance(data, list | tuple) and not _bare(data) else [data]
    for item in items:
        if not _bare(item) and not isinstance(item, str | Path | Recording):
            raise InputError(
                "should be arrays t and xy, a DataFrame, a Recording, a folder, the name of a shipped recording, or a "
                f"list of these, got {type(item).__name__}",
                where="data",
            )
    return items


def _made(items: Sequence[Any], stem: str, said: Mapping[str, Any]) -> list[str | Path | Recording]:
    """Recordings of what is bare, the rest as it is; several are numbered."""
    bare = sum(map(_bare, items))
    made: list[str | Path | Recording] = []
    count = 0
    for item in items:
        if not _bare(item):
            made.append(item)
            continue
        count += 1
        parts = item if isinstance(item, tuple) else (item,)
        made.append(make_recording(*parts, name=stem if bare == 1 else f"{stem}_{count}", **said))
    return made
