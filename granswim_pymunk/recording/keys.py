"""Every key of recording.toml: unit, default, meaning, example. Comments and the page on the format are made of it."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass

from ..laws import all_laws


@dataclass(frozen=True)
class Key:
    """One key. ``table``: "" for the top, "scene", "scene.bed", "body", "law", "adjustable", "wall", "time"."""

    table: str
    name: str
    unit: str
    default: str
    meaning: str
    example: str


KEYS = tuple(
    Key(*row)
    for row in (
        ("", "format", "", "required", "form of this file", '"granswim-recording/2"'),
        ("", "title", "", "empty", "what was recorded", '"swimmer 3, 9 Hz"'),
        ("", "sampling", "Hz", "not known", "nominal frame rate", "500.0"),
        ("", "position_noise", "m", "estimated", "one standard deviation of the camera's own white noise", "2.0e-5"),
        ("", "angle_noise", "rad", "estimated", "one standard deviation of a measured angle", "1.0e-4"),
        ("", "tolerance", "m", "none", "smaller differences beyond noise (rms) do not matter", "1.0e-3"),
        ("", "angle_tolerance", "rad", "none", "the same for angles", "1.0e-2"),
        ("", "time_noise", "s", "none", "error of the time stamps, one standard deviation", "1.0e-4"),
        ("", "radius_error", "1", "none", "relative error of all radii, one standard deviation", "0.02"),
        ("", "mass_error", "1", "none", "relative error of all masses, one standard deviation", "0.02"),
        ("", "bodies", "", "none", "a CSV with the bodies, instead of many [[body]]", '"bodies.csv"'),
        ("", "seed", "", "0", "how a bed that is not listed is packed", "1"),
        ("scene", "gravity", "m/s^2", "[0, 0]", "acceleration of gravity; y points up", "[0.0, -9.81]"),
        ("scene", "periodic_x", "m", "none", "length of the box where it is periodic along x", "0.100"),
        ("scene.bed", "height", "m", "required", "height of the bed", "0.050"),
        ("scene.bed", "packing_fraction", "1", "required", "share of the area that disks cover", "0.80"),
        ("scene.bed", "grain_diameter", "m", "required", "smallest and largest diameter of the grains", "[1e-3, 2e-3]"),
        ("scene.bed", "density", "kg/m^3", "required", "density of the grains, taken as spheres", "1004.0"),
        ("scene.bed", "layers", "1", "0", "layers of grains above that press on the bed", "4"),
        ("body", "id", "", "required", "its name in the tracks", '"bob"'),
        ("body", "role", "", "required", "free, head, tail, grain or wall (walls never move)", '"free"'),
        ("body", "radius", "m", "required", "radius", "1.5e-3"),
        ("body", "mass", "kg", "required", "mass (a wall has none)", "9.94e-5"),
        ("body", "observed", "", "true", "false: it is there, but the camera does not see it", "false"),
        ("body", "initial", "m, m, m/s, m/s", "from the tracks", "x, y, vx, vy at the start", "[0.04, 0.02, 0.0, 0.0]"),
        ("body", "inertia", "kg m^2", "2/5 m r^2", "moment of inertia about its centre", "1.1e-4"),
        ("body", "x", "m", "required for a wall", "where a wall is", "0.05"),
        ("body", "y", "m", "required for a wall", "where a wall is", "0.0"),
        ("wall", "from", "m", "required", "one end of a straight wall", "[0.0, 0.0]"),
        ("wall", "to", "m", "required", "its other end", "[0.3, 0.0]"),
        ("wall", "radius", "m", "0", "half its thickness", "0.0"),
        ("wall", "id", "", "none", "its name", '"left"'),
        ("law", "name", "", "required", "a law that is believed to act (granswim laws lists all)", '"linear_drag"'),
        ("law", "body", "", "all mobile bodies", "the body it acts on", '"bob"'),
        ("law", "bodies", "", "all mobile bodies", "the bodies it acts on", '["a", "b"]'),
        ("adjustable", "law", "", "required", "the law with a number that is not known well", '"pin"'),
        ("adjustable", "parameter", "", "required", "that number: fitted before physics is missed", '"length"'),
        ("adjustable", "low", "", "required", "smallest value that is possible, in its unit", "0.133"),
        ("adjustable", "high", "", "required", "largest value that is possible, in its unit", "0.163"),
        ("adjustable", "per", "", '"all"', "all: shared; body, recording: one for each", '"recording"'),
        ("time", "dt", "s", "resolves the fastest law", "time step", "2.0e-6"),
        ("time", "start", "s", "0", "time at the beginning", "0.0"),
        ("time", "duration", "s", "none", "how long to simulate", "2.0"),
        ("time", "output", "s", "none", "between stored states", "0.01"),
        ("time", "scheme", "", '"exact"', "half_step or exact: how dampings enter a step", '"exact"'),
    )
)  # fmt: skip

FILES = {
    "recording.toml": "what was recorded, and the scene as the experimenter believes it",
    "tracks.csv": "`t,body,x,y[,angle]`: one row for each body and frame, in any order; a body not seen has no row",
    "tracks.npz": "instead of it for many bodies: t (T,), body (n,), xy (T, n, 2), NaN where not seen[, angle (T, n)]",
    "bodies.csv": "`id,role,radius,mass,observed[,inertia][,x,y[,vx,vy]]`, instead of many `[[body]]`",
    "input.csv": "`t,name,value`: commands that were given to the apparatus",
    "curve.csv": "`frequency,layers,speed[,speed_sem,n]`, instead of tracks or beside them",
    "film.mp4": "what the tracks were read from; it is shown, never analysed",
    "film.toml": "where the film lies: `scale` m/px, `left` and `top` m of its first pixel, `rate` Hz, `start` s",
}

_BY_PLACE = {(key.table, key.name): key for key in KEYS}


def comment(table: str, name: str, law: str | None = None) -> str | None:
    """Unit and meaning of a key, None where it is not known; ``law``: the law whose table it stands in."""
    key = _BY_PLACE.get((table, name))
    if key is not None:
        return f"{key.unit}: {key.meaning}" if key.unit and key.unit != "1" else key.meaning
    if table == "law" and law is not None:
        for declared in all_laws().values():
            for parameter in declared.parameters if law in (declared.name, declared.form_of) else ():
                if parameter.name == name:
                    unit = f"{parameter.unit}: " if parameter.unit not in ("", "1") else ""
                    return unit + parameter.meaning
    return None


_TABLE = re.compile(r"\[\[?([\w.]+)\]\]?\s*")
_KEY = re.compile(r"([\w-]+) = (.*)")
_SHORT_LIST = re.compile(r"= \[\n((?: {4}[-+\w.]+,\n){1,6})\]")


def commented(text: str) -> str:
    """recording.toml with unit and meaning behind each value, the first time that it stands there."""
    original = text
    text = _SHORT_LIST.sub(lambda m: "= [" + ", ".join(m[1].replace(",", " ").split()) + "]", text)
    table, law, told, lines = "", None, set(), []
    opened = 0
    for line in text.splitlines():
        if opened == 0 and (match := _TABLE.fullmatch(line)):
            table, law = match[1], None
        match = _KEY.fullmatch(line) if opened == 0 else None
        depth = opened + line.count("[") - line.count("]") if match or opened else 0
        if match:
            name = match[1]
            if table == "law" and name == "name":
                law = match[2].strip('"')
            about = comment(table, name, law)
            place = (table, name, law if table == "law" else None)
            if about and depth == 0 and place not in told:
                told.add(place)
                line = f"{line:<32}  # {about}"
        opened = max(depth, 0)
        lines.append(line)
    result = "\n".join(lines) + "\n"
    if tomllib.loads(result) != tomllib.loads(original):
        return original  # a value with a bracket in a text: better without remarks than changed
    return result


# ---- the page on the format ---------------------------------------------------------------------

_TABLES = {
    "": "At the top",
    "scene": "[scene]",
    "scene.bed": "[scene.bed]: a bed that is not listed body by body",
    "body": "[[body]]: once for each body",
    "wall": "[[wall]]: a straight wall",
    "law": "[[law]]: what is believed to act, once for each law",
    "adjustable": "[[adjustable]]: a number that recalibration may move",
    "time": "[time]: for a scene that is run",
}
_EXAMPLE = """\
format = "granswim-recording/2"
title = "pendulum of 25 cm"
sampling = 60.0
[scene]
gravity = [0.0, -9.81]
[[body]]
id = "bob"
role = "free"
radius = 0.01
mass = 0.05
[[law]]
name = "pin"
body = "bob"
anchor = [0.1, 0.4]
length = 0.25
[[adjustable]]
law = "pin"
parameter = "length"
low = 0.24
high = 0.26
"""


def format_page() -> str:
    """The page on the format, in Markdown."""
    lines = [
        "# The format of a recording",
        "",
        "A recording is a folder. Everything is in SI; y points up; angles are in rad, counter-clockwise. It may come",
        "from a camera, from an imported file, or from a simulation that was filmed: the diagnosis treats all alike.",
        "",
        "| file | what it holds |",
        "|---|---|",
        *(f"| `{name}` | {about} |" for name, about in FILES.items()),
        "",
        "`recording.toml` is needed, and `tracks.csv`, `tracks.npz` or `curve.csv`. In `tracks.csv` x and y may be",
        "empty where only an angle was measured, and along a rail the other coordinate may be. Positions along a",
        "periodic x may be wrapped or unwrapped. The times of tracks and laws are one clock.",
        "",
        "## An example",
        "",
        "```toml",
        commented(_EXAMPLE).rstrip(),
        "```",
        "",
        "## Keys of recording.toml",
        "",
        "Unknown keys are a warning in a recording, and an error in a scene that is run.",
    ]
    for table, title in _TABLES.items():
        lines += ["", f"### {title}", "", "| key | unit | default | meaning | example |", "|---|---|---|---|---|"]
        lines += [
            f"| `{k.name}` | {k.unit} | {k.default} | {k.meaning} | `{k.example}` |" for k in KEYS if k.table == table
        ]
    lines += [
        "",
        "A `[[law]]` has the parameters of its law beside these keys: `granswim laws NAME` lists them with unit,",
        "bounds and meaning. Laws that a scene can have:",
        "",
        "| law | expression | parameters |",
        "|---|---|---|",
    ]
    for law in all_laws().values():
        if law.candidate == "flexible" or law.name.startswith("flexible"):
            continue
        units = {p.name: f" {p.unit}" if p.unit not in ("", "1") else "" for p in law.parameters}
        parameters = ", ".join(f"`{name}`{unit}" for name, unit in units.items())
        lines.append(f"| `{law.name}` | {law.expression.replace('|', chr(92) + '|')} | {parameters} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    print(format_page(), end="")
