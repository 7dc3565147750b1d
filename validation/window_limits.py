"""``python -m granswim_pymunk.validation.window_limits --page FILE``: what a window through a bed can tell at best.

A window starts from a state that is drawn from what five frames say (the posterior of the starts). An ideal observer
knows that posterior, and how a law moves what is seen afterwards. The best linear one weighs what is seen by
w = C^-1 d, d the mean change by the law and C the covariance of its members with the camera's noise. Half of the
members make w, the other half stand for films: w d / sqrt(var(w y)) of these are standard errors that are no fit to
their own noise. Both halves change places. An observer may look at more or less:

- the numbers that a diagnosis compares, with one covariance for all windows, half of it on its diagonal (as there);
- the same with a covariance of each window's own;
- all disks, or all bodies, in all frames that are not part of the start, with the window's own covariance.

The bed is a small one, filmed by the proof's code, in which nothing is missing and all numbers are known. What the
film itself leaves, in standard deviations of its members, says whether the posterior is true (it is where that is 1).
Nothing that adjustables imitate is taken off.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from granswim_pymunk.engine import Simulation
from granswim_pymunk.inference.criteria import DEFAULT
from granswim_pymunk.inference.windows.windows import BedCase, BedPredictor, bed_case, placed
from granswim_pymunk.proof.beds import draw_bed
from granswim_pymunk.recording import read_recording
from granswim_pymunk.scene import Scene, use
from granswim_pymunk.validation.bed_effects import Row, adjustable, recorded

SEED = 8100
MEMBERS = 48
WINDOWS = 3
LENGTHS = (0.008, 0.016, 0.024)  # s
LAWS: dict[str, Mapping[str, float]] = {
    "coulomb_substrate": {"mu": 0.03},
    "linear_drag": {"c": 1e-5},
    "contact_friction": {"mu": 0.1},
    "cohesion": {"force": 2e-5},
    "weak_joint": {"joint": 4, "factor": 0.9},
}
SHARES = (0.5, 0.1)  # of the covariance, moved to its diagonal


@dataclass(frozen=True)
class View:
    """What an observer looks at in a window: numbers of tracks.

    clean, changed : (N, D) of members without noise under the scene as it is, and with a law, by its name
    noise : (D,) standard deviation of what the camera adds;  film : (D,) of the film
    """

    clean: np.ndarray
    changed: Mapping[str, np.ndarray]
    noise: np.ndarray
    film: np.ndarray


@dataclass
class Told:
    """Standard errors of a law: sums over windows and halves of w d, and of the variance of w y.

    film : w (film - mean) over its standard deviation, of each window
    """

    signal: float = 0.0
    variance: float = 0.0
    film: list[float] = field(default_factory=list)

    @property
    def errors(self) -> float:
        return self.signal / np.sqrt(self.variance) if self.variance > 0 else 0.0


def covariance_of(rows: Sequence[np.ndarray], noise: Sequence[np.ndarray], share: float) -> np.ndarray:
    """(D, D) of members (N, D) about the mean of each window, with the noise (D,); ``share`` goes to the diagonal."""
    left = np.concatenate([(y - y.mean(axis=0)) * np.sqrt(len(y) / (len(y) - 1)) for y in rows])
    found = left.T @ left / len(left)
    found = (1 - share) * found + share * np.diag(np.diag(found))
    return found + np.diag(np.mean([n**2 for n in noise], axis=0) + 1e-18)


def tell(told: dict[str, Told], view: View, covariance: np.ndarray, train: np.ndarray) -> None:
    """Add what one window tells, weights by the members ``train`` (N,) bool, films those that are not."""
    factor = cho_factor(covariance, lower=True)
    for law, changed in view.changed.items():
        w = cho_solve(factor, (changed - view.clean)[train].mean(axis=0))
        others = view.clean[~train] @ w
        variance = float(others.var(ddof=1) + (w * view.noise) @ (w * view.noise))
        told[law].signal += float(w @ (changed - view.clean)[~train].mean(axis=0))
        told[law].variance += variance
        # its prediction is the mean of so many members
        told[law].film.append(float(w @ view.film - others.mean()) / np.sqrt(variance * (1 + 1 / len(others))))


def observe(windows: Sequence[View], pooled: bool, share: float) -> dict[str, Told]:
    """Standard errors of every law by all windows; ``pooled``: one covariance for all."""
    told = {law: Told() for law in windows[0].changed}
    number = len(windows[0].clean)
    for half in (0, 1):
        train = np.arange(number) % 2 == half
        common = covariance_of([v.clean[train] for v in windows], [v.noise for v in windows], share) if pooled else None
        for view in windows:
            own = covariance_of([view.clean[train]], [view.noise], share) if common is None else common
            tell(told, view, own, train)
    for law in told.values():
        # both halves are the same windows
        law.signal, law.variance = law.signal / 2, law.variance / 2
    return told


@dataclass(frozen=True)
class Tracks:
    """Of one window: (N, F, n, 2) of members under each scene [m], frames from the start on, and those of the film."""

    window: int
    clean: np.ndarray
    changed: Mapping[str, np.ndarray]
    film: np.ndarray


def simulated(predictor: BedPredictor, scenes: Mapping[str, Scene], window: int, members: int, frames: int) -> Tracks:
    """Members of a window under several scenes, the first of which is the one without a law."""
    bed = predictor.bed
    first = int(bed.starts[window])
    t = bed.film.t[first : first + frames + 1]
    found = {}
    for name, scene in scenes.items():
        simulation = Simulation(placed(scene, *predictor.start(window, 0)), dt=bed.dt)
        rows = []
        for member in range(members):
            xy, v = predictor.start(window, member)
            simulation.restart(xy, v, float(t[0]))
            rows.append(np.concatenate([xy[None], simulation.sample(t[1:])]))
        found[name] = np.array(rows)
    clean = found.pop(next(iter(scenes)))
    return Tracks(window, clean, found, bed.film.xy[first : first + frames + 1])


def numbers_of(predictor: BedPredictor, tracks: Tracks, what: str, reach: int) -> View:
    """What an observer looks at: "numbers" of a diagnosis at two looks, "disks" or "bodies" in all later frames."""
    bed, sigma = predictor.bed, predictor.film.sigma
    if what != "numbers":
        rows = bed.rows if what == "disks" else np.concatenate([bed.rows, bed.grains])
        rows = rows[np.isfinite(tracks.film[: reach + 1, rows, 0]).all(axis=0)]

        def plain(xy: np.ndarray) -> np.ndarray:
            return xy[..., DEFAULT.windows.starts.half + 1 : reach + 1, rows, :].reshape(*xy.shape[:-3], -1)

        clean = plain(tracks.clean)
        changed = {law: plain(xy) for law, xy in tracks.changed.items()}
        return View(clean, changed, np.full(clean.shape[1], sigma), plain(tracks.film))
    looks = [max(round(reach / 2), DEFAULT.windows.starts.half + 1), reach]
    sums = predictor.sums(tracks.window)
    moved = tracks.clean[:, looks][:, :, bed.grains] - sums.start
    sums = replace(sums, q=sums.sure(moved[::2], sigma))

    def compared(xy: np.ndarray) -> np.ndarray:
        grains = sums.of(xy[looks][:, bed.grains] - sums.start)
        return np.concatenate([xy[looks][:, bed.rows].ravel(), np.nan_to_num(grains).ravel()])

    clean = np.array([compared(xy) for xy in tracks.clean])
    rng = np.random.default_rng(tracks.window)
    shaken = np.array([compared(xy + rng.normal(0.0, sigma, xy.shape)) for xy in tracks.clean])
    changed = {law: np.array([compared(xy) for xy in rows]) for law, rows in tracks.changed.items()}
    return View(clean, changed, (shaken - clean).std(axis=0), compared(tracks.film))


OBSERVERS = (
    ("the numbers compared, one covariance (a diagnosis)", "numbers", True, (0.5,)),
    ("the same, each window's covariance", "numbers", False, SHARES),
    ("disks in all frames", "disks", False, SHARES),
    ("all bodies in all frames", "bodies", False, SHARES),
)


def table(predictor: BedPredictor, tracks: Sequence[Tracks], duration: float) -> str:
    """Markdown: standard errors of each law in a film of ``duration`` [s], by observer and length of windows."""
    spacing = float(np.median(np.diff(predictor.film.t)))
    laws = list(tracks[0].changed)
    lines = ["| window | observer looks at | " + " | ".join(laws) + " | film strays |", "|---" * (len(laws) + 3) + "|"]
    for length in LENGTHS:
        reach = round(length / spacing)
        # windows that a film holds, the frames that only a start is made of between them
        often = np.sqrt(duration / ((DEFAULT.windows.starts.half + reach + 1) * spacing) / len(tracks))
        for name, what, pooled, shares in OBSERVERS:
            views = [numbers_of(predictor, one, what, reach) for one in tracks]
            best = max((observe(views, pooled, s) for s in shares), key=lambda t: sum(x.errors for x in t.values()))
            cells = [f"{often * best[law].errors:.1f}" for law in laws]
            film = np.sqrt(np.mean([z**2 for x in best.values() for z in x.film]))
            strays = f"{film:.1f}" if np.isfinite(film) else "–"  # where it does not show a disk
            lines.append(f"| {1e3 * length:.0f} ms | {name} | " + " | ".join(cells) + f" | {strays} |")
    return "\n".join(lines)


def page(text: str, case: BedCase, members: int, windows: int) -> str:
    """The table with what it is of."""
    told = {law: ", ".join(f"{k} = {v:g}" for k, v in values.items()) for law, values in LAWS.items()}
    return "\n".join([
        "# What a window through a bed can tell at best", "",
        "Made by `python -m granswim_pymunk.validation.window_limits --page FILE`; do not edit.", "",
        f"A small bed of {len(case.grains)} grains, all numbers known, filmed for {np.ptp(case.film.t):.2f} s.",
        "An observer knows the posterior of the starts, and weighs what he looks at in the best linear way: half of",
        f"{members} members of {windows} windows make the weights, the other half stand for films. Numbers are",
        "standard errors of a law in the whole film, what adjustables imitate not taken off. The last column is by how",
        "many standard deviations of its members the film itself strays, in which nothing is missing: 1 where the",
        "posterior is true.",
        "", f"Laws: {'; '.join(f'{law} ({values})' for law, values in told.items())}.", "", text, "",
    ])  # fmt: skip


def bed(folder: Path) -> BedCase:
    """A small bed in which nothing is missing, filmed by the proof's code."""
    setup = adjustable(draw_bed(np.random.default_rng((SEED, 1)), "bed", True), [])
    recorded(Row("nothing", {}, "no_mismatch", known=True), setup, SEED, folder)
    return bed_case(read_recording(folder), split=False)


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--members", type=int, default=MEMBERS, metavar="N", help="of a window under each scene")
    parser.add_argument("--windows", type=int, default=WINDOWS, metavar="N")
    parser.add_argument("--page", type=Path, metavar="FILE", help="write the table here")
    args = parser.parse_args(argv)
    with TemporaryDirectory() as folder:
        case = bed(Path(folder) / "bed")
    predictor = BedPredictor(case, cut=False)
    spacing = float(np.median(np.diff(case.film.t)))
    frames = round(max(LENGTHS) / spacing)
    fitting = np.flatnonzero(case.starts + frames < len(case.film.t))
    chosen = fitting[np.unique(np.round(np.linspace(0, len(fitting) - 1, args.windows)).astype(int))]
    scene = replace(case.scene, adjustable=())
    scenes = {"as it is": scene, **{law: scene.with_laws(use(law, **values)) for law, values in LAWS.items()}}
    tracks = [simulated(predictor, scenes, int(w), args.members, frames) for w in chosen]
    text = table(predictor, tracks, float(np.ptp(case.film.t)))
    if args.page:
        args.page.write_text(page(text, case, args.members, len(chosen)))
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
