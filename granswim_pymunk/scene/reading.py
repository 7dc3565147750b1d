"""Scenes from tables and files, and back: TOML, lists of bodies, commanded series."""

from __future__ import annotations

import csv
import math
import tomllib
import warnings
from collections.abc import Iterable, Mapping, Sequence
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..laws import get_law
from ..laws.base import Parameter
from ..limits import (
    DEEPEST,
    LARGEST_TABLE,
    LARGEST_TOML,
    MOST_BODIES,
    check_keys,
    check_seed,
    ordinary_file,
)  # fmt: skip
from ..walls import KEYS as WALL_KEYS
from ..walls import Wall
from .model import Scene
from .parts import (
    LARGEST_NUMBER,
    SCHEMES,
    Adjustable,
    Bed,
    Body,
    LawUse,
    SceneWarning,
    Time,
    number_of,
    numbers_of,
    too_many,
    use,
)


class _Reader:
    """Reads tables of a TOML file; unknown keys are an error (scene) or a warning (recording)."""

    def __init__(self, file: Any, strict: bool) -> None:
        self.file = file
        self.strict = strict

    def error(self, message: str, where: str | None = None) -> InputError:
        return InputError(message, file=self.file, where=where)

    def unknown(self, keys: Iterable[str], where: str, known: Iterable[str]) -> None:
        for key in keys:
            message = f"unknown key {key!r}; known: {', '.join(sorted(known))}"
            if self.strict:
                raise self.error(message, where)
            warnings.warn(f"{self.file}: {where}: {message}; it is left out", SceneWarning, stacklevel=4)

    def unknown_input(self, name: str) -> None:
        """A command for something that is no body of the scene."""
        message = "is the name of no body of the scene"
        if self.strict:
            raise self.error(message, f"input {name}")
        warnings.warn(f"{self.file}: input {name}: {message}; it is left out", SceneWarning, stacklevel=4)

    def table(self, data: Any, where: str, known: Sequence[str]) -> dict[str, Any]:
        if not isinstance(data, Mapping):
            raise self.error("should be a table", where)
        self.unknown([k for k in data if k not in known], where, known)
        return {k: v for k, v in data.items() if k in known}

    def tables(self, data: Any, where: str) -> list[Any]:
        if not isinstance(data, list):
            raise self.error(f"should be written [[{where}]]", where)
        return data


BODY_KEYS = ("id", "role", "radius", "mass", "observed", "initial", "inertia", "x", "y")


def _read_body(data: Any, reader: _Reader) -> Body:
    if not isinstance(data, Mapping):
        raise reader.error(f"should be a table, got {data!r}", "body")
    where = f"body {data.get('id', '(without id)')}"
    data = reader.table(data, where, BODY_KEYS)
    for key in ("id", "role", "radius"):
        if key not in data:
            raise reader.error(f"needs {key}", where)
    role = data["role"]
    if role != "wall" and "mass" not in data:
        raise reader.error("needs mass [kg]", where)
    initial = data.get("initial")
    if initial is not None:
        initial = numbers_of(initial, 4, "initial", "m, m, m/s, m/s", file=reader.file, where=where)
    elif "x" in data or "y" in data:
        x = number_of(data.get("x"), "x", "m", file=reader.file, where=where)
        y = number_of(data.get("y"), "y", "m", file=reader.file, where=where)
        initial = (x, y, 0.0, 0.0)
    elif role == "wall":
        raise reader.error("a wall needs x and y [m]", where)
    observed = data.get("observed", True)
    if not isinstance(observed, bool):
        raise reader.error(f"observed should be true or false, got {observed!r}", where)
    try:
        return Body(
            id=str(data["id"]),
            role=role,
            radius=data["radius"],
            mass=data.get("mass", 1.0),
            observed=observed,
            initial=initial,
            inertia=data.get("inertia"),
        )
    except InputError as error:
        raise InputError(error.message, file=reader.file, where=error.where) from None


