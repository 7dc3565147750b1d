"""``python -m granswim_pymunk.validation.lab --out DIR --seed S --count N``: recordings of single laboratories.

Four experiments, each with one law that explains most and what a laboratory adds to it:

- ``puck``: pucks that slide over a table that is not flat, slowed by a linear drag;
- ``motor``: a cart on a rail whose motor follows its command 0.146 s late, seen with coloured noise;
- ``pendulum``: viscous and dry friction in its joint, filmed at 60 frames a second;
- ``magnets``: two magnets on an air table that repel each other as dipoles do, slowed by a drag.

Equations are integrated here by Runge and Kutta's fourth order; no law of the engine or of the proof is called. DIR
gets a folder for each recording, N of each experiment; the truth of all goes to another file. ``--score VERDICTS``
holds VERDICTS/NAME/verdict.json against it.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from granswim_pymunk.errors import InputError
from granswim_pymunk.proof.ideal import Errors
from granswim_pymunk.proof.real_life import disturbed
from granswim_pymunk.recording import Recording, write_recording
from granswim_pymunk.scene import Body, Scene, use

from .output import write_json
from .pucks import answer_in

G = 9.81  # m/s^2
STEP = 5e-4  # s
LAG = 0.146  # s
DRAG = ("linear_drag", "quadratic_drag", "ambient_flow", "joint_drag")
# what is as good a name for what explains most
UNKNOWN = "unknown"
EQUAL = {
    "linear_drag": ("ambient_flow",), "actuator_lag": ("actuator_delay", "time_offset"),
    "joint_drag": ("linear_drag",),
}  # fmt: skip


@dataclass(frozen=True)
class Made:
    """A recording and its truth."""

    recording: Recording
    truth: dict[str, Any]


Rate = Callable[[float, np.ndarray], np.ndarray]


def integrated(rate: Rate, start: Sequence[float], times: np.ndarray) -> np.ndarray:
    """(T, k) states at ``times`` of y' = rate(t, y) from ``start`` at the first of them."""
    y, t = np.array(start, dtype=float), float(times[0])
    found = [y]
    for end in times[1:]:
        count = max(math.ceil((end - t) / STEP), 1)
        h = (end - t) / count
        for _ in range(count):
            k1 = rate(t, y)
            k2 = rate(t + h / 2, y + h / 2 * k1)
            k3 = rate(t + h / 2, y + h / 2 * k2)
            k4 = rate(t + h, y + h * k3)
            y, t = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), t + h
        t = float(end)
        found.append(y)
    return np.array(found)


def as_filmed(
    name: str, scene: Scene, t: np.ndarray, xy: np.ndarray, errors: Errors, rng: np.random.Generator,
    stated: float | None,
) -> Recording:  # fmt: skip
    """A contract recording of true places xy (T, n, 2) at moments t, with the errors of a film."""
    seen = disturbed(xy.reshape(len(t), -1), errors, rng, 2).reshape(xy.shape)
    ids = tuple(b.id for b in scene.bodies if b.mobile)
    rate = float(f"{1 / np.median(np.diff(t)):.6g}")
    return Recording(name, scene, np.round(t, 7), ids, seen, title=name, sampling=rate, position_noise=stated)


def film_errors(rng: np.random.Generator, white: float) -> tuple[Errors, float | None]:
    """Errors of a tracker: a slow part, pixels, few outliers, jitter; and what is stated of them."""
    errors = Errors(
        white, pixel=white * rng.uniform(0, 2), slow=white * rng.uniform(0.4, 1.0), frames=rng.uniform(5, 25),
        outliers=0.003, bursts=(int(rng.integers(3, 9)),), lost=0.01,
    )  # fmt: skip
    factor = (1.0, 2.0, None)[int(rng.integers(3))]
    return errors, None if factor is None else float(f"{factor * errors.fast:.3g}")


