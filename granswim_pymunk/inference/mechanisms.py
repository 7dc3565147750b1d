"""Mechanisms as sentences call them: laws by their own declaration, the camera and clock by the table below."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from ..laws import all_laws, has_role
from .criteria import current

# name to (how a sentence calls it, what its parameter means)
APPARATUS = {
    "camera_scale": ("the scale of the camera", "scale of the picture"),
    "camera_tilt": ("the tilt of the camera", "turn of the picture against the scene's axes"),
    "time_offset": ("an offset of the clock", "a frame stamped t shows the state at t + offset"),
    "tracking_bias": ("a bias of the tracker", "shift of all positions"),
    "camera_drift": ("a camera that creeps", "speed at which the whole picture moves, from the first frame on"),
    "camera_jump": ("a camera that somebody ran against", "by how much the whole picture is off from then on"),
    "camera_foreshortening": ("a camera that looks at an angle", "what it leaves of lengths along one direction"),
    "lens_distortion": ("a lens that bends the picture", "how far the lens bends the picture, and about which place"),
}
NONE_DIFFERS = "none of these numbers differs from zero by itself"
NOTHING = "nothing that was tried"  # what is left looks like that
CLAIMED = ("missing_physics", "measurement")  # verdicts that name something
OF_PLACE = ("push", "tether", "source")  # roles of laws that hang on nothing but where a body is
UNKNOWN = "unknown"  # the name of a form without one
RESTITUTION = "restitution"  # contacts that lose more, or less, than believed
# mechanisms that no law of their own stands for
_OTHERS = {RESTITUTION: "another restitution", "frame_rate": "another frame rate", UNKNOWN: "a force without a name"}


def nameless(mechanism: str) -> bool:
    """Whether it is a form without a name: a force smooth in place, speed or time, a free response to a command."""
    declared = all_laws().get(mechanism)
    return mechanism == UNKNOWN or (declared is not None and declared.candidate == "flexible")


def field_alone(mechanisms: Iterable[str]) -> bool:
    """Whether laws make no more than a force that is smooth in place: a curved surface, alone or with a push or spring.

    Any such force is that to first order, so that they name nothing where no other law stands beside them.
    """
    names = [*mechanisms]
    beside = [law is not None and law.candidate == "beside" for law in map(all_laws().get, names)]
    return any(beside) and all(b or has_role(m, *OF_PLACE) for b, m in zip(beside, names, strict=True))


def plainly(mechanism: str) -> str:
    """A mechanism in a sentence: ``uniform_force`` is "a uniform force"."""
    if mechanism in APPARATUS:
        return APPARATUS[mechanism][0]
    declared = all_laws().get(mechanism)
    if declared is not None and declared.phrase:
        return declared.phrase
    return _OTHERS.get(mechanism) or mechanism.replace("_", " ")


def rival_names(rivals: Sequence[Mapping[str, Any]]) -> tuple[list[str], list[str]]:
    """Names that these data cannot tell from what is named, and those that do worse, each once."""
    same = dict.fromkeys(r["name"] for r in rivals if r["indistinguishable"])
    told = {*same, *(r["name"] for r in rivals if r.get("withdrawn"))}
    worse = dict.fromkeys(r["name"] for r in rivals if r["name"] not in told)
    return list(same), list(worse)


def worse_rivals(verdict: Mapping[str, Any], name: Callable[[str], str] = str) -> list[tuple[str, list[str]]]:
    """Names that do worse than what was named, each once: in words where, and which.

    Training data decide. What they ask for less may predict held-out data better, by chance or because it is there.
    """
    rivals = verdict["rivals"]
    _, worse = rival_names(rivals)
    of = [*verdict["mechanisms"], *(r for r in rivals if r.get("withdrawn"))]
    mine = next((e["gain_heldout"] for e in of if e["gain_heldout"] is not None), None)
    least = math.inf if mine is None else mine + current().verdict.same
    gains = {r["name"]: r["gain_heldout"] for r in reversed(rivals) if r["gain_heldout"] is not None}
    better = [n for n in worse if gains.get(n, -math.inf) > least]
    told = [
        ("do worse", [n for n in worse if n not in better]),
        ("do worse on the data that were learnt from, and better on held-out data", better),
    ]
    return [(how, list(dict.fromkeys(map(name, names)))) for how, names in told if names]


def not_told_apart(
    verdict: Mapping[str, Any], name: Callable[[str], str] = str, listed: Callable[[list[str]], str] = ", ".join
) -> str:
    """Which laws these data cannot tell from what is named, or was before held-out data turned it down; "" for none.

    name : how a law is called;  listed : how several are
    """
    same, _ = rival_names(verdict["rivals"])
    gone = dict.fromkeys(name(r["name"]) for r in verdict["rivals"] if r.get("withdrawn"))
    if not same:
        return ""
    others = listed(list(dict.fromkeys(map(name, same))))
    if gone and not verdict["mechanisms"]:
        return f"the data that were learnt from could not tell {' and '.join(gone)} from {others}"
    return f"these data cannot tell {'it' if verdict['mechanisms'] else 'what comes closest'} from {others}"


def forms_in_words(alike: Sequence[tuple[str, str, bool]]) -> str:
    """Forms that do as well as a law, or better: (form, law, whether better) each; every one is said once."""
    told = [f"{plainly(f)} does {'better than' if better else 'as well as'} {plainly(law)}" for f, law, better in alike]
    return ", ".join(dict.fromkeys(told))


def meaning(mechanism: str, parameter: str) -> str:
    """What a parameter of a mechanism means, as its law declares it; empty where it is not said."""
    if mechanism in APPARATUS:
        return APPARATUS[mechanism][1]
    declared = all_laws().get(mechanism)
    return next((p.meaning for p in (declared.parameters if declared else ()) if p.name == parameter), "")


def parts_of(name: str, p: Mapping[str, Any]) -> list[tuple[str, Any, Any, Any]]:
    """Name, value and ends of a number; of a vector those of each part."""
    value, low, high = p["value"], p.get("low"), p.get("high")
    if not isinstance(value, list):
        return [(name, value, low, high)]
    ends = [end if isinstance(end, list) else [None] * len(value) for end in (low, high)]
    return [(f"{name}[{k}]", *part) for k, part in enumerate(zip(value, *ends, strict=True))]


def none_differs(parameters: Mapping[str, Mapping[str, Any]]) -> bool:
    """Whether the interval of every number that has one includes zero."""
    ends = [(low, high) for name, p in parameters.items() for _, _, low, high in parts_of(name, p)]
    known = [(a, b) for a, b in ends if a is not None or b is not None]
    return bool(known) and all((a is None or a <= 0) and (b is None or b >= 0) for a, b in known)
