"""Why does my swimmer not move as simulated? Only the swimmer was tracked; the grains were not.

Four films of one swimmer are made here with dry friction at its substrate, which the simulation does not know;
with films of your own, leave ``film_all`` out and give their folders to ``granswim diagnose``.

python -m granswim_pymunk.scenarios.unseen_bed [FOLDER] [SCENE]

A film of the whole bed takes a minute, the diagnosis of four of them about half an hour on two cores. The small
bed of pocket_swim.toml is four times as fast.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from granswim_pymunk.inference.entry import diagnose
from granswim_pymunk.packing import pack
from granswim_pymunk.recording import film, write_recording
from granswim_pymunk.run import find_scene
from granswim_pymunk.scene import Adjustable, Scene, Time, read_scene, use

FREQUENCIES = (7.0, 9.0, 11.0, 13.0)  # Hz
TIMES = np.arange(400) / 500.0  # s


def film_all(believed: Scene, folder: Path) -> list[Path]:
    """The true swimmer rubs on its substrate; each film has a packing of its own and 20 micrometres of noise."""
    folders = []
    for k, frequency in enumerate(FREQUENCIES):
        scene = believed.with_parameter("bending.frequency", frequency)
        true = pack(replace(scene, seed=100 + k, adjustable=())).with_laws(use("coulomb_substrate", mu=0.3))
        # the camera sees the swimmer only
        seen = replace(true, bodies=tuple(replace(b, observed=b.role in ("head", "tail")) for b in true.bodies))
        filmed = film(seen, TIMES, rng=np.random.default_rng(k), noise=2e-5, name=f"swimmer_{frequency:g}_Hz")
        # what the experimenter writes down: the bed by its numbers, the laws that are believed
        folders.append(folder / filmed.name)
        write_recording(replace(filmed, scene=scene), folders[-1])
        print(f"filmed {folders[-1]}", flush=True)
    return folders


def main(out: str = "out/unseen_bed", scene: str = "swim") -> None:
    believed = read_scene(find_scene(scene))
    believed = replace(
        believed, time=Time(), frames={}, adjustable=(Adjustable("bending", "stiffness", 1e-3, 4e-3),)
    )
    recordings = film_all(believed, Path(out) / "recordings")

    def tell(text: str, share: float) -> None:
        print(f"[{100 * share:3.0f} %] {text}", end="\r", flush=True)

    found = diagnose(recordings, Path(out) / "diagnosis", progress=tell)
    verdict = found.verdict
    print(f"\nverdict: {verdict['verdict']}")
    for entry in verdict["mechanisms"]:
        print(f"  {entry['name']}: {entry['expression']}")
    print(f"report: {Path(out) / 'diagnosis' / 'report.html'}")


if __name__ == "__main__":
    main(*sys.argv[1:])