def puck(rng: np.random.Generator, name: str) -> Made:
    """Two pucks, one after the other's path, on a table with slopes of about 1 mm/m."""
    rate = 120.0
    t = 0.5 + np.arange(int(rng.uniform(2.0, 3.0) * rate)) / rate
    # slopes of three waves of 0.5 to 1.5 m length, about 1 mm/m together
    length = rng.uniform(0.5, 1.5, 3)
    way, phase = rng.uniform(0, 2 * math.pi, 3), rng.uniform(0, 2 * math.pi, 3)
    wave = 2 * math.pi / length[:, None] * np.column_stack([np.cos(way), np.sin(way)])
    rms = 1e-3 * rng.uniform(0.6, 1.4)
    slope = rms * math.sqrt(2 / 3)
    damping = rng.uniform(0.25, 0.6)  # 1/s
    mass = [float(f"{rng.uniform(0.04, 0.09):.3g}")] * 2
    start = [0.0, 0.0, rng.uniform(0.35, 0.6), rng.uniform(-0.1, 0.1), 0.0, 0.25, rng.uniform(0.3, 0.5), 0.05]

    def motion(_: float, y: np.ndarray) -> np.ndarray:
        out = np.empty(8)
        for k in (0, 4):
            uneven = -G * slope * (np.cos(wave @ y[k : k + 2] + phase)[:, None] * wave / np.hypot(*wave.T)[:, None])
            out[k : k + 2] = y[k + 2 : k + 4]
            out[k + 2 : k + 4] = -damping * y[k + 2 : k + 4] + uneven.sum(axis=0)
        return out

    path = integrated(motion, start, t)
    errors, stated = film_errors(rng, 2.5e-4)
    bodies = tuple(Body(f"p{k + 1}", "free", 0.03, m) for k, m in enumerate(mass))
    xy = np.stack([path[:, :2], path[:, 4:6]], axis=1)
    recording = as_filmed(name, Scene(bodies, ()), t, xy, errors, rng, stated)
    c = damping * mass[0]
    return Made(recording, truth_of(name, [("linear_drag", {"c": c})], "an uneven table", slope_rms=rms))


def motor(rng: np.random.Generator, name: str) -> Made:
    """A cart whose motor follows its command late, with a gain that is a little off."""
    rate = 60.0
    t = 1.0 + np.arange(int(rng.uniform(8.0, 12.0) * rate)) / rate
    when = np.arange(0.0, t[-1] + 0.5, 0.02)
    # steps that ramp, as a hand on a knob gives them, and a swing
    levels = rng.uniform(-0.25, 0.25, int(when[-1] / 0.8) + 2)
    command = np.interp(when, 0.8 * np.arange(len(levels)), levels)
    command = np.round(command + 0.08 * np.sin(2 * math.pi * rng.uniform(0.5, 1.2) * when), 5)
    gain = 1.0 + rng.uniform(-0.01, 0.01)

    def motion(now: float, y: np.ndarray) -> np.ndarray:
        return np.array([y[1], (gain * float(np.interp(now, when, command)) - y[1]) / LAG])

    first = np.concatenate([[0.0], t])
    path = integrated(motion, [0.1, command[0]], first)[1:]
    errors, stated = film_errors(rng, 4e-4)
    scene = Scene(
        (Body("cart", "free", 0.03, 0.4),), (use("rail", direction=(1.0, 0.0), bodies=["cart"]),
                                             use("drive", bodies=["cart"], gain=1.0)),
        inputs={"cart": (tuple(float(f"{x:.4f}") for x in when), tuple(map(float, command)))},
    )  # fmt: skip
    xy = np.column_stack([path[:, 0], np.full(len(t), 0.05)])[:, None]
    recording = as_filmed(name, scene, t, xy, errors, rng, stated)
    return Made(recording, truth_of(name, [("actuator_lag", {"tau": LAG})], "a gain and coloured noise", gain=gain))


