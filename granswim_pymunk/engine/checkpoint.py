"""Checkpoints: everything a run needs to go on with the same bits.

A checkpoint is a NumPy .npz archive: float64 arrays as Chipmunk has them, the step, the state of a random
generator if one is given, and the scene as TOML. Neighbour lists are not kept: they change no bit. The sum of
the content is checked when it is read. Written beside the old one, flushed to the disk, then renamed: a program
that is killed in the middle leaves the last good checkpoint.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
import tomllib
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, SimulationError
from ..scene import scene_from_dict
from .simulation import Simulation
from .units import Units

FORMAT = "granswim checkpoint"
VERSION = 1
# what one body has, as Chipmunk keeps it (engine units), and what the engine keeps beside it (SI)
FIELDS = ("x", "y", "vx", "vy", "angle", "spin", "images", "fx", "fy", "torque", "vx_start", "vy_start",
          "laid_x", "laid_y")  # fmt: skip


GENERATORS = ("PCG64", "PCG64DXSM", "MT19937", "Philox", "SFC64")


def _digest(about: str, arrays: dict[str, np.ndarray]) -> str:
    total = hashlib.sha256(about.encode())
    for name in sorted(arrays):
        total.update(name.encode())
        total.update(np.ascontiguousarray(arrays[name]).tobytes())
    return total.hexdigest()


def save_checkpoint(
    simulation: Simulation,
    path: str | Path,
    random: np.random.Generator | None = None,
    note: dict[str, Any] | None = None,
) -> None:
    """Write the state of a simulation; ``note`` is what a caller wants back (JSON).

    Raises SimulationError where it cannot be written (a full disk): the checkpoint that was there stays.
    InputError for a scene with impulses, whose collisions Chipmunk remembers where they cannot be read.
    """
    if simulation.impulse:
        raise InputError("a run with impulses cannot be continued from a checkpoint", where="law contact_elastic")
    path = Path(path)
    raw = simulation.freeze()
    arrays = {name: np.asarray(raw[name], dtype=np.float64) for name in FIELDS}
    state = None if random is None else random.bit_generator.state
    about = json.dumps(
        {
            "mode": simulation.mode, "dt": simulation.dt.hex(), "step": simulation.step,
            "units": [u.hex() for u in (simulation.units.length, simulation.units.time, simulation.units.mass)],
            "begun": simulation.begun, "start": simulation.start,
            "scene": simulation.scene.to_toml(), "random": state, "note": note or {},
        },
        default=lambda value: value.tolist(),
    )  # fmt: skip
    handle, beside = -1, ""
    try:
        handle, beside = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".part")
        with os.fdopen(handle, "wb") as stream:
            np.savez(
                stream, allow_pickle=False, format=np.array(FORMAT), version=np.array(VERSION), about=np.array(about),
                sum=np.array(_digest(about, arrays)), **arrays,
            )  # fmt: skip
            stream.flush()
            os.fsync(stream.fileno())
        os.chmod(beside, 0o644)
        os.replace(beside, path)
    except OSError as error:
        raise SimulationError(
            f"{path}: the checkpoint cannot be written: {error.strerror or error}; an earlier one is kept"
        ) from None
    finally:
        if beside:
            Path(beside).unlink(missing_ok=True)


def load_checkpoint(path: str | Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """What ``save_checkpoint`` wrote: (about, arrays).

    Raises InputError where the file is missing, damaged, or written by another version.
    """
    path = Path(path)
    try:
        with open(path, "rb") as stream, np.load(stream, allow_pickle=False) as archive:
            if "format" not in archive or str(archive["format"]) != FORMAT:
                raise InputError("is not a checkpoint", file=path)
            version = int(archive["version"])
            if version != VERSION:
                raise InputError(f"is a checkpoint of version {version}; this program reads {VERSION}", file=path)
            about = str(archive["about"])
            arrays = {name: archive[name] for name in FIELDS}
            if _digest(about, arrays) != str(archive["sum"]):
                raise InputError("the checkpoint is damaged: its sum does not fit its content", file=path)
    except FileNotFoundError:
        raise InputError("no such file", file=path) from None
    except InputError:
        raise
    except (OSError, ValueError, KeyError, EOFError, TypeError, zipfile.BadZipFile, RuntimeError) as error:
        raise InputError(f"the checkpoint is damaged: {error}", file=path) from None
    except Exception as error:  # zlib.error and whatever else a damaged archive leads to
        raise InputError(f"the checkpoint is damaged: {type(error).__name__}: {error}", file=path) from None
    return json.loads(about), arrays


def resume(path: str | Path) -> tuple[Simulation, np.random.Generator | None, dict[str, Any]]:
    """A simulation that goes on where the checkpoint was written: (simulation, random generator, note).

    On the same machine and with the same versions of the libraries the run has the bits of one that was never
    stopped. Raises InputError as ``load_checkpoint`` does.
    """
    about, arrays = load_checkpoint(path)
    try:
        scene = scene_from_dict(tomllib.loads(about["scene"]))
        units = Units(*(float.fromhex(u) for u in about["units"]))
        simulation = Simulation(
            scene, mode=about["mode"], dt=float.fromhex(about["dt"]), start=about["start"], units=units
        )
        simulation.thaw(arrays, int(about["step"]), bool(about["begun"]))
        random, note = None, about["note"]
        if about["random"] is not None:
            name = about["random"]["bit_generator"]
            if name not in GENERATORS:
                raise ValueError(f"unknown random generator {name!r}")
            kind = getattr(np.random, name)()
            kind.state = about["random"]
            random = np.random.Generator(kind)
        if not isinstance(note, dict):
            raise ValueError(f"its note is {note!r}")
    except InputError as error:
        raise InputError(f"the checkpoint is damaged: {error}", file=path) from None
    except (KeyError, ValueError, TypeError, IndexError, OverflowError, AttributeError, RecursionError) as error:
        raise InputError(f"the checkpoint is damaged: {type(error).__name__}: {error}", file=path) from None
    return simulation, random, note
