"""Nonsense for every door of the program: recordings, scenes, foreign tables, beds, checkpoints, options.

Each function writes an input with one to three things wrong with it below a folder and returns what to do with it.
"""

from __future__ import annotations

import functools
import importlib
import io
import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

Files = dict[str, bytes]
Action = Callable[[], Any]

VALUES = (
    b"nan", b"inf", b"-inf", b"1e999", b"-1e308", b"1e-320", b"0", b"-0.0", b"", b"''", b"true", b"[]", b"{}",
    b"1e5000", b"9" * 400, b"0x1F", b"1_000", b"12:30", b"\xff\xfe", b"\xc3\x28", b"\x00", "½".encode(),
    b"[[body]]", b"\"", b"#",
    b"1979-05-27", b"\"a\\nb\"", b"-1", b"1e300", b"[1, 2", b"../../etc/passwd", b"'''",
    b"1000000000", b"2.5", b"1e9", b"1e-9", b"1e-300", b"18446744073709551616", b"\"\\u0000\"", b"\"$\\\\frac{$\"",
    b"1" + b".a" * 200, b"\"/dev/zero\"", b"[[[[[[[[[[1]]]]]]]]]]", b"x" * 5000, b"{a = {a = {a = 1}}}", b"3",
)  # fmt: skip
WORDS = (
    "nan", "inf", "-inf", "-1", "0", "1e300", "1e-300", "1e999", "", "x", "1000000000000", "2.5", "1e9", "-0.0",
    "18446744073709551616", "\udcff", "a\nb", "--", "-", "../..", "/dev/null", "/dev/zero", "1,2", "1:2:0", "9" * 5000,
    "$\\frac{$", "None", "true", "1:8", "a=b", "0,0,0", "*:1:1", "a:1", "utf-9", "verlet", "none", "gravity",
)  # fmt: skip

CART = b"""format = "granswim-recording/2"
title = "cart"
sampling = 10.0
position_noise = 1e-4
tolerance = 1e-4
time_noise = 1e-5
radius_error = 0.01
bodies = "bodies.csv"
[scene]
gravity = [0.0, -9.81]
[[law]]
name = "rail"
bodies = ["cart"]
direction = [1.0, 0.0]
[[law]]
name = "drive"
body = "cart"
gain = 0.5
[[law]]
name = "linear_drag"
bodies = ["ball"]
c = 0.01
[[adjustable]]
law = "linear_drag"
parameter = "c"
low = 0.0
high = 0.1
per = "body"
"""
SCENE = b"""title = "all sorts"
seed = 3
[scene]
gravity = [0.0, -9.81]
periodic_x = 0.04
[scene.bed]
height = 0.012
packing_fraction = 0.7
grain_diameter = [1e-3, 2e-3]
density = 1004.0
layers = 1.0
[swimmer]
disks = 4
radius = 1e-3
density = 1004.0
head_mass_factor = 7.0
head = [0.011, 0.006]
[[law]]
name = "contact_linear"
stiffness = 2.2e3
damping = 1.0e4
[[law]]
name = "union"
stiffness = 1.0e3
damping = 1.0e3
[[law]]
name = "bending"
stiffness = 2.0e-3
damping = 1.0e2
amplitude = 0.78
frequency = 9.0
[time]
dt = 2.0e-6
duration = 2.0e-5
start = 0.0
output = 1.0e-5
[camera]
scale = 1.0
[frames]
count = 3
width = 300
"""
INPUT_SCENE = b"""title = "driven"
[[body]]
id = "a"
role = "free"
radius = 0.01
mass = 0.1
inertia = 1e-5
initial = [0.0, 0.0, 0.0, 0.0]
[[body]]
id = "w"
role = "wall"
radius = 0.01
x = 0.5
y = 0.0
[[law]]
name = "drive"
body = "a"
[[law]]
name = "rail"
body = "a"
direction = [1.0, 0.0]
[input.a]
t = [0.0, 0.5, 1.0]
value = [0.0, 0.1, 0.2]
[time]
duration = 0.01
"""


# ---- spoiling ---------------------------------------------------------------------------------


