"""The verdict in sentences (HTML), the same for every kind of recording: the headline, and what a person asks next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..inference.criteria import DEFAULT
from ..inference.judge import HELD_OUT_OFF
from ..inference.mechanisms import APPARATUS, CLAIMED, NOTHING, forms_in_words, not_told_apart
from ..inference.pushes import degrees_of_tilt
from ..inference.result import PAIRS, TOLD, Diagnosis, not_tried
from .words import bodies, counted, escaped, length, listed, number, spoken, times, unit_text

NOISE = 1.3  # an error below this many noise floors is called noise
TWICE = 2.0  # noise floors that a held-out error may reach by the start that it runs on from
FAR = 3.0  # standard errors from what was believed, from which an adjustable has moved
NEARLY = 0.9  # of a mismatch, from which it needs a word why what explains it is not named
STANDARD_ERRORS = 3.92  # in the width of a central 95 %
BEYOND = 37.0  # z where doubles end
HOLD_ANOTHER_OUT = (
    "What is open is what held-out data show: film the same apparatus again and hold that film out "
    "(<code>--hold-out</code>), so that all of this one is learnt from."
)


def percent(share: float) -> str:
    return f"{100 * max(share, 0.0):.0f}\u00a0%"


def unit_of(d: Diagnosis) -> str:
    """Unit of the errors: m or rad; nothing where there are none."""
    return str(d.verdict["fit"]["unit"] or "").partition(" ")[0]


def is_apparatus(name: str) -> bool:
    """Whether a mechanism is the camera, the clock or the tracker, not a law of the scene."""
    return name in APPARATUS


def law_in_words(entry: Mapping[str, Any]) -> str:
    """One entry of ``mechanisms``: a law of one joint says which."""
    name = spoken(entry["name"])
    form = entry["parameters"].get("form")
    if form is not None and form["value"] == "tilt":
        a = next(p["value"] for p in entry["parameters"].values() if isinstance(p["value"], list))
        return f"the tilt of a table by {number(degrees_of_tilt(a), 2)}°"
    if form is not None and form["value"] == "gravity":
        return f"{name} along gravity"
    joint = entry["parameters"].get("joint")
    if joint is None or not isinstance(joint["value"], int | float):
        return name
    factor = entry["parameters"].get("factor")
    if factor is not None and factor["value"] > 1:
        name = name.replace("weak", "stiff")
    return f"{name} (joint {joint['value']:g})"


def _named(d: Diagnosis, apparatus: bool) -> list[str]:
    return list(
        dict.fromkeys(law_in_words(e) for e in d.verdict["mechanisms"] if is_apparatus(e["name"]) == apparatus)
    )


# ---- the headline ----------------------------------------------------------------------------


def headline(d: Diagnosis) -> str:
    """The verdict in one plain sentence (HTML)."""
    v = d.verdict
    withdrawn = [r for r in v["rivals"] if r.get("withdrawn")]
    if withdrawn:
        names = listed(list(dict.fromkeys(spoken(r["name"]) for r in withdrawn)))
        return f"Withdrawn: held-out data are predicted worse with {names} than without, so no law is named."
    if v["verdict"] == "missing_physics":
        text = f"he scene leaves out {listed(_named(d, False))}{on_whom(d)}"
        text = "T" + text if v["complete"] else "The best approximation so far: t" + text
        apparatus = _named(d, True)
        text += f", and the measurement is off: {listed(apparatus)}" if apparatus else ""
        alike = {r["name"] for r in v["rivals"] if r["indistinguishable"]}
        # one is mostly the same law under another name; several are a class, and a class has no one name
        text += f", or one of {len(alike)} other laws that these data cannot tell from it" if len(alike) > 1 else ""
        return f"{text}{_and_more(d)}."
    if v["verdict"] == "measurement":
        return f"The measurement is off, not the physics: {listed(_named(d, True))}{_and_more(d)}."
    if v["verdict"] == "unmodelled":
        text, untried = "Something is missing from the scene, and no law known here describes it", not_tried(v)
        if untried:
            names = listed([spoken(name) for name in untried])
            text = f"Something is missing from the scene, and what it is is open: the time was up before {names} "
            text += f"{'was' if len(untried) == 1 and untried[0] != PAIRS else 'were'} tried"
        near = next((r for r in v["rivals"] if r.get("share") is not None), None)
        if near is None:
            return text + "."
        nearly, form = near["share"] > NEARLY, bool(v["mechanisms"])
        unsure = nearly and not form and not untried
        if unsure:
            text = "Something is missing from the scene, and no law is sure enough to be named"
        explains = "would explain" if unsure else "explains"
        text += f"; what comes closest, {spoken(near['name'])}, {explains} {percent(near['share'])} of it"
        return text + (", and a force without a name leaves far less." if nearly and form else ".")
    later = _off_later(d)
    if v["verdict"] == "recalibrate":
        far = moved(d)
        text = f"{listed(far)} need{'s' if len(far) == 1 else ''} another value"
        return f"Nothing is missing from the scene; {text}." if not later else f"{text}, and {later}."
    if later:
        return f"What was learnt from shows no missing law, but {later}."
    if not v["complete"]:
        return "No missing law is claimed, although what the scene leaves over is not noise."
    return "Nothing is missing: what the scene leaves over is noise."


def _and_more(d: Diagnosis) -> str:
    """The same beside what is named; empty where held-out data are off by no more than its numbers can be."""
    later = _off_later(d, "more")
    return f"; {later}" if later else ""


def _off_later(d: Diagnosis, what: str = "something") -> str:
    """That held-out data are off by more than the scene leaves in any repeat; empty where they are not."""
    errors = d.verdict["fit"]["heldout"]
    left, floor = errors["revised"], errors["noise_floor"]
    if d.verdict["complete"] or d.right_law is None or not left or not floor or left <= max(d.right_law):
        return ""
    ratio = times(left / floor)
    return f"held-out data are off by {ratio} times the noise floor: {what} is missing that shows there"


def moved(d: Diagnosis) -> list[str]:
    """Adjustables that are not where they were believed to be; all of them where none is far from it."""
    far = []
    for name, p in d.verdict["recalibrated"].items():
        if name not in d.believed or p["low"] is None or p["high"] is None:
            continue
        if abs(p["value"] - d.believed[name][0]) > FAR * (p["high"] - p["low"]) / STANDARD_ERRORS:
            far.append(name)
    return far or list(d.verdict["recalibrated"])


def mobile(d: Diagnosis) -> dict[str, float]:
    """Radius [m] of every body that moves, by its name, in any of the recordings."""
    return {b.id: b.radius for scene in d.revised.values() for b in scene.bodies if b.mobile}


def on_whom(d: Diagnosis) -> str:
    """Whom the laws act on, where that is not everybody: " on the swimmer"."""
    every = set(mobile(d))
    acting = {b for e in d.verdict["mechanisms"] if not is_apparatus(e["name"]) for b in e["bodies"]}
    if not acting or acting >= every:
        return ""
    if len(acting) <= 2:
        return f" on {listed(bodies(sorted(acting)))}"
    roles = {b.role for scene in d.revised.values() for b in scene.bodies if b.id in acting}
    with_role = {b.id for scene in d.revised.values() for b in scene.bodies if b.mobile and b.role in roles}
    if len(roles) == 1 and with_role == acting and roles <= {"swimmer", "grain"}:
        return " on the swimmer" if roles == {"swimmer"} else " on the grains"
    return f" on {len(acting)} of its {len(every)} bodies"


# ---- what a person asks next -----------------------------------------------------------------


def answers(d: Diagnosis) -> list[tuple[str, str]]:
    """Questions, and their answers in one or two sentences each (HTML); those that do not apply are left out."""
    said = (
        ("What has changed?", _changes(d)),
        ("How much is explained?", _explained(d)),
        ("What is left?", _left(d)),
        ("How much better?", _better(d)),
        ("How sure?", _sure(d)),
        ("Where?", _where(d)),
        ("What else may it be?", _else(d)),
        ("What to measure next?", _next(d)),
    )
    return [(question, answer) for question, answer in said if answer]


def _changes(d: Diagnosis) -> str:
    if d.verdict["verdict"] != "recalibrate":
        return ""
    parts = []
    for name in moved(d):
        before = f", not {number(d.believed[name][0])}" if name in d.believed else ""
        parts.append(f"{escaped(name)} is {number(d.verdict['recalibrated'][name]['value'])}{before}")
    return "; ".join(parts) + "."


def _explained(d: Diagnosis) -> str:
    told = d.verdict["explained"]
    if told is None or d.verdict["verdict"] not in TOLD:
        return ""
    nameless = d.verdict["verdict"] == "unmodelled"
    text = (
        f"{'A force without a name' if nameless else 'It'} explains <strong>{percent(told['share'])}</strong> "
        f"({percent(told['low'])} to {percent(told['high'])}) of what the scene misses on data that the fit did not see"
    )
    text += ", of the training part; the held-out data do not decide" if d.verdict["heldout"] == "undecided" else ""
    if told["best_free_form"] is not None and not nameless:
        text += f"; the best force without a name {percent(told['best_free_form'])}"
    return text + "."


def _left(d: Diagnosis) -> str:
    v = d.verdict
    left = v["remains"]
    if left is None:
        return f"{_quiet(d)}." if v["complete"] and v["mechanisms"] and v["explained"] else ""
    if left.get("alike"):
        return f"{_quiet(d)}; but {escaped(forms_in_words(left['alike']))}: its form is not told."
    size = f", {length(left['rms'], unit_of(d))} rms on such data" if left["rms"] is not None else ""
    floors = left["times_floor"]
    ratio = f", {times(floors)} times the floor" if floors is not None else ""
    whom = f", most of it on {listed(bodies(left['bodies']), 3)}" if left["bodies"] else ""
    t = left["when"]["t"]
    when = "" if not t else f" at {number(t[0])} s" if t[0] == t[1] else f" from {number(t[0])} to {number(t[1])} s"
    like = "" if left["looks_like"] == NOTHING else f"; it looks like {escaped(left['looks_like'])}"
    small = floors is not None and floors < DEFAULT.left.as_small
    why = left.get("why") or ()
    no_noise = "" if why else ", yet not all of it noise"
    much = f"No larger than noise on the whole{no_noise}" if small else "More than noise"
    because = f" It is not complete, as {escaped(' and '.join(why))}." if why else ""
    return f"{much}{size}{ratio}{whom}{when}{like}.{because}"


def _quiet(d: Diagnosis) -> str:
    """That noise is left; of which data, where those that are held out are said to be off by more."""
    errors = d.verdict["fit"]["heldout"]
    final, floor = errors["revised"], errors["noise_floor"]
    off = final and floor and final >= TWICE * floor and final > max(d.right_law or (0.0,))
    return "No more than noise of the data that it was learnt from" if off else "No more than noise"


def _better(d: Diagnosis) -> str:
    """Errors before and after, held against the noise floor."""
    v, unit = d.verdict, unit_of(d)
    if not unit:
        return ""
    part, errors = "held-out", v["fit"]["heldout"]
    if errors["naive"] is None:
        part, errors = "training", v["fit"]["train"]
    naive, final = errors["naive"], errors["revised"]
    if final is None:
        return "No run under the final scene could be finished, so nothing is said about its error."
    shown = f"<strong>{length(final, unit)}</strong> rms"
    if v["verdict"] == "no_mismatch" or naive is None:
        text = f"The {part} error of the scene is {shown}."
    else:
        way = {
            "missing_physics": "With them" if len({e["name"] for e in v["mechanisms"]}) > 1 else "With it",
            "measurement": "Corrected for it",
            "unmodelled": "With a force that has no name" if v["mechanisms"] else "Without any law",
            "recalibrate": "With the new value" + ("s" if len(v["recalibrated"]) > 1 else ""),
        }[v["verdict"]]
        undecided = part == "held-out" and v["heldout"] == "undecided" and v["verdict"] in CLAIMED
        if final < 0.9 * naive or undecided:  # that nothing is decided is said at the end
            changes = "falls" if final <= naive else "grows"
            text = f"{way} the {part} error {changes} from {length(naive, unit)} to {shown}."
        elif part == "held-out" and v["heldout"] == "holds" and final < 1.1 * naive:
            # the pooled error is that of all bodies alike; the test weighs each number by its own noise
            text = (
                f"{way} the held-out error hardly changes: {length(naive, unit)} before, {shown} after. Weighed by "
                "what noise there is in each number, held-out data are predicted better with it, and bear it out."
            )
        elif final <= naive:
            text = (
                f"{way} the {part} error hardly changes: {length(naive, unit)} before, {shown} after. The training "
                f"data ask for it; the {part} data do not confirm it."
            )
        else:
            text = (
                f"{way} the {part} error grows from {length(naive, unit)} to {shown}: the training data ask for it, "
                f"the {part} data do not bear it out."
            )
        if v["verdict"] == "unmodelled" and not v["mechanisms"]:
            text = f"The {part} error of the scene is {shown}."
    right = d.right_law if part == "held-out" else None
    text += " " + remainder(final, naive, errors["noise_floor"], part, _is_noise(v), right or ())
    if v["heldout"] == "undecided" and v["verdict"] in CLAIMED:
        text += " The held-out data do not decide whether it predicts better."
    return text


def _is_noise(verdict: Mapping[str, Any]) -> bool:
    """Whether what is left passes for noise, also where the form of what explains is not told."""
    return bool(verdict["complete"] or (verdict["remains"] or {}).get("alike"))


def remainder(
    final: float, naive: float | None, floor: float | None, part: str, quiet: bool, right_law: Sequence[float] = ()
) -> str:
    """What is left, held against the noise floor, said plainly (HTML).

    ``quiet``: the verdict calls what remains noise, which a mean square near the floor does not tell. A held-out
    error starts from a fitted state, so that in a single recording it may well be twice its mean. ``right_law``:
    least and most that is left of simulated recordings in which nothing else is wrong, when the numbers are found
    from frames as noisy as these.
    """
    if not floor:
        return "How large the noise alone would be is not known."
    ratio = final / floor
    if ratio < NOISE and quiet:
        return "That is what noise alone would leave: nothing is left to explain."
    if ratio < NOISE:
        return (
            f"That is {times(ratio)} times what noise alone would leave: by its size it passes for noise. That what is "
            "left is more shows in other frames, or in its course over time."
        )
    if quiet and len(right_law) and final <= max(right_law):
        return (
            f"That is {times(ratio)} times what noise alone would leave, and no more than is left where the law is "
            f"right and its numbers are found from frames as noisy as these ({times(min(right_law) / floor)} to "
            f"{times(max(right_law) / floor)} times): nothing more is claimed."
        )
    if ratio < TWICE and quiet:
        return (
            f"That is {times(ratio)} times what noise alone would leave on average, and what remains in training "
            "looks like noise: nothing more is claimed."
        )
    text = f"Noise alone would leave about {times(ratio)} times less"
    if naive is not None and naive > final and naive > floor:
        share = 1 - (final**2 - floor**2) / (naive**2 - floor**2)
        shown = f"{100 * share:.0f}" if share < 0.99 else f"{min(100 * share, 99.9):.1f}"
        text += f": {shown} % of the {part} misfit (squared) is explained, <strong>the rest is not</strong>"
    else:
        text += ": <strong>that remainder is unexplained</strong>"
    return text + "."


def chance(null: Mapping[str, Any]) -> tuple[int, str]:
    """How many of the tries in noise reach the case, and p as it may be claimed."""
    p, tries = null["p_false_alarm"], null["replicates"]
    reach = max(round(p * (tries + 1)) - 1, 0)
    return reach, f"p {'≤' if reach == 0 else '='} {number(p, 2)}"


def _sure(d: Diagnosis) -> str:
    null = d.verdict["null"]
    if not null or not null["replicates"]:
        return ""
    reach, p = chance(null)
    often = "in none" if reach == 0 else f"in {reach}"
    what = "moves the numbers as far" if d.verdict["verdict"] == "recalibrate" else "finds so large a gain"
    tries = counted(null["replicates"], "try", "tries")
    return f"Where nothing is missing the same search {what} {often} of {tries} ({p})."


def _where(d: Diagnosis) -> str:
    """One sentence on the clearest place of the mismatch."""
    places = d.verdict["mismatch"]
    if not places or d.verdict["verdict"] == "no_mismatch":
        return ""
    k = max(range(len(places)), key=lambda k: places[k]["z"] if places[k]["z"] is not None else 0.0)
    place = places[k]
    text = "The scene fails most clearly"
    region = place["where"].get("region")
    if place["bodies"]:
        text += f" on {listed(bodies(place['bodies']), 4)}"
        text += f" ({escaped(region)})" if region else ""
    elif region:
        text += f" at {escaped(region)}"
    if len(d.used) > 1 and k < len(d.places_in) and d.places_in[k]:
        text += f" in {escaped(d.places_in[k])}"
    t, phase = place["when"].get("t"), place["when"].get("phase")
    text += f" from {number(t[0])} to {number(t[1])} s" if t else ""
    if phase and phase != [0.0, 1.0]:
        text += f", between {number(phase[0], 2)} and {number(phase[1], 2)} of the drive's cycle"
    return text + (f" (z = {place['z']:.1f})." if place["z"] <= BEYOND else f" (z over {BEYOND:.0f}).")


def _else(d: Diagnosis) -> str:
    """What may stand in place of what was named: a number of the scene first, then the laws."""
    numbers = [f"A number of the scene may be another than believed: {escaped(told)}." for told in d.instead]
    return " ".join([*numbers, _other_laws(d)]).strip()


def _other_laws(d: Diagnosis) -> str:
    if alike := not_told_apart(d.verdict, spoken, listed):
        return f"{alike[0].upper()}{alike[1:]}."
    # what came closest, of which the headline tells, is the first
    rivals = [r for r in d.verdict["rivals"] if not r.get("withdrawn")]
    if rivals and d.verdict["mechanisms"]:
        return f"The nearest rival is {spoken(rivals[0]['name'])}; these data tell the two apart."
    return ""


def _next(d: Diagnosis) -> str:
    why = (d.verdict["remains"] or {}).get("why") or ()
    return " ".join(filter(None, (HOLD_ANOTHER_OUT if HELD_OUT_OFF in why else "", _proposed(d))))


def _proposed(d: Diagnosis) -> str:
    proposal = d.verdict["next_experiment"]
    if not proposal:
        return ""
    names = listed([spoken(n) for n in proposal["separates"]])
    apart = f" parts {names}" if names else ""
    change = escaped(proposal["change"])
    d_prime = proposal.get("d_prime")
    if d_prime is not None and d_prime < d.criteria.verdict.decides:
        told = change if change.startswith("none") else f"none that was thought of would decide; the best is {change}"
        return f"{told[:1].upper()}{told[1:]} (d′ = {number(d_prime, 2)})."
    text = f"<strong>{change[:1].upper()}{change[1:]}</strong>" + (f": it{apart}" if names else "")
    if d_prime is None:
        return text + "."
    sure = "which would settle it" if d_prime > d.criteria.verdict.settles else "which is likely to show"
    # d' is an expectation under the winner, the loser refitted
    alone = "" if d.verdict["complete"] else " if nothing else is missing"
    return f"{text}, with an expected d′ = {number(d_prime, 2)} after the other law is refitted, {sure}{alone}."


def unit_shown(unit: str) -> str:
    return unit_text(unit) or "1"
