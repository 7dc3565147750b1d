"""Seals: random numbers and salts that need a secret, and a published hash that binds the truth.

Everything of a case is drawn from HMAC-SHA256(secret, kind, seed, stream), so that a seed alone tells nothing. The
commitment is SHA-256(salt, newline, truth as canonical JSON); the salt is sealed with the truth.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import os
import re
import secrets
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import platformdirs

from ..errors import InputError

SHORTEST = 16  # bytes of a secret


def default_secret_file() -> Path:
    """Where the user's own secret is kept: GRANSWIM_SECRET, else the user's data folder."""
    chosen = os.environ.get("GRANSWIM_SECRET")
    return Path(chosen) if chosen else Path(platformdirs.user_data_dir("granswim_pymunk")) / "secret"


def read_secret(file: str | Path | None = None) -> bytes:
    """The secret of a file; the user's own (made once, readable by the user only) where None.

    Raises InputError where the file is missing or too short to be a secret.
    """
    path = default_secret_file() if file is None else Path(file)
    if file is None and not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(handle, "w") as out:
            out.write(secrets.token_hex(32) + "\n")
    try:
        secret = path.read_bytes().strip()
    except OSError as error:
        raise InputError(f"the secret cannot be read: {error.strerror}", file=path) from None
    if len(secret) < SHORTEST:
        raise InputError(f"a secret has {SHORTEST} bytes or more, got {len(secret)}", file=path)
    return secret


def series_secret(number: int, commit: str) -> bytes:
    """The secret of a series: the hexadecimal SHA-256 of the text ``series NUMBER COMMIT``.

    It can neither be chosen nor lost. Raises InputError where ``commit`` is not the 40 digits of one.
    """
    if not re.fullmatch(r"[0-9a-f]{40}", commit):
        raise InputError(f"a commit has 40 hexadecimal digits, got {commit!r}", where="--commit")
    if number < 1:
        raise InputError(f"should be one or more, got {number}", where="--series")
    return hashlib.sha256(f"series {number} {commit}".encode("ascii")).hexdigest().encode("ascii")


LIST = "docs/proof_history.md"  # of every series that was begun


def checked_out(number: int, folder: Path | None = None) -> str:
    """The commit of the checkout that this code runs from, if series ``number`` may be scored with it.

    Raises InputError where the code is not in a checkout, differs from its commit, or its list of series
    (docs/proof_history.md) does not have the number.
    """
    folder = Path(__file__).resolve().parent if folder is None else folder

    def git(*words: str) -> str:
        try:
            done = subprocess.run(["git", "-C", str(folder), *words], capture_output=True, text=True, check=True)
        except (OSError, subprocess.CalledProcessError):
            message = "a series is scored from a checkout; give its commit with --commit"
            raise InputError(message, where="--series") from None
        return done.stdout

    commit = git("rev-parse", "HEAD").strip()
    changed = git("status", "--porcelain", "--untracked-files=no").splitlines()
    if changed:
        raise InputError(f"the checkout differs from its commit: {changed[0].strip()}", where="--series")
    if not re.search(rf"^\| *{number} *\|", git("show", f"HEAD:{LIST}"), re.MULTILINE):
        raise InputError(f"{number} is not in the list of {LIST}; list it before it begins", where="--series")
    return commit


def derived(secret: bytes, *parts: str | int) -> bytes:
    """32 bytes that nobody without the secret can work out."""
    return hmac.new(secret, "\n".join(map(str, parts)).encode(), hashlib.sha256).digest()


def generator(secret: bytes, *parts: str | int) -> np.random.Generator:
    """Random numbers of one stream of one case."""
    return np.random.default_rng(int.from_bytes(derived(secret, *parts), "big"))


def canonical_text(truth: Mapping[str, Any]) -> str:
    return json.dumps(truth, sort_keys=True, separators=(",", ":"), allow_nan=False)


def commitment(salt: str, truth: Mapping[str, Any]) -> str:
    """SHA-256 of salt and truth, in hexadecimal digits."""
    return hashlib.sha256(f"{salt}\n{canonical_text(truth)}".encode()).hexdigest()


def opened(sealed: Mapping[str, Any], published: str) -> dict[str, Any]:
    """The truth of a sealed file, if its hash is the one that was published. Raises InputError otherwise."""
    truth = dict(sealed["truth"])
    if commitment(sealed["salt"], truth) != published.strip():
        raise InputError("the sealed truth does not have the hash that was published", where=str(truth.get("seed")))
    return truth