def _read_bodies_csv(path: Path, reader: _Reader) -> list[Body]:
    """``id,role,radius,mass,observed[,inertia][,x,y[,vx,vy]]``, empty where not given."""
    known = ("id", "role", "radius", "mass", "observed", "inertia", "x", "y", "vx", "vy")
    try:
        with ordinary_file(path, LARGEST_TABLE).open(newline="", encoding="utf-8-sig") as handle:
            rows = list(islice(csv.DictReader(handle), MOST_BODIES + 1))
    except OSError as error:
        raise InputError(f"cannot read it: {error.strerror}", file=path) from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"is not a CSV in UTF-8: {error}", file=path) from None
    if len(rows) > MOST_BODIES:
        raise InputError(f"has more than {MOST_BODIES} bodies; so many cannot be computed", file=path)
    bodies = []
    inner = _Reader(path, reader.strict)
    for line, row in enumerate(rows, start=2):
        where = f"row {line}"
        if None in row or None in row.values():
            raise inner.error("has another number of columns than the header", where)
        inner.unknown([k for k in row if k not in known], where, known) if line == 2 else None
        data: dict[str, Any] = {}
        for key, text in row.items():
            text = (text or "").strip()
            if key not in known or text == "":
                continue
            if key in ("id", "role"):
                data[key] = text
            elif key == "observed":
                if text.lower() not in ("true", "false", "1", "0"):
                    raise inner.error(f"observed should be true or false, got {text!r}", where)
                data[key] = text.lower() in ("true", "1")
            else:
                try:
                    data[key] = float(text)
                except ValueError:
                    raise inner.error(f"{key} should be a number, got {text!r}", where) from None
        if "vx" in data or "vy" in data:
            data["initial"] = [data.pop("x", None), data.pop("y", None), data.pop("vx", None), data.pop("vy", None)]
        bodies.append(_read_body(data, inner))
    return bodies


def _read_law(data: Any, reader: _Reader) -> LawUse:
    if not isinstance(data, Mapping) or "name" not in data:
        raise reader.error("needs a name", "law")
    name = str(data["name"])
    given = [key for key in data if key not in ("name", "body", "bodies")]
    declared = get_law(name, given=given, file=reader.file)
    bodies: Any = data.get("bodies")
    if "body" in data:
        bodies = [data["body"]]
    if bodies is not None and (isinstance(bodies, str) or not isinstance(bodies, Sequence)):
        raise reader.error("bodies should be a list of ids", f"law {name}")
    values = {k: v for k, v in data.items() if k not in ("name", "body", "bodies")}
    known = [p.name for p in declared.parameters]
    reader.unknown([k for k in values if k not in known], f"law {name}", known)
    values = {k: (tuple(v) if isinstance(v, list) else v) for k, v in values.items() if k in known}
    return LawUse(
        declared, declared.check(values, file=reader.file), None if bodies is None else tuple(map(str, bodies))
    )


def _read_adjustable(data: Any, reader: _Reader, laws: Sequence[LawUse]) -> Adjustable:
    where = "adjustable"
    data = reader.table(data, where, ("law", "parameter", "low", "high", "per"))
    for key in ("law", "parameter", "low", "high"):
        if key not in data:
            raise reader.error(f"needs {key}", where)
    name = f"{data['law']}.{data['parameter']}"
    where = f"adjustable {name}"
    per = data.get("per", "all")
    if per not in ("all", "body", "recording"):
        raise reader.error(f'per should be "body" or "recording", got {per!r}', where)
    return Adjustable(
        law=str(data["law"]),
        parameter=str(data["parameter"]),
        low=number_of(data["low"], "low", "as the parameter", file=reader.file, where=where),
        high=number_of(data["high"], "high", "as the parameter", file=reader.file, where=where),
        per=per,
    )


SCENE_KEYS = (
    "format", "title", "seed", "scene", "time", "camera", "frames", "input", "bodies", "body", "wall", "law",
    "adjustable", "swimmer",
)  # fmt: skip


