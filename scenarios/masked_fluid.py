"""A fluid between the grains that nobody told the simulation of, and a calibration that hides it.

The films are computed by the simulator of the proof, which shares no force code with the engine; the drag of the fluid
grows with the square of the speed. The believed scene has a viscous confinement instead. Its mu_eff is calibrated until
the swimmer's disks are as fast as filmed on the whole, which hides the fluid; then ``diagnose`` is asked, with films at
two other frequencies held out.

    python masked_fluid.py [FOLDER] [MINUTES]
"""

import sys
from dataclasses import replace
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from granswim_pymunk.engine import Simulation
from granswim_pymunk.inference.entry import ProgressLine, diagnose
from granswim_pymunk.packing import pack
from granswim_pymunk.proof.world import Effect, World
from granswim_pymunk.recording import Recording, write_recording
from granswim_pymunk.scene import Adjustable, Scene, read_scene, use

TRAINING, UNSEEN = (9.0,), (7.0, 12.0)  # Hz
FLUID = 1.5e-3  # kg/m
DRY = 0.05  # s/m, the mu_eff of a bed without fluid
TIMES = 0.08 + np.arange(181) / 500.0  # s
NOISE = 2e-5  # m


def bed(frequency: float, seed: int) -> Scene:
    """The small bed as the experimenter believes it, under five layers of grains."""
    scene = read_scene(Path(__file__).parent / "pocket_swim.toml").with_parameter("bending.frequency", frequency)
    scene = pack(replace(scene.with_laws(use("confinement", mu_eff=DRY, layers=5.0)), seed=seed))
    return replace(scene, bed=None, time=replace(scene.time, dt=None))


def true_paths(scene: Scene) -> np.ndarray:
    """(T, n, 2) with the fluid, by the proof's own simulator [m]."""
    return World(scene, [Effect("quadratic_drag", {"c": FLUID, "p": 0})], 4e-6).sample(TIMES, t0=0.0).xy


def speeds(scene: Scene, xy: np.ndarray) -> np.ndarray:
    """(k,) root mean square speed [m/s] of each disk of the swimmer, head first."""
    v = np.gradient(xy[:, list(scene.swimmer)], TIMES, axis=0)
    found: np.ndarray = np.sqrt(np.mean(np.sum(v**2, axis=2), axis=0))
    return found


def simulated(scene: Scene) -> np.ndarray:
    return Simulation(scene, dt=4e-6).sample(TIMES)


def calibrated(scene: Scene, wanted: float) -> float:
    """mu_eff [s/m] with which the believed scene's disks are as fast on the whole: a secant on its logarithm."""
    found = []
    for mu in (DRY, 4 * DRY):
        fast = speeds(scene, simulated(scene.with_parameter("confinement.mu_eff", mu))).mean()
        found.append((np.log(mu), fast - wanted))
    for _ in range(4):
        (a, fa), (b, fb) = found[-2:]
        c = float(np.clip(b - fb * (b - a) / (fb - fa), np.log(0.2 * DRY), np.log(60 * DRY)))
        fast = speeds(scene, simulated(scene.with_parameter("confinement.mu_eff", float(np.exp(c))))).mean()
        found.append((c, fast - wanted))
        if abs(found[-1][1]) < 0.01 * wanted:
            break
    return float(np.exp(min(found, key=lambda item: abs(item[1]))[0]))