def spoil(content: bytes, rng: np.random.Generator) -> bytes:
    """A text or anything else with one thing wrong with it."""
    lines = content.splitlines(keepends=True)
    at = int(rng.integers(max(len(lines), 1)))
    value = VALUES[int(rng.integers(len(VALUES)))]
    kind = int(rng.integers(13))
    if kind == 0:
        return content[: int(rng.integers(len(content) + 1))]
    if kind == 1:
        return b"".join(lines[k] for k in rng.permutation(len(lines)))
    if kind == 2 and content:
        spoilt = bytearray(content)
        for k in rng.integers(len(spoilt), size=int(rng.integers(1, 20))):
            spoilt[k] = int(rng.integers(256))
        return bytes(spoilt)
    if kind in (3, 4, 5, 11, 12) and lines:
        mark = b"," if b"," in lines[at] and b"=" not in lines[at] else b"="
        parts = lines[at].split(mark)
        parts[-1 if kind > 10 else int(rng.integers(len(parts)))] = value
        lines[at] = mark.join(parts).rstrip(b"\r\n") + b"\n"
        return b"".join(lines)
    if kind == 6 and lines:
        return b"".join(lines[:at] + lines[at : at + 1] * int(rng.integers(2, 50)) + lines[at:])
    if kind == 7 and lines:
        return b"".join(lines[:at] + lines[at + 1 :])
    if kind == 8:
        return content + value[:100] * int(rng.integers(1, 20_000))
    if kind == 9:
        return rng.bytes(int(rng.integers(2000)))
    return b"\xef\xbb\xbf" + content.replace(b"\n", b"\r" if rng.random() < 0.5 else b"\r\n")


def spoil_arrays(content: bytes, rng: np.random.Generator) -> bytes:
    """An NPZ with one thing wrong inside: a value, a shape, a type, a member too few."""
    with np.load(io.BytesIO(content)) as loaded:
        data = {name: loaded[name] for name in loaded.files}
    name = sorted(data)[int(rng.integers(len(data)))]
    array = data[name].copy()
    kind = int(rng.integers(8))
    if kind == 0:
        del data[name]
    elif kind == 1:
        data[name] = array[..., None] if rng.random() < 0.5 else array.reshape(-1)
    elif kind == 2:
        data[name] = array[: int(rng.integers(len(array) + 1))] if array.ndim else np.array([])
    elif kind == 3 and array.dtype.kind == "f" and array.size:
        array.reshape(-1)[int(rng.integers(array.size))] = rng.choice([np.nan, np.inf, 1e300, -1.0, 0.0, 1e-300])
        data[name] = array
    elif kind == 4 and array.dtype.kind == "f":
        data[name] = array * rng.choice([1e300, 1e-300, -1.0, 0.0, np.nan, 1e3])
    elif kind == 5:
        kinds = ["U3", "complex128", "int8", "bool", "S2", "datetime64[s]"]
        try:
            data[name] = array.astype(kinds[int(rng.integers(len(kinds)))])
        except (ValueError, TypeError):
            data[name] = np.array(["x"])
    elif kind == 6:
        data[f"after_{rng.choice(['0', '-1', '99999999999999999999', 'x', '1e3'])}"] = array
    else:
        data[name] = np.array(rng.choice(["", "x", "nan"]))
    buffer = io.BytesIO()
    with np.errstate(all="ignore"):
        np.savez(buffer, **data)
    return buffer.getvalue()


def spoil_archive(content: bytes, rng: np.random.Generator) -> bytes:
    """An NPZ whose members are no arrays, or not those that it says; or the bytes of it spoilt."""
    if rng.random() < 0.6:
        return spoil_arrays(content, rng)
    if rng.random() < 0.5:
        return spoil(content, rng)
    buffer = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as source, zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as target:
        for item in source.namelist():
            member = source.read(item)
            target.writestr(item, spoil(member, rng) if rng.random() < 0.5 else member)
    return buffer.getvalue()


