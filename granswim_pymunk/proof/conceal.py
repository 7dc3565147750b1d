"""Write a case: the recording, its published hash beside it, and the sealed truth elsewhere."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path

from ..errors import InputError
from ..recording import write_recording
from .bed_cases import curve_case, seen_bed_case, swimmer_case
from .cases import Case, bodies_case
from .real_beds import real_bed_case
from .real_life import real_bodies_case
from .seal import commitment, derived

# bodies without a bed; a bed that is seen; several films of a swimmer alone; its speeds; each bed also in small
KINDS: dict[str, Callable[..., Case]] = {
    "bodies": bodies_case,
    "bed": seen_bed_case,
    "small-bed": partial(seen_bed_case, small=True),
    "unseen": swimmer_case,
    "small-unseen": partial(swimmer_case, small=True),
    "curve": curve_case,
    "small-curve": partial(curve_case, small=True),
    "real-life": real_bodies_case,
    "real-life-bed": real_bed_case,
    "real-life-small-bed": partial(real_bed_case, small=True),
}
MOMENT = 946684800  # s, 1 January 2000: what every file of a case says it was written


def real_kind(kind: str) -> str:
    """The kind under real-life conditions. Raises InputError where there is none."""
    found = kind if kind.startswith("real-life") else _real(kind)
    if found not in KINDS:
        known = ", ".join(k for k in KINDS if not k.startswith("real-life") and _real(k) in KINDS)
        raise InputError(f"{kind} is not drawn under real-life conditions; known: {known}", where="--kind")
    return found


def _real(kind: str) -> str:
    return "real-life" if kind == "bodies" else f"real-life-{kind}"


def write_beside(path: Path, text: str, mode: int = 0o644) -> None:
    """Write to a name beside, then rename: a reader never sees half a file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    handle = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, mode)
    with os.fdopen(handle, "w", encoding="utf-8") as out:
        out.write(text)
    os.replace(beside, path)


def conceal(
    seed: int, out: str | Path, secret: bytes, sealed: str | Path, *, kind: str = "bodies", effect: str | None = None
) -> Path:
    """Draw a case and write it; the folder of its recording.

    out : gets KIND-SEED/ (the recording, or a folder for each of several) and KIND-SEED.sha256 (the commitment)
    secret : what the drawing needs besides the seed;  sealed : folder for KIND-SEED.json, the truth and its salt
    effect : a mechanism, or a category (null, outside ...), instead of a drawn one
    Raises InputError where a kind or effect does not exist, or the case has been written before.
    """
    if kind not in KINDS:
        raise InputError(f"unknown kind {kind!r}; known: {', '.join(KINDS)}", where="--kind")
    out, sealed = Path(out), Path(sealed)
    name = f"{kind}-{seed}"
    if sealed.resolve() == out.resolve() or out.resolve() / name in (sealed.resolve(), *sealed.resolve().parents):
        raise InputError("the truth has to lie elsewhere than the recordings", file=sealed)
    if (out / name).exists() or (sealed / f"{name}.json").exists():
        raise InputError("this case has been written before; a seed is used once", file=out / name)
    case = KINDS[kind](seed, secret, effect)
    salt = derived(secret, kind, seed, "salt").hex()
    write_beside(sealed / f"{name}.json", json.dumps({"salt": salt, "truth": case.truth}, indent=1) + "\n", 0o600)
    write_beside(out / f"{name}.sha256", commitment(salt, case.truth) + "\n")
    if len(case.recordings) == 1:
        write_recording(case.recording, out / name)
    else:
        for recording in case.recordings:
            write_recording(recording, out / name / recording.name)
    for path in (*sorted((out / name).rglob("*")), out / name, out / f"{name}.sha256"):
        path.chmod(0o755 if path.is_dir() else 0o644)
        os.utime(path, (MOMENT, MOMENT))
    return out / name