def _read_bed(given: Any, reader: _Reader) -> Bed:
    where, file = "scene.bed", reader.file
    table = reader.table(given, where, ("height", "packing_fraction", "grain_diameter", "density", "layers"))
    for key in ("height", "packing_fraction", "grain_diameter", "density"):
        if key not in table:
            raise reader.error(f"needs {key}", where)
    low, high = numbers_of(table["grain_diameter"], 2, "grain_diameter", "m", file=file, where=where)
    if not 0 < low <= high:
        raise reader.error(f"grain_diameter should be [low, high] above zero, got [{low}, {high}]", where)
    fraction = number_of(table["packing_fraction"], "packing_fraction", "1", file=file, where=where)
    if not 0 < fraction <= 0.9:
        raise reader.error(f"packing_fraction should lie between 0 and 0.9, got {fraction:g}", where)
    return Bed(
        height=number_of(table["height"], "height", "m", file=file, where=where, positive=True),
        packing_fraction=fraction,
        grain_diameter=(low, high),
        density=number_of(table["density"], "density", "kg/m^3", file=file, where=where, positive=True),
        layers=number_of(table.get("layers", 0.0), "layers", "1", file=file, where=where),
    )


def scene_from_dict(
    data: Mapping[str, Any], *, file: str | Path | None = None, strict: bool = True, extra: Sequence[str] = ()
) -> Scene:
    """Build a scene from what stands in a TOML file.

    ``strict``: unknown keys are an error (a scene to be run) rather than a warning (a recording).
    ``extra``: further top-level keys that the caller reads itself.
    Raises InputError naming file, table and key.
    """
    reader = _Reader(file, strict)
    folder = Path(file).parent if file is not None else Path(".")
    reader.unknown([k for k in data if k not in SCENE_KEYS and k not in extra], "top level", SCENE_KEYS)

    box = reader.table(data.get("scene", {}), "scene", ("gravity", "periodic_x", "bed"))
    gravity = numbers_of(box.get("gravity", [0.0, 0.0]), 2, "gravity", "m/s^2", file=file, where="scene")
    periodic_x = box.get("periodic_x")
    if periodic_x is not None:
        periodic_x = number_of(periodic_x, "periodic_x", "m", file=file, where="scene", positive=True)
    bed = _read_bed(box["bed"], reader) if "bed" in box else None

    bodies = [_read_body(item, reader) for item in reader.tables(data.get("body", []), "body")]
    if "bodies" in data:
        if not isinstance(data["bodies"], str):
            raise reader.error("should name a file", "bodies")
        bodies += _read_bodies_csv(folder / data["bodies"], reader)
    if "swimmer" in data:
        bodies = _read_swimmer(data["swimmer"], reader) + bodies
    if not bodies:
        raise reader.error("has no bodies: write [[body]], or bodies = FILE.csv")

    walls = [_read_wall(item, reader) for item in reader.tables(data.get("wall", []), "wall")]
    laws = [_read_law(item, reader) for item in reader.tables(data.get("law", []), "law")]
    adjustable = [
        _read_adjustable(item, reader, laws) for item in reader.tables(data.get("adjustable", []), "adjustable")
    ]

    time = reader.table(data.get("time", {}), "time", ("dt", "start", "duration", "output", "scheme"))
    scheme = time.pop("scheme", SCHEMES[0])
    numbers = {
        key: number_of(value, key, "s", file=file, where="time", positive=key != "start") for key, value in time.items()
    }
    inputs = _read_input(data.get("input", {}), reader, folder)
    for key in [key for key in inputs if not any(body.id == key for body in bodies)]:
        reader.unknown_input(key)
        del inputs[key]
    seed = data.get("seed", 0)
    if not isinstance(seed, int):
        raise reader.error(f"should be a whole number from 0 to 2^63 - 1, got {seed!r}", "seed")
    check_seed(seed)
    for key in ("camera", "frames"):
        if not isinstance(data.get(key, {}), Mapping):
            raise reader.error("should be a table", key)
    try:
        return Scene(
            bodies=tuple(bodies),
            laws=tuple(laws),
            gravity=(gravity[0], gravity[1]),
            periodic_x=periodic_x,
            bed=bed,
            adjustable=tuple(adjustable),
            time=Time(**numbers, scheme=scheme),
            inputs=inputs,
            camera=dict(data.get("camera", {})),
            frames=dict(data.get("frames", {})),
            seed=seed,
            title=str(data.get("title", "")),
            walls=tuple(walls),
        )
    except InputError as error:
        raise InputError(error.message, file=file, where=error.where) from None