def spoil_some(files: Files, rng: np.random.Generator) -> Files:
    """Files of which one to three have something wrong with them, or are not there."""
    files = dict(files)
    for _ in range(int(rng.choice([1, 1, 1, 2, 3]))):
        if not files:
            break
        name = sorted(files)[int(rng.integers(len(files)))]
        try:
            wrong = spoil_archive if name.endswith(".npz") else spoil
            files[name] = wrong(files[name], rng)
        except Exception:  # an archive that was spoilt before
            files[name] = spoil(files[name], rng)
        if rng.random() < 0.03:
            del files[name]
    return files


def write(files: Files, place: Path) -> None:
    place.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        (place / name).write_bytes(content)


# ---- recordings -------------------------------------------------------------------------------


@functools.cache
def seeds() -> tuple[Files, ...]:
    """The small recordings that come with the package, their tables cut to 40 rows, and one with every file."""
    root = importlib.import_module("granswim_pymunk.recordings").__path__
    found = []
    for toml in sorted(p for folder in root for p in Path(folder).rglob("recording.toml")):
        files = {p.name: p.read_bytes() for p in sorted(toml.parent.iterdir()) if p.is_file()}
        if sum(len(f) for f in files.values()) > 300_000:
            continue
        found.append(_shortened(files))
    return (*found, _cart(npz=False), _cart(npz=True))


def _shortened(files: Files, rows: int = 40) -> Files:
    return {
        name: b"".join(content.splitlines(keepends=True)[: rows + 1]) if name == "tracks.csv" else content
        for name, content in files.items()
    }


def _cart(*, npz: bool) -> Files:
    """A driven cart on a rail, seen along it alone, and a ball: bodies.csv, input.csv, curve.csv, CSV or NPZ."""
    t = np.arange(12) / 10
    ball = np.stack([0.5 + 0.1 * t, 5 - 4.9 * t**2], axis=-1)
    cart = np.stack([0.05 * t, np.full(12, np.nan)], axis=-1)
    files = {
        "recording.toml": CART,
        "bodies.csv": b"id,role,radius,mass,observed,x,y,vx,vy,inertia\ncart,free,0.02,0.3,true,0,0,0,0,1e-4\n"
        b"ball,free,0.02,0.1,true,,,,,\nw,wall,0.02,,,3,0,,,\n",
        "input.csv": b"t,name,value\n" + b"".join(b"%g,cart,0.1\n" % s for s in t),
        "curve.csv": b"frequency,layers,speed,speed_sem,n\n4,0,0.1,0.01,3\n9,0,0.2,,3\n",
    }
    if npz:
        buffer = io.BytesIO()
        np.savez(buffer, t=t, body=np.array(["cart", "ball"]), xy=np.stack([cart, ball], axis=1))
        return files | {"tracks.npz": buffer.getvalue()}
    rows = [b"%g,cart,%g," % (s, x) for s, x in zip(t, cart[:, 0], strict=True)]
    rows += [b"%g,ball,%g,%g" % (s, *xy) for s, xy in zip(t, ball, strict=True)]
    return files | {"tracks.csv": b"t,body,x,y\n" + b"\n".join(rows) + b"\n"}


def nonsense(rng: np.random.Generator) -> Files:
    """A recording with one to three things wrong with it."""
    kept = seeds()
    return spoil_some(kept[int(rng.integers(len(kept)))], rng)


def recording(rng: np.random.Generator, place: Path) -> Action:
    from granswim_pymunk.recording import read_recording

    write(nonsense(rng), place / "recording")
    return lambda: read_recording(place / "recording")


# ---- scenes -----------------------------------------------------------------------------------


@functools.cache
def scene_seeds() -> tuple[bytes, ...]:
    """Scenes that come with the package, without the large beds, and two of all sorts."""
    root = importlib.import_module("granswim_pymunk.scenarios").__path__
    texts = [p.read_bytes() for folder in root for p in sorted(Path(folder).glob("*.toml"))]
    return (*(t for t in texts if b"[scene.bed]" not in t), SCENE, SCENE, INPUT_SCENE)


