"""What the apparatus may have done to the picture and its clock: candidates beside the laws, and judged as they are."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..laws import Law
from .criteria import current
from .data import Case, with_gravity
from .hypothesis import Free, Term, set_camera

HANGING = ("pendulum", "tether")  # what such a law holds is seen in the picture, and so is the place it hangs from


def camera_terms(cases: Sequence[Case]) -> list[Term]:
    """What the apparatus may have done: seen = s R(angle) true + b, at t + offset."""

    rate = cases[0].recording.sampling or 1.0 / float(np.median(np.diff(cases[0].t)))
    positions = any(c.kind != "angle" for case in cases for c in case.channels)
    terms, ends = [], current().apparatus
    level = ends.off_level if with_gravity(cases) else 0.0
    tilt = Free("camera.tilt", "rad", -ends.tilt, ends.tilt, 0.0, ends.scale, unseen=level)
    offset = Free("camera.time_offset", "s", -ends.offset, ends.offset, 0.0, ends.frame / rate)
    if positions:
        off = current().verdict.scale_off
        scale = Free("camera.scale", "1", 1 - off, 1 + off, 1.0, ends.scale, None, 1.0, usual=ends.usual_scale)
        terms.append(Term("camera_scale", "camera_scale", (scale,), set_camera("scale"),
                          expression="seen = s true", groups=(("s", (0,)),)))  # fmt: skip
    swings = any(c.recording.scene.joints_of for c in cases)
    if swings or len({c.kind for case in cases for c in case.channels} - {"angle"}) != 1:
        # of one coordinate alone no direction was seen
        terms.append(Term("camera_tilt", "camera_tilt", (tilt,), set_camera("tilt"),
                          expression="seen = R(+angle) true", groups=(("angle", (0,)),)))  # fmt: skip
    if positions:
        terms += _about_where_they_hang(terms, cases)
    if any(c.recording.scene.inputs or c.recording.scene.laws_as("stroke") for c in cases):
        terms.append(
            Term("time_offset", "time_offset", (offset,),
                 set_camera("time_offset"), expression="a frame stamped t shows the state at t + offset",
                 groups=(("offset", (0,)),))
        )  # fmt: skip
    held = any(_holds(item.law) for c in cases for item in c.recording.scene.laws)
    if positions and (held or any(c.recording.scene.walls for c in cases)):
        longest = max(float(np.ptp(c.t)) for c in cases)
        terms.append(
            Term("camera_drift", "camera_drift",
                 tuple(Free(f"camera.drift_{k}", "m/s", -ends.bias / longest, ends.bias / longest, 0.0,
                            ends.shift / longest) for k in "xy"),
                 set_camera("drift"), expression="seen = true + u (t - t_0), t_0 the first frame",
                 groups=(("u", (0, 1)),), special=True)
        )  # fmt: skip
    if positions and held:
        terms.append(
            Term("tracking_bias", "tracking_bias",
                 tuple(Free(f"camera.bias_{k}", "m", -ends.bias, ends.bias, 0.0, ends.shift) for k in "xy"),
                 set_camera("bias"), expression="seen = true + b", groups=(("b", (0, 1)),))
        )  # fmt: skip
    plain = [t for t in terms if not t.special]
    terms += _zero_terms(cases, level)
    return terms + _of_one_recording(plain, cases) + _oblique_terms(positions) + _lens_terms(cases)


def _zero_terms(cases: Sequence[Case], level: float) -> list[Term]:
    """Sensors of angles whose zeros are off, each by its own: all of them, and of a few any one.

    Of one sensor alone that is a picture that is turned. ``level``: what nobody notices [rad]
    """
    read = list(dict.fromkeys(c.body for case in cases for c in case.channels if c.kind == "angle"))
    if len(read) < 2:
        return []
    ends = current().apparatus
    free = tuple(
        Free(f"camera.zero[{b}]", "rad", -ends.tilt, ends.tilt, 0.0, ends.scale, unseen=level,
             cases=frozenset(c.name for c in cases if b in c.bodies))
        for b in read
    )  # fmt: skip

    def apply_to(bodies: Sequence[str]):
        def apply(scene, camera, values):
            return scene, {**camera, "zeros": tuple((b, float(v)) for b, v in zip(bodies, values, strict=True))}

        return apply

    def term(rows: Sequence[int], label: str) -> Term:
        bodies = tuple(read[k] for k in rows)
        groups = tuple(("b", (k,)) for k in range(len(rows)))
        mine = tuple(free[k] for k in rows)
        return Term("tracking_bias", label, mine, apply_to(bodies), bodies=bodies, expression="seen angle = true + b",
                    groups=groups)  # fmt: skip

    single = range(len(read)) if len(read) <= current().candidates.single else ()
    return [
        term(range(len(read)), "tracking_bias of every angle"),
        *(term([k], f"tracking_bias of the angle of {read[k]}") for k in single),
    ]


def _about_where_they_hang(faults: Sequence[Term], cases: Sequence[Case]) -> list[Term]:
    """Scale and tilt (``faults``) of a picture from which the scene has the place that its bodies hang from.

    The place is where it was seen, whatever the picture: one that is too large does not move bodies away from it.
    None where it is the origin of the picture, or where there are several.
    """
    anchors = {tuple(map(float, item.values["anchor"]))
               for c in cases for item in c.recording.scene.laws if item.law.role in HANGING}  # fmt: skip
    if len(anchors) != 1 or not any(about := next(iter(anchors))):
        return []

    def there(fault: Term) -> Term:
        def apply(scene, camera, values):
            scene, camera = fault.apply(scene, camera, values)
            return scene, {**camera, "about": about}

        return replace(fault, label=f"{fault.label} about the anchor", apply=apply, fixed={"o": (list(about), "m")},
                       expression=fault.expression.replace("true", "(true - o) + o"))  # fmt: skip

    return [there(fault) for fault in faults]


def _of_one_recording(faults: Sequence[Term], cases: Sequence[Case]) -> list[Term]:
    """The same of one recording alone, of several that are learnt from: a camera that was moved between two films."""
    seen = [case.name for case in cases if not case.held_out and case.training.any()]
    if not 1 < len(seen) <= current().candidates.single:
        return []
    return [
        replace(
            fault, label=f"{fault.label} in {name}", expression=f"{fault.expression} in {name}",
            free=tuple(replace(f, name=f"{f.name}@{name}", cases=frozenset([name])) for f in fault.free),
        )
        for fault in faults for name in seen
    ]  # fmt: skip


def _holds(law: Law) -> bool:
    """Whether a law holds bodies to a place of the scene: only there a shift of all positions shows."""
    return (law.kind == "constraint" and law.role != "brake") or any(p.name == "anchor" for p in law.parameters)


def _oblique_terms(positions: bool) -> list[Term]:
    """A camera that looks at the plane of motion at an angle: from below or above, from the side, or from elsewhere.

    Its bounds are those of a scale: lengths along the direction that it shortens are off by no more.
    """
    if not positions:
        return []
    name, off = "camera_foreshortening", current().verdict.scale_off
    factor = Free("camera.foreshortening", "1", 1 - off, 1 + off, 1.0, current().apparatus.scale, None, 1.0)
    turn = current().apparatus.turn
    any_way = Free("camera.direction", "rad", -math.pi, math.pi, math.pi / 4, turn, None, math.pi / 4, inner=True)
    expression = "seen = true - (1 - f) (true . e) e"

    def along(direction: float):
        def apply(scene, camera, values):
            way = float(values[1]) if len(values) > 1 else direction
            return scene, {**camera, "foreshortening": float(values[0]), "direction": way}

        return apply

    terms = [
        Term(name, f"{name} along {axis}", (factor,), along(direction), expression=expression, groups=(("f", (0,)),),
             choices={"axis": axis}, special=True)
        for axis, direction in (("x", 0.0), ("y", math.pi / 2))
    ]  # fmt: skip
    both = (("f", (0,)), ("direction", (1,)))
    sought = f"{name}, its direction sought"
    return [*terms, Term(name, sought, (factor, any_way), along(0.0), expression=expression, groups=both, special=True)]


def _lens_terms(cases: Sequence[Case]) -> list[Term]:
    """A lens that bends the picture about the mean of all tracks; and about a place that is sought, too.

    Its bounds: at the farthest place that was seen the picture is off by no more than a scale may be.
    """
    seen = [c.recording.xy.reshape(-1, 2) for c in cases]
    places = np.concatenate(seen) if seen else np.zeros((0, 2))
    places = places[np.isfinite(places).all(axis=1)]
    if any(c.recording.scene.periodic_x for c in cases) or len(places) < current().candidates.places:
        return []
    middle = places.mean(axis=0)
    away = np.hypot(*(places - middle).T)
    extent = float(away.max())
    if not extent > 0:
        return []

    def apply(scene, camera, values):
        about = tuple(map(float, values[1:])) if len(values) > 1 else tuple(map(float, middle))
        return scene, {**camera, "distortion": float(values[0]), "middle": about}

    most, far = current().verdict.scale_off / extent**2, current().candidates.farthest * extent
    k = Free("camera.distortion", "1/m^2", -most, most, 0.0, current().apparatus.scale / extent**2)
    step = current().apparatus.middle * extent
    o = [
        Free(f"camera.middle_{axis}", "m", m - far, m + far, m, step, None, m, inner=True)
        for axis, m in zip("xy", map(float, middle), strict=True)
    ]
    name, expression = "lens_distortion", "seen = o + (true - o)(1 + k |true - o|^2)"
    fixed = {"o": ([float(m) for m in middle], "m")}
    both = (("k", (0,)), ("o", (1, 2)))
    return [
        Term(name, name, (k,), apply, expression=expression, groups=both[:1], fixed=fixed, special=True),
        Term(name, f"{name}, its middle sought", (k, *o), apply, expression=expression, groups=both, special=True),
    ]