def _read_wall(data: Any, reader: _Reader) -> Wall:
    where = f"wall {data['id']}" if isinstance(data, Mapping) and "id" in data else "wall"
    data = reader.table(data, where, WALL_KEYS)
    for key in ("from", "to"):
        if key not in data:
            raise reader.error(f"needs {key} = [x, y] [m]", where)
    try:
        return Wall(data["from"], data["to"], data.get("radius", 0.0), str(data.get("id", "")))
    except InputError as error:
        raise InputError(error.message, file=reader.file, where=error.where) from None


def _read_input(data: Any, reader: _Reader, folder: Path) -> dict[str, tuple[tuple[float, ...], tuple[float, ...]]]:
    """``[input.BODY]`` with the lists t and value, or the name of a CSV."""
    if isinstance(data, str):
        return read_inputs(folder / data)
    if not isinstance(data, Mapping):
        raise reader.error("should be a table, or name a file", "input")
    inputs = {}
    for key, table in data.items():
        try:
            t, value = (tuple(map(float, table[name])) for name in ("t", "value"))
        except (KeyError, TypeError, ValueError):
            raise reader.error("needs two lists of numbers, t and value", f"input.{key}") from None
        if len(t) != len(value) or not t:
            raise reader.error(f"t has {len(t)} numbers and value {len(value)}", f"input.{key}")
        if not all(map(math.isfinite, (*t, *value))) or any(b <= a for a, b in pairwise(t)):
            raise reader.error("numbers should be finite and t should rise", f"input.{key}")
        inputs[key] = (t, value)
    return inputs


def _read_swimmer(data: Any, reader: _Reader) -> list[Body]:
    """``[swimmer]``: disks, radius, density, head_mass_factor, head = [x, y]; straight along +x."""
    table = reader.table(data, "swimmer", ("disks", "radius", "density", "head_mass_factor", "head"))
    try:
        return swimmer(**table)
    except (TypeError, InputError) as error:
        raise reader.error(str(error), "swimmer") from None


def swimmer(
    *,
    disks: int = 7,
    radius: float = 1.5e-3,
    density: float = 1004.0,
    head_mass_factor: float = 7.0,
    head: Sequence[float] = (0.0, 0.0),
) -> list[Body]:
    """The bodies of a straight swimmer at rest, head first, lying along +x from its head.

    Masses are those of spheres, rho 4/3 pi r^3; the head has ``head_mass_factor`` times that.
    """
    if isinstance(disks, bool) or not isinstance(disks, int) or not 1 <= disks:
        raise InputError(f"disks should be a whole number above zero, got {disks!r}")
    if disks > MOST_BODIES:
        raise too_many(disks)
    for name, value, unit in (("radius", radius, "m"), ("density", density, "kg/m^3"),
                              ("head_mass_factor", head_mass_factor, "1")):  # fmt: skip
        number_of(value, name, unit, file=None, where=None, positive=True)
    head = numbers_of(head, 2, "head", "m", file=None, where=None)
    mass = density * 4 / 3 * math.pi * radius**3
    return [
        Body(
            id=str(i),
            role="head" if i == 0 else "tail",
            radius=radius,
            mass=mass * (head_mass_factor if i == 0 else 1.0),
            initial=(float(head[0]) + 2 * radius * i, float(head[1]), 0.0, 0.0),
        )
        for i in range(disks)
    ]