def scene(rng: np.random.Generator, place: Path) -> Action:
    """Read, packed if that is little work, planned, and a few steps of it."""
    from granswim_pymunk.engine import Simulation
    from granswim_pymunk.run import run_scene
    from granswim_pymunk.scene import read_scene

    kept = scene_seeds()
    files = spoil_some({"scene.toml": kept[int(rng.integers(len(kept)))]}, rng)
    write(files, place)

    def act() -> None:
        found = read_scene(place / "scene.toml")
        if found.bed is None:
            Simulation(found).advance(3)
        run_scene(found, place / "out", quiet=True, cache=False)

    return act


# ---- foreign tables ---------------------------------------------------------------------------


@functools.cache
def table_seeds() -> tuple[tuple[str, bytes], ...]:
    """Small tables as trackers and codes write them: (name of the file, content)."""
    t = [k / 10 for k in range(12)]
    xy = [(10 + k, 50 - 0.5 * k) for k in range(12)]
    seen = [(s, x, y) for s, (x, y) in zip(t, xy, strict=True)]
    long = "t,body,x,y,angle\n" + "".join(f"{s},a,{x},{y},0.1\n{s},b,{x + 30},{y},\n" for s, x, y in seen)
    wide = "t;x1;y1;x2;y2\n" + "".join(f"{s};{x};{y};{x + 30};{y}\n" for s, x, y in seen).replace(".", ",")
    trackpy = "y,x,mass,size,ecc,signal,raw_mass,ep,frame,particle\n" + "".join(
        f"{y},{x},900,3,0.1,20,1200,0.05,{k},0\n" for k, (x, y) in enumerate(xy)
    )
    poses = "scorer,net,net,net\nbodyparts,nose,nose,nose\ncoords,x,y,likelihood\n" + "".join(
        f"{k},{x},{y},0.99\n" for k, (x, y) in enumerate(xy)
    )
    xyz = "".join(
        f'2\nLattice="100 0 0 0 100 0 0 0 1" Properties=species:S:1:pos:R:3 Time={s}\nA {x} {y} 0\nB {x + 30} {y} 0\n'
        for s, x, y in seen
    )
    lammps = "".join(
        f"ITEM: TIMESTEP\n{100 * k}\nITEM: NUMBER OF ATOMS\n2\nITEM: BOX BOUNDS pp ff pp\n0 100\n0 100\n-1 1\n"
        f"ITEM: ATOMS id type x y vx vy\n1 1 {x} {y} 0 0\n2 1 {x + 30} {y} 0 0\n"
        for k, (x, y) in enumerate(xy)
    )
    spots = '<?xml version="1.0" encoding="UTF-8"?>\n'
    spots += '<Tracks nTracks="1" spaceUnits="pixel" frameInterval="0.1" timeUnits="sec">\n<particle nSpots="12">\n'
    spots += "".join(f'<detection t="{k}" x="{x}" y="{y}" z="0" />\n' for k, (x, y) in enumerate(xy))
    spots += "</particle>\n</Tracks>\n"
    texts = {
        "long.csv": long, "wide.csv": wide, "tracks.csv": trackpy, "poses.csv": poses, "run.xyz": xyz,
        "dump.lammpstrj": lammps, "spots.xml": spots,
    }  # fmt: skip
    return (*((name, text.encode()) for name, text in texts.items()), ("run.h5", _h5md()))


def _h5md() -> bytes:
    import h5py

    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        file.create_group("h5md").attrs["version"] = [1, 1]
        position = file.create_group("particles/all/position")
        position["value"] = np.cumsum(np.ones((8, 2, 2)), axis=0)
        position["step"] = np.arange(8)
        position["time"] = np.arange(8) / 10
    return buffer.getvalue()


IMPORT_OPTIONS = (
    "--unit", "--time-unit", "--fps", "--angle-unit", "--flip-y", "--columns", "--missing", "--delimiter", "--decimal",
    "--skip-rows", "--encoding", "--table", "--likelihood", "--min-frames", "--sampling", "--position-noise",
    "--angle-noise", "--title", "--body", "--law", "--gravity", "--scene", "--format",
)  # fmt: skip


