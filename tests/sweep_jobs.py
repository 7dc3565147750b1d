"""What the tests of sweeps build and measure; a module of its own, so that worker processes can import it."""

import os
from dataclasses import replace

import xarray as xr

from granswim_pymunk.laws import Parameter, law
from granswim_pymunk.scene import Body, Scene, use

VERSION = 1


def ball(c: float = 1e-5, seed: int = 0) -> Scene:
    """A ball thrown into drag, its start given by the seed."""
    scene = Scene(
        bodies=(Body("ball", "free", 1e-2, 1e-3, initial=(0.0, 0.0, 1.0 + 0.1 * seed, 0.0)),),
        laws=(use("linear_drag", c=c),),
    )
    return replace(scene, seed=seed)


def fall(scene: Scene, duration: float = 0.1) -> xr.Dataset:
    """Distance after a time; a ball of seed 3 is refused, one of seed 4 kills its process."""
    from granswim_pymunk.engine import Simulation

    if scene.seed == 3:
        raise ValueError("the ball is lost")
    if scene.seed == 4:
        os._exit(1)
    sim = Simulation(scene, dt=1e-4)
    times = [0.0, duration]
    xy = sim.sample(times)
    return xr.Dataset({"x": float(xy[-1, 0, 0]), "track": ("time", xy[:, 0, 0])}, coords={"time": times})


@law(kind="body", expression="F = -k x", reference="Hooke 1678", parameters=[Parameter("k", "N/m", "stiffness")])
def own_trap(x, y, k):
    return -k * x, -k * y


def trapped(k: float = 1e-3) -> Scene:
    """A ball on a law of the script's own, between walls of the package's."""
    return Scene(
        bodies=(Body("ball", "free", 1e-2, 1e-3, initial=(0.1, 0.0, 0.0, 0.0)),),
        laws=(use(own_trap, k=k), use("linear_drag", c=0.0)),
    )


def swing(scene: Scene, duration: float = 0.01) -> xr.Dataset:
    """Place after a time, in plain Python: a law of one's own is not compiled for a test."""
    from granswim_pymunk.engine import Simulation

    sim = Simulation(scene, mode="python", dt=1e-4)
    return xr.Dataset({"x": float(sim.sample([0.0, duration])[-1, 0, 0])})
