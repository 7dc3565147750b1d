"""Effects to be concealed in beds, each with one amount that makes it stronger or weaker."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..scene import Scene
from .beds import BedSetup
from .world import Effect

# amounts beyond which an effect would be laughed at, in units of ``typical``
MOST = {
    "contact_friction": 8.0, "added_mass": 4.0, "coulomb_substrate": 20.0, "restitution": 8.0, "actuator_lag": 10.0,
    "actuator_delay": 10.0, "actuator_saturation": 4.5, "weak_joint": 3.0, "resting_curvature": 8.0,
    "joint_friction": 10.0, "nonlinear_bending": 20.0, "head_force": 20.0, "uniform_force": 30.0,
}  # fmt: skip
SINGLE = ("linear_drag", "quadratic_drag", "coulomb_substrate", "uniform_force", "attraction", "transverse_force")
HEAD = ("actuator_lag", "actuator_delay", "actuator_saturation", "head_force")
CHAIN = ("nonlinear_bending", "joint_friction")
CLASSES = ("swimmer", "grains")


@dataclass(frozen=True)
class Plan:
    """An effect but for its amount. ``grows``: numbers proportional to the amount; ``fixed``: the others.

    ``bodies``: None for all mobile ones, else one of the classes "swimmer", "grains".
    """

    name: str
    grows: Mapping[str, Any]
    fixed: Mapping[str, Any] = field(default_factory=dict)
    bodies: str | None = None
    other: Mapping[str, Any] = field(default_factory=dict)

    @property
    def shown(self) -> float:
        """An amount at which a rival is looked at: clear of chaos, and not far beyond where it is linear."""
        return 1.0 if self.name in ("weak_joint", "actuator_saturation", "restitution", "added_mass") else 2.0

    @property
    def most(self) -> float:
        return MOST.get(self.name, 60.0)

    def at(self, amount: float) -> Effect:
        """The effect with this amount (1: typical)."""
        values = dict(self.fixed)
        for key, unit in self.grows.items():
            values[key] = tuple(amount * u for u in unit) if isinstance(unit, tuple) else amount * unit
        # numbers that say how far from the believed ones
        if self.name == "weak_joint":
            values["factor"] = 1.0 - values.pop("weaker")
        elif self.name == "actuator_saturation":
            values["limit"] = values.pop("amplitude") * (1.0 - values.pop("cut"))
        elif self.name == "restitution":
            values["damping"] = values.pop("believed") * (1.0 + values.pop("more"))
        return Effect(self.name, values, None if self.bodies is None else (self.bodies,), self.other)


def resolved(effect: Effect, scene: Scene) -> Effect:
    """The effect with the ids of its class of bodies in a packed scene."""
    if effect.bodies is None or effect.bodies[0] not in CLASSES:
        return effect
    swims = effect.bodies[0] == "swimmer"
    roles = ("head", "tail") if swims else ("grain",)
    return replace(effect, bodies=tuple(b.id for b in scene.bodies if b.role in roles))


def acting(effect: Effect, swimmer: tuple[str, ...]) -> list[str]:
    """Ids of the swimmer's disks, and "grains", that an effect acts on."""
    if effect.name in HEAD:
        return [swimmer[0]]
    if effect.name in ("weak_joint", "resting_curvature"):
        joint = effect.values.get("joint", "all")
        return list(swimmer) if joint == "all" else [swimmer[int(joint)]]
    if effect.name in CHAIN or effect.bodies == ("swimmer",):
        return list(swimmer)
    if effect.bodies == ("grains",):
        return ["grains"]
    return [*swimmer, "grains"]


