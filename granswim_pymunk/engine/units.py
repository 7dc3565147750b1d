"""Engine units: powers of two of the SI units, so that scaling is exact and changes no bit."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..scene import Scene


@dataclass(frozen=True)
class Units:
    """What one engine unit is in SI.

    Chipmunk's broad phase pads boxes by 0.1 time units of velocity and its slop is 0.1 length units:
    in metres and seconds it would be ten times slower, and the slop larger than a grain.
    """

    length: float  # m
    time: float  # s
    mass: float  # kg

    @property
    def velocity(self) -> float:
        """m/s"""
        return self.length / self.time

    @property
    def force(self) -> float:
        """N"""
        return self.mass * self.length / self.time**2

    @property
    def moment(self) -> float:
        """kg m^2"""
        return self.mass * self.length**2

    @property
    def torque(self) -> float:
        """N m"""
        return self.force * self.length

    @classmethod
    def for_scene(cls, scene: Scene) -> Units:
        """A length near the mean radius, about a millisecond, a mass near the mean mass."""
        radius = float(np.mean([b.radius for b in scene.bodies]))
        mobile = [b.mass for b in scene.bodies if b.mobile]
        mass = float(np.mean(mobile)) if mobile else 1.0
        return cls(2.0 ** round(math.log2(radius)), 2.0**-10, 2.0 ** round(math.log2(mass)))