def pendulum(rng: np.random.Generator, name: str) -> Made:
    """A bob on a rod in a bearing with viscous and dry friction; the length believed is 0.2 % off."""
    rate = 60.0
    t = 0.3 + np.arange(int(rng.uniform(15.0, 25.0) * rate)) / rate
    length, mass = rng.uniform(0.22, 0.35), float(f"{rng.uniform(0.05, 0.2):.3g}")
    damping, dry = rng.uniform(0.03, 0.08), rng.uniform(0.01, 0.03)  # 1/s, 1/s^2

    def motion(_: float, y: np.ndarray) -> np.ndarray:
        # the sign of the speed within 0.01 rad/s, as bearings have it
        return np.array([y[1], -G / length * math.sin(y[0]) - damping * y[1] - dry * math.tanh(y[1] / 0.01)])

    path = integrated(motion, [rng.uniform(0.4, 0.8), 0.0], t)
    xy = length * np.column_stack([np.sin(path[:, 0]), -np.cos(path[:, 0])])[:, None]
    errors, stated = film_errors(rng, 2e-4)
    believed = float(f"{length * (1 + 0.002 * rng.choice([-1, 1])):.4g}")
    laws = (use("gravity"), use("pin", anchor=(0.0, 0.0), length=believed, bodies=["bob"]))
    scene = Scene((Body("bob", "free", 0.015, mass),), laws, gravity=(0.0, -G))
    recording = as_filmed(name, scene, t, xy, errors, rng, stated)
    inertia = mass * length**2
    laws_true = [("joint_drag", {"c": damping * inertia}), ("joint_friction", {"torque": dry * inertia})]
    if dry > damping * _mean_rate(path):
        laws_true.reverse()
    return Made(recording, truth_of(name, laws_true, "a length 0.2 % off", length=length))


def _mean_rate(path: np.ndarray) -> float:
    """The speed at which a viscous torque takes as much as a dry one: mean of w^2 over mean of |w|."""
    return float(np.mean(path[:, 1] ** 2) / np.mean(np.abs(path[:, 1])))


def magnets(rng: np.random.Generator, name: str) -> Made:
    """Two magnets sent at each other; a dipole's repulsion falls like d^-4, and the table is not quite level."""
    rate = 120.0
    t = 0.2 + np.arange(int(rng.uniform(1.6, 2.4) * rate)) / rate
    mass = np.array([float(f"{m:.3g}") for m in rng.uniform(0.03, 0.06, 2)])
    radius, damping = 0.015, rng.uniform(0.1, 0.25)
    speed, off = rng.uniform(0.25, 0.4, 2), rng.uniform(-0.03, 0.03)
    # they turn at some 6 cm: k/(3 d^3) is the energy of their approach
    reduced = mass.prod() / mass.sum()
    strength = 3 * 0.06**3 * 0.5 * reduced * speed.sum() ** 2  # N m^4
    tilt = 9.81 * 3e-4 * np.array([math.cos(a := rng.uniform(0, 6.28)), math.sin(a)])
    start = [-0.2, off, speed[0], 0.0, 0.2, 0.0, -speed[1], 0.0]

    def motion(_: float, y: np.ndarray) -> np.ndarray:
        apart = y[4:6] - y[:2]
        push = strength / float(apart @ apart) ** 2.5 * apart
        a, b = -push / mass[0], push / mass[1]
        return np.concatenate([y[2:4], a - damping * y[2:4] + tilt, y[6:], b - damping * y[6:] + tilt])

    path = integrated(motion, start, t)
    errors, stated = film_errors(rng, 2e-4)
    bodies = (Body("m1", "free", radius, float(mass[0])), Body("m2", "free", radius, float(mass[1])))
    xy = np.stack([path[:, :2], path[:, 4:6]], axis=1)
    recording = as_filmed(name, Scene(bodies, (use("contact_elastic", restitution=0.9),)), t, xy, errors, rng, stated)
    laws = [("distance_force", {"s": strength / radius**4, "n": 4.0}), ("linear_drag", {"c": damping * mass.mean()})]
    return Made(recording, truth_of(name, laws, "a tilt, a drag as its mass", tilt=tilt.tolist()))


def truth_of(name: str, laws: Sequence[tuple[str, dict[str, float]]], beside: str, **more: Any) -> dict[str, Any]:
    """The laws, what explains most first, and what else there is."""
    effects = [{"name": n, "values": {k: float(v) for k, v in values.items()}} for n, values in laws]
    return {"name": name, "experiment": name.split("-")[0], "effects": effects, "beside": beside, **more}