def typical(name: str, setup: BedSetup, **choices: Any) -> Plan:
    """An effect in the contract's own form whose amount of one shows in a bed; ``choices`` such as joint, p."""
    bending = setup.scene.laws_named("bending")[0].values
    contact = setup.scene.laws_named("contact_linear")[0].values
    c = 2e-5  # kg/s, ten times a second on a grain
    grows: dict[str, Any]
    fixed: dict[str, Any] = {}
    if name == "linear_drag":
        grows, fixed = {"c": c}, {"p": 0}
    elif name == "quadratic_drag":
        grows, fixed = {"c": 3e-4}, {"p": 0}
    elif name == "ambient_flow":
        grows, fixed = {"c": c}, {"u": (0.04, 0.03)}
    elif name == "added_mass":
        grows = {"beta": 0.2}
    elif name == "coulomb_substrate":
        grows = {"mu": 0.05}
    elif name == "uniform_force":
        grows = {"a": (0.25, 0.2)}
    elif name == "contact_friction":
        grows = {"mu": 0.1}
    elif name == "restitution":
        grows, fixed = {"more": 1.0}, {"believed": float(contact["damping"])}
    elif name == "cohesion":
        grows, fixed = {"force": 2e-5}, {"range": 1e-4}
    elif name == "distance_force":
        grows, fixed = {"s": 2e-6}, {"n": 2.0}
    elif name == "pair_lubrication":
        grows, fixed = {"c": 1e3}, {"range": 1e-4}
    elif name == "wall_drag":
        grows, fixed = {"c": 5 * c}, {"range": 2e-3}
    elif name in ("actuator_lag", "actuator_delay"):
        grows = {"tau": 1.5e-3}
    elif name == "actuator_saturation":
        grows, fixed = {"cut": 0.15}, {"amplitude": float(bending["amplitude"])}
    elif name == "weak_joint":
        grows, fixed = {"weaker": 0.3}, {"joint": 3}
    elif name == "resting_curvature":
        grows, fixed = {"phi_0": 0.06}, {"joint": "all"}
    elif name == "nonlinear_bending":
        grows = {"k_3": 5e-4}
    elif name == "joint_friction":
        grows = {"force": 2e-4}
    elif name == "head_force":
        grows, fixed = {"force": 5e-5}, {"axis": "fixed", "angle": 0.7}
    elif name == "attraction":
        width, height = setup.scene.periodic_x or 0.0, setup.scene.bed.height if setup.scene.bed else 0.0
        grows, fixed = {"strength": 8e-8}, {"size": 8e-3, "centre": (0.6 * width, 0.35 * height)}
    elif name == "phase_drag":
        grows = {"c": 2 * c}
        fixed = {"frequency": float(bending["frequency"]), "phase": 1.0}
    elif name == "transverse_force":
        grows = {"strength": 2 * c}
    else:
        raise ValueError(name)
    return Plan(name, grows, {**fixed, **choices})


def draw(name: str, setup: BedSetup, rng: np.random.Generator, other: bool) -> Plan:
    """An effect with numbers of its own; ``other``: in another functional form than the contract's, if it has one."""
    plan = typical(name, setup)
    grows, fixed = dict(plan.grows), dict(plan.fixed)
    for key, value in grows.items():
        if isinstance(value, tuple):
            size, way = math.hypot(*value), rng.uniform(0, 2 * math.pi)
            grows[key] = (size * math.cos(way), size * math.sin(way))
        elif name in ("resting_curvature", "transverse_force") and rng.random() < 0.5:
            grows[key] = -value
    if name == "ambient_flow":
        size, way = math.hypot(*fixed["u"]) * rng.uniform(0.7, 1.6), rng.uniform(0, 2 * math.pi)
        fixed["u"] = (size * math.cos(way), size * math.sin(way))
    elif "p" in fixed:
        fixed["p"] = int(rng.integers(0, 3 if name == "quadratic_drag" else 2))
    elif name == "weak_joint":
        fixed["joint"] = int(rng.integers(0, 6))
    elif name == "resting_curvature":
        fixed["joint"] = "all" if rng.random() < 0.3 else int(rng.integers(0, 6))
    elif name == "head_force":
        if rng.random() < 0.4:
            fixed = {"axis": "head"}
            grows["force"] *= float(rng.choice([-1.0, 1.0]))
        else:
            fixed["angle"] = float(rng.uniform(-math.pi, math.pi))
    elif name == "attraction" and setup.scene.bed is not None:
        fixed["centre"] = (
            float(rng.uniform(0.3, 0.7)) * (setup.scene.periodic_x or 0.0),
            float(rng.uniform(0.25, 0.75)) * setup.scene.bed.height,
        )
        fixed["size"] = float(rng.uniform(5e-3, 9e-3))
    elif name == "phase_drag":
        fixed["phase"] = float(rng.uniform(0, 2 * math.pi))
    elif "range" in fixed:
        fixed["range"] = float(fixed["range"] * rng.uniform(0.7, 1.4))
    bodies = None
    if name in SINGLE and rng.random() < 0.25:
        bodies = str(rng.choice(CLASSES))
    if bodies == "swimmer" and "p" in fixed:
        fixed["p"] = 0  # disks of one size
    return replace(plan, grows=grows, fixed=fixed, bodies=bodies, other=_other(name, rng) if other else {})


