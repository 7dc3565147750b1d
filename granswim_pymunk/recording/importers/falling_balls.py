"""The ball drops of de Silva et al., Front. Artif. Intell. 3:25 (2020), doi:10.3389/frai.2020.00025."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...scene import Body, Scene, use
from ..recording import Recording
from .base import Options
from .source import Source

OUNCE = 0.028349523125  # kg, avoirdupois
GRAVITY = (0.0, -9.81)

# names in ball_drops.csv -> names in balls.txt
BALLS = {
    "Baseball": "baseball",
    "Blue Basketball": "bluebasketball",
    "Green Basketball": "greenbasketball",
    "Volleyball": "volleyball",
    "Bowling Ball": "bowlingball",
    "Golf Ball": "golfball",
    "Tennis Ball": "tennisball",
    "Whiffle Ball 1": "wiffleball1",
    "Whiffle Ball 2": "wiffleball2",
    "Yellow Whiffle Ball": "yellowWiffle",
    "Orange Whiffle Ball": "orangeWiffle",
}
# balls.txt lists two bowling balls by weight [oz], ball_drops.csv has one
BOWLING = {81: "bowlingball", 208: "heavyBowling"}


def import_falling_balls(source: str | Path, *, bowling_ball: int = 208) -> list[Recording]:
    """Every drop of every ball as a recording of its own, named ``BALL_DROP``.

    source : ball_drops.csv with balls.txt beside it, or their folder
    bowling_ball : 81 or 208 [oz], which of the two listed bowling balls was dropped
    One vertical coordinate: x = 0, y the height [m]. A ball whose weight or circumference is not listed is
    left out. Radius c/2 pi, mass in kg from ounces. Raises InputError naming file and row.
    """
    if bowling_ball not in BOWLING:
        raise InputError(
            f"should be one of {', '.join(map(str, BOWLING))} [oz], got {bowling_ball!r}",
            where="bowling ball",
        )
    source = Path(source)
    file = source / "ball_drops.csv" if source.is_dir() else source
    sizes = _read_sizes(file.with_name("balls.txt"))
    drops: dict[tuple[str, str], list[tuple[float, float]]] = {}
    table = Source(file, Options(delimiter=",", decimal=".")).table
    if table is None:
        raise InputError("is not a table in UTF-8", file=file)
    balls, numbers = table.texts("ball"), table.texts("drop")
    times, heights = table.numbers("t_s", required=True), table.numbers("height_m", required=True)
    for ball, drop, t, height, line in zip(balls, numbers, times.tolist(), heights.tolist(), table.lines, strict=True):
        if ball not in BALLS:
            raise InputError(f"unknown ball {ball!r}", file=file, where=f"row {line}")
        drops.setdefault((ball, drop), []).append((t, height))
    recordings = []
    for (ball, drop), pairs in drops.items():
        listed = sizes.get(BOWLING[bowling_ball] if ball == "Bowling Ball" else BALLS[ball])
        if listed is None:
            continue
        ounces, circumference = listed
        name = ball.replace(" ", "_")
        body = Body(id=name, role="free", radius=circumference / (2 * math.pi), mass=ounces * OUNCE)
        t, height = np.array(sorted(pairs)).T
        recordings.append(
            Recording(
                name=f"{name}_{drop}",
                title=f"{ball}, drop {drop}",
                scene=Scene(bodies=(body,), laws=(use("gravity"),), gravity=GRAVITY, title=f"{ball}, drop {drop}"),
                t=t,
                ids=(name,),
                xy=np.stack([np.zeros_like(height), height], axis=-1)[:, None, :],
                sampling=15.0,
            )
        )
    if not recordings:
        raise InputError("no drop of a ball of known weight and circumference", file=file)
    return recordings


def _read_sizes(file: Path) -> dict[str, tuple[float, float]]:
    """Weight [oz] and circumference [m] of each ball; those marked ?? are left out."""
    try:
        lines = file.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise InputError(f"cannot read it: {error.strerror}", file=file) from None
    except UnicodeDecodeError:
        raise InputError("is not a text in UTF-8", file=file) from None
    sizes = {}
    for number, line in enumerate(lines[1:], start=2):
        parts = line.split()
        if not parts or "??" in parts:
            continue
        try:
            name, ounces, centimetres = parts[0], float(parts[1]), float(parts[2])
        except (IndexError, ValueError):
            raise InputError(
                "expected a name, a weight [oz] and a circumference [cm]", file=file, where=f"row {number}"
            ) from None
        sizes[name] = (ounces, centimetres / 100)
    return sizes