def main(out: str = "out/masked_fluid", minutes: float | None = None) -> None:
    folder = Path(out)
    scenes = {f: bed(f, seed=20 + k) for k, f in enumerate((*TRAINING, *UNSEEN))}
    paths = {f: true_paths(scene) for f, scene in scenes.items()}
    first = scenes[TRAINING[0]]
    mu = calibrated(first, float(speeds(first, paths[TRAINING[0]]).mean()))
    print(f"mu_eff: {DRY} s/m believed of a dry bed, {mu:.3g} s/m once the disks' mean speed is calibrated")

    rng = np.random.default_rng(1)
    folders = {}
    for f, scene in scenes.items():
        believed = scene.with_parameter("confinement.mu_eff", mu)
        believed = replace(believed, adjustable=(Adjustable("confinement", "mu_eff", 0.2 * DRY, 100 * DRY),))
        mobile = np.array([b.mobile for b in scene.bodies])
        told = replace(believed, bodies=tuple(replace(b, initial=None) if b.mobile else b for b in scene.bodies))
        seen = paths[f][:, mobile] + rng.normal(0.0, NOISE, paths[f][:, mobile].shape)
        ids = tuple(b.id for b in scene.bodies if b.mobile)
        folders[f] = folder / "recordings" / f"wet_{f:g}_Hz"
        write_recording(Recording(folders[f].name, told, TIMES, ids, seen, sampling=500.0, position_noise=NOISE),
                        folders[f])  # fmt: skip

    found = diagnose(
        [folders[f] for f in TRAINING], folder / "diagnosis", hold_out=[folders[f] for f in UNSEEN], minutes=minutes,
        progress=ProgressLine(),
    )  # fmt: skip
    verdict = found.verdict
    print(f"verdict: {verdict['verdict']}")
    laws = []
    for entry in verdict["mechanisms"]:
        print(f"  {entry['expression']}")
        if entry["name"] != "unknown":
            numbers = {k: v["value"] for k, v in entry["parameters"].items()}
            laws.append(use(entry["name"], **numbers))
    for rival in verdict["rivals"]:
        print(f"  rival: {rival['name']}" + (", cannot be told apart" if rival["indistinguishable"] else ""))
    for part in ("train", "heldout"):
        errors = {k: f"{1e6 * v:.0f}" for k, v in verdict["fit"][part].items() if v is not None}
        print(f"{part} [um rms]: {errors}")

    again = verdict["recalibrated"].get("confinement.mu_eff", {}).get("value") or mu
    draw(folder / "structure.png", scenes, paths, mu, again, laws)
    print(f"pictures: {folder / 'structure.png'}; report: {folder / 'diagnosis' / 'report.html'}")


def draw(file: Path, scenes: dict, paths: dict, mu: float, again: float, laws: list) -> None:
    """Speeds along the swimmer at every frequency: filmed, dry, calibrated, and with what was found."""
    fig, axes = plt.subplots(1, len(scenes), figsize=(10, 3.4), sharey=True, layout="constrained")
    for ax, (f, scene) in zip(axes, sorted(scenes.items()), strict=True):
        dry = speeds(scene, simulated(scene))
        masked = speeds(scene, simulated(scene.with_parameter("confinement.mu_eff", mu)))
        revised = speeds(scene, simulated(scene.with_parameter("confinement.mu_eff", again).with_laws(*laws)))
        filmed = speeds(scene, paths[f])
        k = np.arange(len(filmed))
        ax.plot(k, 1e3 * dry, color="0.6", label=f"dry, mu_eff {DRY:g} s/m")
        ax.plot(k, 1e3 * masked, color="#b3541e", label=f"calibrated, mu_eff {mu:.2g} s/m")
        if laws:
            ax.plot(k, 1e3 * revised, color="#1f6f8b", label="with what was found")
        ax.plot(k, 1e3 * filmed, "ko", ms=4, label="filmed")
        ax.set_title(f"{f:g} Hz" + (", calibrated here" if f in TRAINING else ", never used"))
        ax.set_xlabel("disk, head first")
        rows = [("dry", dry), ("calibrated", masked), ("revised", revised)]
        wrong = ", ".join(f"{name} {1e3 * np.sqrt(np.mean((s - filmed) ** 2)):.1f}" for name, s in rows)
        print(f"{f:g} Hz: mean speed of the disks {1e3 * filmed.mean():.0f} mm/s filmed, {1e3 * dry.mean():.0f} dry, "
              f"{1e3 * masked.mean():.0f} calibrated, {1e3 * revised.mean():.0f} revised; rms over the disks of the "
              f"difference [mm/s]: {wrong}")  # fmt: skip
    axes[0].set_ylabel("rms speed [mm/s]")
    axes[0].set_ylim(bottom=0)
    axes[0].legend(frameon=False, fontsize=8)
    fig.savefig(file, dpi=130)
    plt.close(fig)


if __name__ == "__main__":
    main(*sys.argv[1:2], *(float(m) for m in sys.argv[2:3]))