def _other(name: str, rng: np.random.Generator) -> dict[str, Any]:
    sign = float(rng.choice([-1, 1]))
    if name in ("linear_drag", "quadratic_drag", "ambient_flow"):
        return {"power": sign * float(rng.uniform(0.05, 0.15)), "speed": 0.05}
    if name == "added_mass":
        return {"power": sign * float(rng.uniform(0.1, 0.3))}
    if name == "coulomb_substrate":
        return {"form": 1.0, "v_0": float(rng.uniform(2e-3, 6e-3))}
    if name == "contact_friction":
        return {"form": 1.0, "v_0": float(rng.uniform(3e-3, 8e-3))}
    if name == "restitution":
        return {"power": float(rng.uniform(0.1, 0.5)), "overlap": 5e-7}
    if name in ("cohesion", "pair_lubrication"):
        return {"form": 1.0}
    if name == "distance_force":
        return {"screening": float(rng.uniform(2e-3, 5e-3))}
    if name == "wall_drag":
        return {"width": float(rng.uniform(0.15, 0.3))}
    if name == "actuator_lag":
        return {"order": 2}
    if name == "actuator_saturation":
        return {"smooth": float(rng.uniform(6, 12))}
    if name == "joint_friction":
        return {"form": 1.0, "w_0": float(rng.uniform(1.5, 3.0))}
    if name == "nonlinear_bending":
        return {"power": sign * float(rng.uniform(0.1, 0.3))}
    return {}


def rivals_of(setup: BedSetup) -> list[tuple[str, tuple[Plan, ...]]]:
    """Every named mechanism in its own form, a vector as two plans: what a concealed effect is held against."""
    found: list[tuple[str, tuple[Plan, ...]]] = []
    for name in setup.candidates:
        plan = typical(name, setup)
        if name == "uniform_force":
            found.append((name, tuple(replace(plan, grows={"a": a}) for a in ((0.3, 0.0), (0.0, 0.3)))))
        elif name == "ambient_flow":
            # a fast thin flow is a force, a slow one a drag
            fast = [replace(plan, fixed={"u": u}, grows={"c": 1e-6}) for u in ((1.0, 0.0), (0.0, 1.0))]
            found.append((name, (replace(plan, fixed={"u": (0.0, 0.0)}), *fast)))
        elif name == "head_force":
            found.append((name, tuple(replace(plan, fixed={"axis": "fixed", "angle": a}) for a in (0.0, math.pi / 2))))
            found.append((name, (replace(plan, fixed={"axis": "head"}),)))
        elif name == "weak_joint":
            found += [(name, (typical(name, setup, joint=j),)) for j in range(6)]
        elif name == "resting_curvature":
            found += [(name, (typical(name, setup, joint=j),)) for j in ("all", *range(6))]
        else:
            found.append((name, (plan,)))
    return found