Experiments = Mapping[str, Callable[[np.random.Generator, str], Made]]
EXPERIMENTS = {make.__name__: make for make in (puck, motor, pendulum, magnets)}


def judged(truth: Mapping[str, Any], verdict: Mapping[str, Any] | None) -> str:
    """all | right | class | wrong | silent | none: whether what explains most is named, and all of it.

    Where nothing is missing, or what no law is, no name is right.
    """
    if verdict is None:
        return "none"
    named = {m["name"] for m in verdict["mechanisms"]} - {"unknown"}
    wanted = [e["name"] for e in truth["effects"]]
    if not wanted or wanted[0] == UNKNOWN:
        silent = ("unmodelled",) if wanted else ("no_mismatch", "recalibrate")
        return "wrong" if named else "all" if verdict["verdict"] in silent else "silent"
    if verdict["verdict"] not in ("missing_physics", "measurement") or not named:
        return "silent"
    alike = {r["name"] for r in verdict.get("rivals", []) if r.get("indistinguishable")}
    first = {wanted[0], *EQUAL.get(wanted[0], ())}
    drags = named & set(DRAG) and set(wanted) & set(DRAG)
    if wanted[0] in named:
        rest = [w for w in wanted[1:] if w not in named and not (w in DRAG and drags)]
        return "right" if rest else "all"
    return "class" if first & named or wanted[0] in alike else "wrong"


def score(truths: Sequence[Mapping[str, Any]], verdicts: Path) -> str:
    """A table of all recordings, as Markdown."""
    lines = ["| recording | what is there | answer | judged | explained | complete | held out |",
             "|---|---|---|---|---|---|---|"]  # fmt: skip
    for truth in truths:
        verdict, known = answer_in(verdicts / truth["name"])
        said: Mapping[str, Any] = verdict or {}
        named = dict.fromkeys(m["name"] for m in said.get("mechanisms", ()))
        answer = known["failed"] or f"{said['verdict']} {' + '.join(named)}"
        share = (said.get("explained") or {}).get("share")
        lines.append(
            f"| {truth['name']} | {' + '.join(e['name'] for e in truth['effects']) or 'nothing'}, {truth['beside']} | "
            f"{answer} | "
            f"{judged(truth, verdict)} | {'' if share is None else f'{share:.2f}'} | {said.get('complete', '')} | "
            f"{said.get('heldout') or ''} |"
        )
    return "\n".join(lines)


def main(
    argv: list[str] | None = None, say: Callable[[str], None] = print, *, of: Experiments | None = None,
    about: str | None = __doc__, stream: int = 30,
) -> int:  # fmt: skip
    """The command; ``of``: the experiments by their names, ``stream``: of the seeds of these."""
    experiments = EXPERIMENTS if of is None else of
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder of the recordings")
    parser.add_argument("--seed", type=int, default=0, metavar="S")
    parser.add_argument("--count", type=int, metavar="N", help="recordings of each experiment")
    parser.add_argument("--truth", type=Path, metavar="FILE", help="the truth (default: DIR.json)")
    parser.add_argument("--score", type=Path, metavar="VERDICTS", help="hold these verdicts against the truth")
    args = parser.parse_args(argv)
    file: Path = args.truth or args.out.with_name(f"{args.out.name}.json")
    try:
        if args.count is not None:
            if args.count < 1 or args.seed < 0:
                raise InputError("needs a count of one or more and a seed of zero or more", where="--count")
            truths = []
            for k in range(args.seed, args.seed + args.count):
                for n, (key, make) in enumerate(experiments.items()):
                    made = make(np.random.default_rng((stream, n, k)), f"{key}-{k}")
                    say(str(write_recording(made.recording, args.out / made.recording.name)))
                    truths.append(made.truth)
            write_json(truths, file)
            say(f"truth: {file}")
        if args.score is not None:
            try:
                truths = json.loads(file.read_text(encoding="utf-8"))
            except (OSError, ValueError) as error:
                raise InputError(f"cannot read the truth: {error}", file=file) from None
            say(score(truths, args.score))
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