def read_inputs(path: str | Path) -> dict[str, tuple[tuple[float, ...], tuple[float, ...]]]:
    """Read ``input.csv`` (t,name,value): commands given to the apparatus. Raises InputError with the row."""
    path = Path(path)
    series: dict[str, list[tuple[float, float]]] = {}
    try:
        with ordinary_file(path, LARGEST_TABLE).open(newline="", encoding="utf-8-sig") as handle:
            rows = csv.reader(handle)
            header = [c.strip() for c in next(rows, [])]
            if sorted(header) != ["name", "t", "value"]:
                raise InputError(f"header should be t,name,value, got {','.join(header)}", file=path)
            at = {name: header.index(name) for name in header}
            for line, row in enumerate(rows, start=2):
                if not row:
                    continue
                try:
                    t, value = float(row[at["t"]]), float(row[at["value"]])
                    name = row[at["name"]].strip()
                except (ValueError, IndexError):
                    raise InputError(
                        f"expected a time, a name and a number, got {','.join(row)}", file=path, where=f"row {line}"
                    ) from None
                if not (math.isfinite(t) and math.isfinite(value)):
                    raise InputError("a number is not finite", file=path, where=f"row {line}")
                series.setdefault(name, []).append((t, value))
    except OSError as error:
        raise InputError(f"cannot read it: {error.strerror}", file=path) from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"is not a CSV in UTF-8: {error}", file=path) from None
    result = {}
    for name, pairs in series.items():
        pairs.sort()
        times = tuple(p[0] for p in pairs)
        if any(b <= a for a, b in pairwise(times)):
            raise InputError("two rows for one time", file=path, where=f"input {name}")
        result[name] = (times, tuple(p[1] for p in pairs))
    return result


def read_toml(path: str | Path) -> dict[str, Any]:
    """Read a TOML file; InputError names file and line, or the key of an absurd number."""
    path = Path(path)
    try:
        text = ordinary_file(path, LARGEST_TOML).read_bytes().decode("utf-8-sig")
        check_keys(text, path)
        data = tomllib.loads(text)
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"cannot read it: {error.strerror}", file=path) from None
    except UnicodeDecodeError:
        raise InputError("is not a text in UTF-8", file=path) from None
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError(f"is not valid TOML: {error}", file=path) from None
    except ValueError:  # Python refuses to convert so many digits
        raise InputError("is not valid TOML: an integer has thousands of digits", file=path) from None
    _check_numbers(data, path)
    return data


def _check_numbers(data: Mapping[str, Any], file: Path) -> None:
    """Refuse numbers that no float holds or no experiment gives before anything computes with them, or prints them.

    Very deep tables too: whatever walks through them would be stopped by Python itself.
    """
    waiting: list[tuple[Any, str, int]] = [(data, "", 0)]
    while waiting:
        value, key, depth = waiting.pop()
        if depth > DEEPEST:
            raise InputError(f"is nested deeper than {DEEPEST}", file=file, where=key.split(".")[0])
        if isinstance(value, Mapping):
            waiting += [(item, f"{key}.{name}" if key else str(name), depth + 1) for name, item in value.items()]
        elif isinstance(value, list):
            waiting += [(item, key, depth + 1) for item in value if isinstance(item, int | float | list | Mapping)]
        elif isinstance(value, int | float) and not isinstance(value, bool) and abs(value) > LARGEST_NUMBER:
            raise InputError("is absurdly large", file=file, where=key)


def read_scene(path: str | Path) -> Scene:
    """Read a scene to be run from TOML. Unknown keys are an error."""
    scene = scene_from_dict(read_toml(path), file=path, strict=True)
    scene.check_overlaps()
    return scene


def write_scene(scene: Scene, path: str | Path) -> None:
    """Write a scene as TOML; ``read_scene`` gives back an equal one (same hash)."""
    Path(path).write_text(scene.to_toml(), encoding="utf-8")


__all__ = [
    "Adjustable", "Bed", "Body", "LawUse", "Parameter", "Scene", "SceneWarning", "Time", "Wall", "read_inputs",
    "read_scene", "read_toml", "scene_from_dict", "swimmer", "use", "write_scene",
]  # fmt: skip
