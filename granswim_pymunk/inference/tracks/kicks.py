"""Velocities that change at once where the scene has nothing to strike: a stop, a hand, a magnet that was left out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from ... import distributions as stats
from ...joints import arm_of
from ..criteria import current
from ..data import Case, Kick, driven
from ..judge import Remains
from .follow import COUPLED
from .frames import Windows, left_by, windows_of
from .segments import find_cuts, gaps_of, met_by, paths_of


def unexplained(case: Case) -> list[Kick]:
    """Kicks of bodies that touch nothing that the scene has, in order of time; none that the recording is cut at.

    In windows of frames a parabola whose velocity steps once has to follow, and a cubic without a step to be off by
    far; what turns sharply, so that a polynomial of fifth degree follows as well, is none. Not of bodies that follow a
    command, nor of arms that whip about between frames.
    """
    found = []
    for body, xy, noise, rows in _asked(case):
        windows = windows_of(case, body, xy, noise)
        if windows is not None:
            far = [k for k in _kicks(case, body, xy, windows) if _far_from(k.row, rows)]
            near = _before_impacts(body, windows, xy, rows)
            found += [*far, *(k for k in near if _far_from(k.row, [other.row for other in far]))]
    return sorted(found, key=lambda kick: kick.t)


def _far_from(row: int, others: Sequence[int]) -> bool:
    return all(abs(row - other) > current().kicks.half for other in others)


def _before_impacts(body: str, windows: Windows, xy: np.ndarray, struck: Sequence[int]) -> list[Kick]:
    """Kicks in the last frames before a body is ``struck``: a ball that a cue sends to a cushion."""
    found = []
    for row in struck:
        before = np.flatnonzero(windows.rows[:, -1] < row)
        w = int(before[-1]) if len(before) else -1
        if w < 0 or not windows.whole[w] or any(windows.rows[w, 0] <= other < row for other in struck):
            continue
        kick = _late_kick(body, windows, w, xy, (current().kicks.few, current().kicks.half))
        if kick is not None and not _far_from(kick.row, [row]):
            found.append(kick)
    return found


def _asked(case: Case) -> Iterator[tuple[str, np.ndarray, float, list[int]]]:
    """Bodies that may be kicked: their places (T, 2) and noise [m], and rows in which they are struck or kicked."""
    led = driven(case.recording.scene)
    struck = [(b, i.row) for i in find_cuts(case) for b in i.bodies]
    for body, (xy, noise) in paths_of(case).items():
        if body not in led and noise > 0 and _turns_slowly(case, body):
            yield body, xy, noise, [row for b, row in struck if b == body]


def _turns_slowly(case: Case, body: str) -> bool:
    """Whether a body of a linkage turns slowly beside the frames from which a step of its velocity is told.

    An arm of length l that hangs from another one turns by a radian within a third of sqrt(l/g): where so many frames
    take longer, a whip of it is a step. One arm alone turns slowly, and bodies that nothing links.
    """
    scene = case.recording.scene
    links, gravity = scene.laws_as(*COUPLED), float(np.hypot(*scene.gravity))
    if len(links) < 2 or gravity == 0 or not any(body in (item.bodies or ()) for item in links):
        return True
    arms = [arm_of(scene, name) for item in links for name in item.bodies or ()]
    frames = current().kicks.half * float(np.median(np.diff(case.t)))
    return current().kicks.whip * frames < float(np.sqrt(min(arms) / gravity))


def all_kicks(case: Case) -> list[Kick]:
    """Those that the recording is cut at, and others that nothing explains, in order of time."""
    return sorted((*case.kicks, *unexplained(case)), key=lambda kick: kick.t)


def shown_later(case: Case) -> str:
    """What a kick in the held-out frames tells, empty where there is none: whose velocity changes, and when."""
    later = [kick for kick in all_kicks(case) if case.scored[kick.row]]
    if not later:
        return ""
    whose = sorted(_with_first(case, later))
    size = max(float(np.hypot(*kick.change)) for kick in later)
    return f"the velocity of {' and '.join(whose)} changes by up to {size:.2g} m/s at once at t = {later[0].t:.4g} s"


def _with_first(case: Case, kicks: Sequence[Kick]) -> dict[str, Kick]:
    """By body the first of the kicks, and those of other bodies within a few frames of it."""
    near = _few_frames(case)
    return {k.body: k for k in reversed(kicks) if abs(k.t - kicks[0].t) < near}


def _few_frames(case: Case) -> float:
    """Time [s] within which kicks are one."""
    return current().kicks.half * float(np.median(np.diff(case.t)))


def not_of(kicks: Sequence[Kick], acting: Sequence[str], frames: int) -> list[Kick]:
    """Kicks but for those of two bodies in the same few ``frames`` between which a named law acts: it is that law."""
    mine = [kick for kick in kicks if kick.body in acting]
    together = [
        kick for kick in mine
        if any(other.body != kick.body and abs(other.row - kick.row) <= frames for other in mine)
    ]  # fmt: skip
    return [kick for kick in kicks if not any(kick is one for one in together)]


def cut_at_kicks(case: Case) -> Case:
    """The recording with its unexplained kicks of bodies that are alone: they go on at velocities of their own.

    What a stop that the scene has not does can be followed by no law, and would hide all others. Where another body is
    near, or is struck just then, something acts between them, and laws are asked for that. Held-out frames count up to
    the first kick among them.
    """
    c, found = current().kicks, unexplained(case)
    struck = [kick.row for kick in found]
    kicks = tuple(
        kick for kick in found
        if sum(abs(kick.row - row) <= c.half for row in struck) == 1 and _is_alone(case, kick)
    )  # fmt: skip
    if not kicks:
        return case
    learnt = np.flatnonzero(case.start if case.held_out else case.training)
    later = [kick.row for kick in kicks if not len(learnt) or kick.row > learnt[-1]]
    scored = case.scored.copy()
    often = "once" if len(kicks) == 1 else f"{len(kicks)} times"
    notes = [
        f"{case.name}: {often} a body goes on at another velocity where nothing that the scene has strikes it: its "
        "velocity is free from there on"
    ]
    if later and scored[: min(later) - 1].sum() >= c.half:
        scored[min(later) - 1 :] = False
        notes.append(f"{case.name}: held-out frames count up to t = {case.t[min(later) - 1]:.4g} s, where one does")
    # when it came is known to a frame
    values, frame = case.values.copy(), float(np.median(np.diff(case.t)))
    for kick in kicks:
        own = [k for k, channel in enumerate(case.channels) if channel.body == kick.body]
        values[np.ix_(np.flatnonzero(np.abs(case.t - kick.t) < frame), np.array(own))] = np.nan
    return replace(case, values=values, kicks=kicks, scored=scored, notes=(*case.notes, *notes))


def without_struck_last(case: Case) -> Case:
    """The recording without last frames in which a body that is alone goes on at another velocity: a floor, a hand.

    Too few to tell a flight from: the window of the last frames is asked for a step that leaves fewer than
    ``KickCriteria.half`` behind it, by what ``unexplained`` asks of one. Films often go on a little after a fall.
    """
    gone, values = list[str](), case.values.copy()
    for body, xy, noise, struck in _asked(case):
        windows = windows_of(case, body, xy, noise)
        if windows is None or not windows.whole[-1] or max(struck, default=-1) >= windows.rows[-1, 0]:
            continue
        kick = _late_kick(body, windows, -1, xy, (1, current().kicks.half - 1))
        if kick is None or not _is_alone(case, kick):
            continue
        own = [k for k, channel in enumerate(case.channels) if channel.body == body]
        values[kick.row :, own] = np.nan
        last = int(np.sum(windows.rows[-1] >= kick.row))
        gone.append(
            f"{case.name}: the last {f'{last} frames' if last > 1 else 'frame'} of {body}, from t = "
            f"{case.t[kick.row]:.4g} s on, left out: its velocity has changed by {float(np.hypot(*kick.change)):.2g} "
            "m/s at once, and nothing that the scene has strikes it: a floor, a hand?"
        )
    return replace(case, values=values, notes=(*case.notes, *gone)) if gone else case


def _late_kick(body: str, windows: Windows, w: int, xy: np.ndarray, after: tuple[int, int]) -> Kick | None:
    """The kick of a body in its window w that leaves so many frames ``after`` it, from the least to the most."""
    c, rows, s, places = current().kicks, windows.rows[w], windows.s[w], windows.places[w].T
    left = (left_by(degree, windows.s[[w]], windows.places[[w]]) for degree in (c.smooth, c.turning))
    smooth, turning = (float(chi2[0] / windows.variance[w]) for chi2 in left)
    ends = [len(rows) - count for count in range(after[0], after[1] + 1)]
    found = min((with_step(s, places, before) for before in reversed(ends)), key=lambda f: f[0])
    # a path that is bent, or seen less well at its end, leaves more than noise: against that chi2 is held
    off, freedom = found[0] / float(windows.variance[w]), _freedom()
    level = max(off / freedom, 1.0)
    if not _is_step(min(off, freedom), smooth / level, turning / level):
        return None
    first = min(int(np.searchsorted(s, found[1])), len(rows) - 1)
    if first < ends[-1]:
        return None
    at = float(windows.times[w, 0] + found[1] * windows.span[w])
    return Kick(body, int(rows[first]), at, xy[rows[first]], found[2] * windows.noise / windows.span[w])


def chance_of_one() -> float:
    """That noise gives as much to the two numbers of a step of the velocity as is asked of a kick."""
    return float(stats.chi2.sf(current().kicks.sure, 2))


def remains_of_kicks(cases: Sequence[Case]) -> Remains:
    """What is left where all but unexplained kicks is noise."""
    kicks = [kick for case in cases for kick in case.kicks if case.training[kick.row]]
    when = min(kick.t for kick in kicks), max(kick.t for kick in kicks)
    bodies = tuple(dict.fromkeys(kick.body for kick in kicks))
    size = max(float(np.hypot(*kick.change)) for kick in kicks)
    several = f", {len(kicks)} times" if len(kicks) > 1 else ""
    looks = f"a velocity that changes by up to {size:.2g} m/s at once{several}: a stop, a hand, another body"
    return Remains(None, None, bodies, when, None, looks)


def told_of_few(case: Case) -> list[str]:
    """Notes on bodies that move evenly, and from then on evenly at another velocity, in films of few sightings.

    There a step lies in most windows from which noise is told, which is then as large as the step makes it. Of all
    sightings two lines, each through four at least, are held against one polynomial of fifth degree; noise is what
    each leaves. What meets something just then, or follows a command, is none of these.
    """
    c, scene, notes = current().kicks, case.recording.scene, list[str]()
    window, led = 2 * c.half, driven(scene)
    struck = {b for i in find_cuts(case) for b in i.bodies} | {kick.body for kick in all_kicks(case)}
    for body, (xy, _) in paths_of(case).items():
        seen = np.flatnonzero(np.isfinite(xy).all(axis=1))
        if body in led | struck or not 2 * c.few <= len(seen) < 2 * window:
            continue
        t, places = case.t[seen], xy[seen][:, np.ptp(xy[seen], axis=0) > 0]
        smooth = len(t) * np.log(_squares(t, places, c.turning)).sum()
        left = {
            k: len(t) * float(np.log(_squares(t[:k], places[:k], 1) + _squares(t[k:], places[k:], 1)).sum())
            for k in range(c.few, len(t) - c.few + 1)
        }
        k = min(left, key=lambda row: left[row])
        if smooth - left[k] > c.sure:
            parts = (slice(k), slice(k, None))
            was, now = (float(np.hypot(*np.polyfit(t[part], xy[seen][part], 1)[0])) for part in parts)
            notes.append(
                f"{case.name}: {body} moves evenly with {was:.2g} m/s until t = {t[k - 1]:.4g} s, and evenly with "
                f"{now:.2g} m/s from t = {t[k]:.4g} s on: a blow in between, which no law of motion is?"
            )
    return notes


def _squares(t: np.ndarray, places: np.ndarray, degree: int) -> np.ndarray:
    """(c,) sums of squares that a polynomial of a degree leaves of places (n, c) at t (n,)."""
    s = (t - t[0]) / (t[-1] - t[0])
    design = np.power(s[:, None], np.arange(degree + 1))
    off = places - design @ np.linalg.lstsq(design, places, rcond=None)[0]
    return np.asarray(np.sum(off**2, axis=0)) + np.finfo(float).tiny


def _is_alone(case: Case, kick: Kick) -> bool:
    """Whether all that a body may meet is farther from it than bodies that touch act on each other.

    What is lost in that very frame is where it was seen about it; what is not seen about it has left the picture.
    """
    half, clear = current().kicks.half, current().kicks.clear * case.recording.scene.body(kick.body).radius
    about = slice(max(kick.row - half, 0), kick.row + half + 1)
    for gap in gaps_of(case, kick.body):
        seen = gap[about][np.isfinite(gap[about])]
        nearest = gap[kick.row] if np.isfinite(gap[kick.row]) else seen.min(initial=np.inf)
        if nearest <= clear:
            return False
    return True


def _kicks(case: Case, body: str, xy: np.ndarray, windows: Windows) -> list[Kick]:
    """Kicks of one body in the middle of its ``windows``; xy : (T, 2) places [m]."""
    c = current().kicks
    size, s, places, variance = 2 * c.half, windows.s, windows.places, windows.variance
    smooth, turning = (left_by(d, s, places) / variance for d in (c.smooth, c.turning))
    best: list[tuple[float, int, np.ndarray, float]] = []
    for w in np.flatnonzero((smooth > c.sure) & windows.whole).tolist():
        off, when, change = with_step(s[w], places[w].T, c.half)
        off /= variance[w]
        if _is_step(off, smooth[w], turning[w]):
            best.append((off - smooth[w], w, change * windows.noise / windows.span[w], when))
    kicks: list[Kick] = []
    for _, w, change, when in sorted(best, key=lambda found: found[0]):
        at = float(windows.times[w, 0] + when * windows.span[w])
        row = int(np.searchsorted(case.t, at))
        if all(abs(row - other.row) > size for other in kicks):
            kicks.append(Kick(body, row, at, xy[int(windows.rows[w, c.half])], change))
    return kicks


def _is_step(off: float, smooth: float, turning: float) -> bool:
    """Whether a step of the velocity is what a window shows: chi2 of a parabola with one, of a cubic, of a quintic."""
    c, freedom = current().kicks, _freedom()
    ahead = turning - off > c.turns and smooth - off > c.sure
    return ahead and smooth - freedom > c.times * (off - freedom) and off < c.most * freedom


def _freedom() -> int:
    """Degrees of freedom that a parabola with a step leaves in a window."""
    return 2 * (2 * current().kicks.half - 4) - 1


def with_step(s: np.ndarray, places: np.ndarray, half: int) -> tuple[float, float, np.ndarray]:
    """What a parabola whose velocity steps once leaves of ``places`` (n, 2) at s (n,), when it steps, and by how much.

    The step lies about the middle: in between two frames, or within one. A body that is fast moves many times the noise
    in a part of a frame, so that its time is sought more and more finely.
    """
    low, high = s[half - 2], s[min(half + 1, len(s) - 1)]
    found: list[tuple[float, float, np.ndarray]] = []
    for _ in range(current().kicks.rounds):
        grid = np.linspace(low, high, 7)
        for when in grid.tolist():
            design = np.column_stack([np.ones(len(s)), s, s**2, np.maximum(s - when, 0.0)])
            numbers, *_ = np.linalg.lstsq(design, places, rcond=None)
            found.append((float(np.sum((places - design @ numbers) ** 2)), when, numbers[3]))
        best = min(found, key=lambda f: f[0])
        low, high = max(low, best[1] - (grid[1] - grid[0])), min(high, best[1] + (grid[1] - grid[0]))
    return best


def told(case: Case, kicks: list[Kick]) -> str:
    """One sentence of the first kicks: when, where, whose, and how far they are from each other."""
    first, near, now = kicks[0], _few_frames(case), _with_first(case, kicks)
    later = len(kicks) - len(now)
    size = max(float(np.hypot(*k.change)) for k in now.values())
    text = (
        f"{case.name}: at t = {first.t:.4g} s, x = {first.place[0]:.3g} m, y = {first.place[1]:.3g} m the velocity of "
        f"{' and '.join(sorted(now))} changes by {size:.2g} m/s within a frame or two"
    )
    if later:
        text += f" (so does one {later} times later)" if later > 1 else " (and once later)"
    none = "; the scene has no law of contact for them (contact_elastic, contact_linear)"
    untouched = "" if case.recording.scene.laws_as("contact") else none
    if len(now) > 1:
        there = {b: xy[np.abs(case.t - first.t) < near] for b, (xy, _) in paths_of(case).items() if b in now}
        gaps = [np.hypot(*(there[a] - there[b]).T) for a, b in combinations(there, 2)]
        apart = float(np.nanmin(np.concatenate(gaps)))
        return text + f", {apart:.2g} m from each other: something acts between them{untouched}"
    beside = _beside(case, first) if untouched else ""
    if beside:
        return text + f", where it meets {beside}{untouched}"
    return text + ", where nothing that the scene has touches it: a stop, a hand, another body?"


def _beside(case: Case, kick: Kick) -> str:
    """The body that one touches when its velocity changes, to within what they move in a frame; empty for none."""
    scene, paths, nearest = case.recording.scene, paths_of(case), ("", 0.0)
    about, radius = np.abs(case.t - kick.t) < _few_frames(case), scene.body(kick.body).radius
    others = [name for name in paths if name != kick.body]
    for name, _, size, gap in met_by(kick.body, others, paths, scene):
        seen = gap[about][np.isfinite(gap[about])]
        if name in others and len(seen) > 1:
            room = seen.min() - current().segments.near * (radius + size) - np.abs(np.diff(seen)).max()
            nearest = min(nearest, (name, float(room)), key=lambda found: found[1])
    return nearest[0]