def foreign(rng: np.random.Generator, place: Path) -> Action:
    """A spoilt table, with options that make sense of a good one."""
    kept = table_seeds()
    name, content = kept[int(rng.integers(len(kept)))]
    if rng.random() < 0.9:
        for _ in range(int(rng.integers(1, 3))):
            content = spoil(content, rng)
    write({name: content}, place)
    argv = ["import", str(place / name), "--out", str(place / "out"), "--body=*:5mm:10g", "--unit=1mm", "--fps=10"]
    if rng.random() < 0.3:
        argv.append(f"{IMPORT_OPTIONS[int(rng.integers(len(IMPORT_OPTIONS)))]}={_word(rng)}")
    return lambda: command(argv)


# ---- beds of another code, checkpoints ----------------------------------------------------------


BED = b"""title = "three grains and a wall"
[scene]
gravity = [0.0, -9.81]
periodic_x = 0.1
[[law]]
name = "contact_linear"
stiffness = 100.0
damping = 10.0
[time]
dt = 1e-4
steps = [2, 4]
"""


@functools.cache
def bed_seed() -> Files:
    """A bed of three grains and a wall as another code stores it, before and after 2 and 4 steps."""
    start = np.array([[0.02, 0.02, 0.1, 0], [0.041, 0.02, 0, 0], [0.06, 0.02, 0, 0], [0.05, 0, 0, 0]])
    later = {f"after_{n}": start + n * 1e-4 * np.array([1, 0, 0, 0]) * start[:, 2:3] for n in (2, 4)}
    buffer = io.BytesIO()
    np.savez(
        buffer, role=np.array(["grain"] * 3 + ["wall"]), radius=np.full(4, 0.01), mass=np.full(4, 0.01),
        id=np.array(["a", "b", "c", "w"]), start=start, **later,
    )  # fmt: skip
    return {"bed.npz": buffer.getvalue(), "bed.toml": BED}


@functools.cache
def checkpoint_seed() -> bytes:
    """A checkpoint of a small run with a random generator."""
    import tempfile

    from granswim_pymunk.engine import Simulation
    from granswim_pymunk.engine.checkpoint import save_checkpoint
    from granswim_pymunk.run import find_scene
    from granswim_pymunk.scene import read_scene

    sim = Simulation(read_scene(find_scene("two_disks")))
    sim.advance(5)
    note = {
        "total": 100, "frames": 3, "color": "speed", "video": "none", "max_overlap": None,
        "view": {"top": None, "view": None, "width": 300},
    }  # fmt: skip
    with tempfile.TemporaryDirectory() as own:
        path = Path(own) / "checkpoint.npz"
        save_checkpoint(sim, path, np.random.default_rng(0), note)
        return path.read_bytes()


def checkpoint(rng: np.random.Generator, place: Path) -> Action:
    """Spoilt bytes or arrays; or a note that makes no sense, with a sum that fits it."""
    from granswim_pymunk.engine.checkpoint import FIELDS, _digest

    content = checkpoint_seed()
    if rng.random() < 0.5:
        content = spoil_some({"checkpoint.npz": content}, rng).get("checkpoint.npz", b"")
    else:
        with np.load(io.BytesIO(content)) as archive:
            data = {name: archive[name] for name in archive.files}
        about = _spoil_tree(json.loads(str(data["about"])), rng)
        data["about"] = np.array(json.dumps(about))
        data["sum"] = np.array(_digest(str(data["about"]), {name: data[name] for name in FIELDS}))
        buffer = io.BytesIO()
        np.savez(buffer, **data)
        content = buffer.getvalue()
    write({"checkpoint.npz": content}, place / "run")
    return lambda: command(["run", "--resume", str(place / "run")])


