"""What is compared where the grains are not seen: numbers that average over the packing.

Of tracks: mean and harmonics of the angles of the swimmer's segments against the drive's phase, the drift, the
stroke of the head, the mean distance of neighbouring disks. Of a curve: the mean speed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

HARMONICS = (1, 3)  # of the angles; a straight symmetric swimmer has no even ones
LEAST_CYCLES = 1.2  # below this nothing can be told about harmonics


@dataclass(frozen=True)
class Number:
    """One compared number. ``kind``: "mean", "cos", "sin" (angle of a segment), "head", "drift", "length", "speed".

    place : segment (0 behind the head), or axis (0 along x, 1 along y);  harmonic : 0 for means
    """

    kind: str
    place: int
    harmonic: int
    unit: str

    @property
    def label(self) -> str:
        names = {"drift": "drift along " + "xy"[self.place % 2], "length": "distance of disks", "speed": "speed"}
        if self.kind in names:
            return names[self.kind]
        if self.kind == "mean":
            return f"segment {self.place}, mean angle"
        if self.kind in ("head_cos", "head_sin"):
            return f"head {'xy'[self.place]}, {self.kind[5:]}, harmonic {self.harmonic}"
        return f"segment {self.place}, {self.kind}, harmonic {self.harmonic}"


@dataclass(frozen=True)
class View:
    """How tracks become numbers: the drive's frequency [Hz] and phase [rad], the frames that count, the noise [m].

    t : (T,) frame times [s];  keep : (T,) True for frames that count;  masses : (n,) of the disks
    """

    t: np.ndarray
    keep: np.ndarray
    frequency: float
    phase: float
    masses: np.ndarray
    curve: bool = False

    @property
    def cycles(self) -> float:
        t = self.t[self.keep]
        return float(np.ptp(t) * self.frequency) if len(t) > 1 else 0.0

    @property
    def harmonics(self) -> tuple[int, ...]:
        return HARMONICS if self.cycles >= 1.9 else (1,)

    def numbers(self) -> tuple[Number, ...]:
        """What ``observe`` returns, in its order."""
        if self.curve:
            return (Number("speed", 0, 0, "m/s"),)
        segments = len(self.masses) - 1
        found = [Number("mean", s, 0, "rad") for s in range(segments)]
        for h in self.harmonics:
            found += [Number(kind, s, h, "rad") for kind in ("cos", "sin") for s in range(segments)]
        found += [Number(kind, axis, h, "m") for axis, h in ((1, 1), (0, 2)) for kind in ("head_cos", "head_sin")]
        found += [Number("drift", 0, 0, "m/s"), Number("drift", 1, 0, "m/s"), Number("length", 0, 0, "m")]
        return tuple(found)

    def _design(self, t: np.ndarray, orders: tuple[int, ...], trend: bool) -> np.ndarray:
        turn = 2 * math.pi * self.frequency * t + self.phase
        columns = [np.ones_like(t)]
        for h in orders:
            columns += [np.cos(h * turn), np.sin(h * turn)]
        if trend:
            columns.append(t - t.mean())
        return np.column_stack(columns)

    def observe(self, xy: np.ndarray, noise: float = 0.0) -> np.ndarray:
        """(p,) numbers of tracks xy (T, n, 2) [m], unwrapped, NaN where not seen; see ``numbers`` for their order.

        alpha_s(t) = a_s + sum_h b_sh cos(h theta) + c_sh sin(h theta), theta = 2 pi f t + phase, by least squares;
        ``noise`` [m], one standard deviation: its share in the distance of disks is taken off.
        """
        xy = xy[self.keep]
        t = self.t[self.keep]
        if self.curve:
            # the definition of a curve's speed: displacement of the centre of mass over time, head first positive
            centre = np.tensordot(xy, self.masses / self.masses.sum(), axes=([1], [0]))
            velocity = (centre[-1] - centre[0]) / (t[-1] - t[0])
            forward = xy[0, 0] - xy[0, -1]
            axis = np.array([np.sign(forward[0]) or -1.0, 0.0])
            return np.array([float(velocity @ axis)])
        step = np.diff(xy, axis=1)
        angle = np.arctan2(step[..., 1], step[..., 0])
        orders = (1, 2, 3) if len(self.harmonics) > 1 else (1,)
        out: dict[tuple[str, int, int], float] = {}
        for s in range(angle.shape[1]):
            seen = np.isfinite(angle[:, s])
            found = self._fit(t[seen], np.unwrap(angle[seen, s]), orders, False)
            # the turn nearest to the drive's axis: an angle has no other zero
            out["mean", s, 0] = found[0] - 2 * math.pi * round(found[0] / (2 * math.pi))
            for k, h in enumerate(orders):
                out["cos", s, h], out["sin", s, h] = found[1 + 2 * k], found[2 + 2 * k]
        for a in (0, 1):
            seen = np.isfinite(xy[:, 0, a])
            found = self._fit(t[seen], xy[seen, 0, a], (1, 2), True)
            for k, h in enumerate((1, 2)):
                out["head_cos", a, h], out["head_sin", a, h] = found[1 + 2 * k], found[2 + 2 * k]
            whole = np.isfinite(xy[..., a]).all(axis=1)
            middle = xy[whole][..., a].mean(axis=1)
            out["drift", a, 0] = float(self._fit(t[whole], middle, (1, 2), True)[-1])
        squares = np.nanmean((step**2).sum(axis=2), axis=0) - 4 * noise**2
        out["length", 0, 0] = float(np.mean(np.sqrt(np.maximum(squares, 0.0))))
        return np.array([out[n.kind, n.place, n.harmonic] for n in self.numbers()])

    def _fit(self, t: np.ndarray, value: np.ndarray, orders: tuple[int, ...], trend: bool) -> np.ndarray:
        design = self._design(t, orders, trend)
        found: np.ndarray = np.linalg.lstsq(design, value, rcond=None)[0]
        return found

    def noise_covariance(self, xy: np.ndarray, noise: float, rng: np.random.Generator, draws: int = 60) -> np.ndarray:
        """(p, p) covariance of the numbers from white tracking noise [m] on these tracks, by simulation."""
        if noise <= 0 or self.curve:
            p = len(self.numbers())
            return np.zeros((p, p))
        drawn = [self.observe(xy + rng.normal(0.0, noise, xy.shape), noise) for _ in range(draws)]
        covariance: np.ndarray = np.cov(np.array(drawn), rowvar=False)
        # tens of draws give the sizes, not the weak correlations
        return np.diag(np.diag(covariance)) * 0.3 + covariance * 0.7

    def filmed(
        self, numbers: np.ndarray, *, scale: float = 1.0, tilt: float = 0.0, time_offset: float = 0.0
    ) -> np.ndarray:
        """The same numbers (p,) as the camera of the contract shows them: seen = s R(tilt) true at t + offset."""
        names = self.numbers()
        if self.curve:
            return scale * numbers
        at = {(n.kind, n.place, n.harmonic): k for k, n in enumerate(names)}
        out = numbers.copy()
        # c cos + s sin at a turn further on
        for k, n in enumerate(names):
            if n.kind in ("cos", "head_cos"):
                other = at[n.kind.replace("cos", "sin"), n.place, n.harmonic]
                turn = 2 * math.pi * self.frequency * time_offset * n.harmonic
                c, s = numbers[k], numbers[other]
                out[k] = c * math.cos(turn) + s * math.sin(turn)
                out[other] = s * math.cos(turn) - c * math.sin(turn)
        for k, n in enumerate(names):
            if n.kind == "mean":
                out[k] += tilt
            elif n.kind in ("head_cos", "head_sin", "drift", "length"):
                out[k] *= scale
        a, b = at["drift", 0, 0], at["drift", 1, 0]
        along, across = out[a], out[b]
        out[a] = along * math.cos(tilt) - across * math.sin(tilt)
        out[b] = along * math.sin(tilt) + across * math.cos(tilt)
        # of the head's stroke each axis keeps one harmonic: what the other axis lends at this harmonic is not seen
        for k, n in enumerate(names):
            if n.kind in ("head_cos", "head_sin"):
                out[k] *= math.cos(tilt)
        return out

    def shape(self, numbers: np.ndarray, phases: np.ndarray) -> np.ndarray:
        """(k, segments) angles [rad] over the cycle at ``phases`` (k,) [rad], from means and harmonics."""
        names = self.numbers()
        segments = len(self.masses) - 1
        out = np.zeros((len(phases), segments))
        for value, n in zip(numbers, names, strict=True):
            if n.kind == "mean":
                out[:, n.place] += value
            elif n.kind == "cos":
                out[:, n.place] += value * np.cos(n.harmonic * phases)
            elif n.kind == "sin":
                out[:, n.place] += value * np.sin(n.harmonic * phases)
        return out

    def places(self, numbers: np.ndarray, phases: np.ndarray) -> np.ndarray:
        """(k, n, 2) places of the disks [m] over one cycle, the swimmer's middle at the origin in mid-cycle."""
        names = self.numbers()
        value = {(n.kind, n.place): x for x, n in zip(numbers, names, strict=True) if n.kind in ("drift", "length")}
        angle = self.shape(numbers, phases)
        step = value["length", 0] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        xy = np.concatenate([np.zeros((len(phases), 1, 2)), np.cumsum(step, axis=1)], axis=1)
        xy -= xy.mean(axis=1, keepdims=True)
        when = (phases - math.pi) / (2 * math.pi * self.frequency)
        return xy + when[:, None, None] * np.array([value["drift", 0], value["drift", 1]])

    def distance(self, seen: np.ndarray, predicted: np.ndarray) -> float:
        """Root mean square distance [m] of the disks over one cycle, of two sets of numbers; [m/s] for a curve."""
        if self.curve:
            return abs(float(seen[0] - predicted[0]))
        phases = np.linspace(0, 2 * math.pi, 24, endpoint=False)
        apart = self.places(seen, phases) - self.places(predicted, phases)
        return float(np.sqrt(np.mean(np.sum(apart**2, axis=-1))))