def _spoil_tree(tree: dict[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    """A JSON object with one value somewhere in it replaced, or missing."""
    key = sorted(tree)[int(rng.integers(len(tree)))]
    value = tree[key]
    if isinstance(value, dict) and value and rng.random() < 0.7:
        return {**tree, key: _spoil_tree(value, rng)}
    if key == "scene":
        return {**tree, key: spoil(value.encode(), rng).decode("utf-8", "replace")}
    if rng.random() < 0.2:
        return {name: kept for name, kept in tree.items() if name != key}
    strange = (None, -1, 0, 1e300, 10**30, "", "x", "0x1p-1", [], {}, True, "nan", "seed", 3)
    return {**tree, key: strange[int(rng.integers(len(strange)))]}


def crosscheck(rng: np.random.Generator, place: Path) -> Action:
    write(spoil_some(bed_seed(), rng), place)
    return lambda: command(["crosscheck", str(place / "bed.npz"), "--json", str(place / "out.json")])


# ---- options ----------------------------------------------------------------------------------

COMMANDS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "run": (
        ("two_disks", "--out=OUT", "--video=none", "--duration=1e-3"),
        ("--duration", "--dt", "--mode", "--frames", "--fps", "--color", "--video", "--seed", "--max-overlap",
         "--softened", "--resume", "--out", "SCENE"),
    ),
    "sweep": (
        ("two_disks", "--vary=contact_linear.stiffness=1000,1001", "--out=OUT", "--duration=1e-3", "--processes=1"),
        ("--vary", "--duration", "--settle", "--every", "--processes", "--out", "SCENE"),
    ),
    "diagnose": (
        ("pendulum", "--out=OUT", "--minutes=0.1"), ("--minutes", "--seed", "--hold-out", "--out", "SCENE"),
    ),
    "conceal": (
        ("--seed=1", "--out=OUT"), ("--seed", "--kind", "--effect", "--secret", "--sealed", "--out", "SCENE"),
    ),
    "prove": (
        ("--quick", "--out=OUT"),
        ("--seeds", "--kind", "--slice", "--series", "--commit", "--workers", "--minutes", "--json", "--out", "SCENE"),
    ),
    "crosscheck": (("bed_9Hz",), ("--mode", "--json", "SCENE")),
    "laws": ((), ("SCENE",)),
    "benchmark": (("--grains=500", "--no-memory"), ("--grains", "--engines", "--rounds", "--json", "--out", "SCENE")),
    "import": (("SOURCE", "--out=OUT", "--body=*:5mm:10g"), (*IMPORT_OPTIONS, "--out", "SCENE")),
}  # fmt: skip


def _word(rng: np.random.Generator) -> str:
    return WORDS[int(rng.integers(len(WORDS)))]


def options(rng: np.random.Generator, place: Path) -> Action:
    """A command that would do, with one or two more options whose values make no sense."""
    name = sorted(COMMANDS)[int(rng.integers(len(COMMANDS)))]
    good, known = COMMANDS[name]
    write({"source.csv": table_seeds()[0][1]}, place)
    argv = [name]
    argv += [part.replace("OUT", str(place / "out")).replace("SOURCE", str(place / "source.csv")) for part in good]
    for _ in range(int(rng.integers(1, 3))):
        option, value = known[int(rng.integers(len(known)))], _word(rng)
        # whatever is written stays below the place
        if option in ("--out", "--json", "--sealed"):
            value = str(place / value.strip("/.")) if rng.random() < 0.8 else "/proc/nowhere"
        argv.append(value if option == "SCENE" else f"{option}={value}")
    return lambda: command(argv)


def command(argv: list[str]) -> None:
    """A command in this process. Wrong input is raised as the one line that it prints, more than one as a failure."""
    import contextlib

    from granswim_pymunk.cli import main
    from granswim_pymunk.errors import InputError

    said = io.StringIO()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(said):
        try:
            code = main(argv)
        except SystemExit as error:  # the options could not be parsed
            raise InputError("usage") if error.code else error from None
    lines = [line for line in said.getvalue().splitlines() if line]
    if code and (not lines or not lines[-1].startswith(f"granswim {argv[0]}: ")):
        raise AssertionError(f"exit code {code} and no line that says why: {lines[-1:]}")
    if code:
        raise InputError(lines[-1])


KINDS: dict[str, Callable[[np.random.Generator, Path], Action]] = {
    "recording": recording, "scene": scene, "import": foreign, "options": options, "crosscheck": crosscheck,
    "checkpoint": checkpoint,
}  # fmt: skip
