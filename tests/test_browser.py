"""The report in a browser without network: nothing is missing, nothing hangs over the edge.

``GRANSWIM_PICTURES=docs/pictures pytest tests/test_browser.py`` renews the screenshot that the docs show.
"""

import os
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import unseen_world
from PIL import Image

from granswim_pymunk.inference import Diagnosis, diagnose
from granswim_pymunk.inference.packings import diagnose_unseen
from granswim_pymunk.recording import read_recording, resolve_recording
from granswim_pymunk.report import write_diagnosis

NAMES = ("chromium", "chromium-browser", "google-chrome")
PICTURES = os.environ.get("GRANSWIM_PICTURES")
BROWSER = next((found for name in NAMES if (found := shutil.which(name))), None)
pytestmark = pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed: no report is opened in a browser")

# what the page says of itself once it is laid out
PROBE = """<script>addEventListener("load", () => {
  const pictures = [...document.images];
  const say = (name, value) => document.documentElement.setAttribute("data-" + name, value);
  say("pictures", pictures.length);
  say("broken", pictures.filter(p => !p.complete || p.naturalWidth === 0).length);
  say("overhang", document.documentElement.scrollWidth - innerWidth);
  say("requests", performance.getEntriesByType("resource").filter(r => !r.name.startsWith("data:")).length);
  say("first", [...document.querySelectorAll("h1, .law, main > p")].filter(
    e => e.getBoundingClientRect().top < innerHeight).length);
});</script>"""


def opened(page: Path, width: int, height: int, *arguments: str) -> str:
    """Output of a headless browser that cannot reach any host."""
    assert BROWSER is not None
    command = [
        BROWSER, "--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--disable-dev-shm-usage",
        "--host-resolver-rules=MAP * ~NOTFOUND", f"--window-size={width},{height}", "--virtual-time-budget=3000",
        f"--user-data-dir={page.parent / 'profile'}", *arguments, page.as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


@pytest.fixture(scope="module")
def report(tmp_path_factory) -> Path:
    """Of the first eleven seconds of the pendulum, whose page has all that the whole one's has; the docs show that."""
    out = tmp_path_factory.mktemp("pendulum")
    (folder,) = resolve_recording("pendulum")
    whole = read_recording(folder)
    first = slice(None) if PICTURES else slice(0, int(11 * whole.sampling))
    diagnose([replace(whole, t=whole.t[first], xy=whole.xy[first], angle=whole.angle[first])], out)
    return out / "report.html"


def of_films() -> Diagnosis:
    """Of four films of a swimmer whose bed is not seen, in a world whose runs cost nothing."""
    law = unseen_world.world_candidates()["weak_joint at joint 3"]
    return diagnose_unseen(unseen_world.filmed({law.label: [0.85], "stiffness": [1.95e-3]}, 3, 4))


def of_a_curve() -> Diagnosis:
    law = unseen_world.world_candidates()["coulomb_substrate"]
    return diagnose_unseen([unseen_world.curve_of({law.label: [law.design[0, 0]]}, 2)])


@pytest.fixture(scope="module")
def other_reports(tmp_path_factory, bed_with_another_held_out) -> dict[str, Path]:
    """A report of each other kind of recording."""
    found = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("granswim_pymunk.inference.packings.model.Runner", unseen_world.World)
        for kind, make in (
            ("of_a_bed", lambda: bed_with_another_held_out), ("of_films", of_films), ("of_a_curve", of_a_curve)
        ):  # fmt: skip
            out = tmp_path_factory.mktemp(kind)
            write_diagnosis(make(), out)
            found[kind] = out / "report.html"
    return found


@pytest.mark.parametrize("width", [1280, 500])
def test_report_is_whole_in_a_browser(report, tmp_path, width):
    probed = tmp_path / "probed.html"
    text = report.read_text(encoding="utf-8")
    probed.write_text(text.replace("</body>", PROBE + "</body>"), encoding="utf-8")
    page = opened(probed, width, 1000, "--dump-dom")
    says = dict(re.findall(r'data-(\w+)="(-?\d+)"', page))
    assert int(says["pictures"]) == len(list((report.parent / "figures").glob("*.png"))) > 4
    assert says["broken"] == "0" and says["requests"] == "0"
    assert int(says["overhang"]) <= 0
    # verdict, law and what they mean are on the first screen
    assert int(says["first"]) >= 3


# a window is never as narrow as a telephone: the page stands in a frame, and tells the page around it
NARROW = """<!doctype html><script>addEventListener("message", e => {
  for (const [k, v] of Object.entries(e.data)) document.documentElement.setAttribute("data-" + k, v);
});</script><iframe style="border:0" width="%d" height="900" src="%s"></iframe>"""
# a browser without a screen may draw no frame at all: a clock asks for them, and the player moves as by frames
CLOCK = "<script>requestAnimationFrame = draw => setTimeout(() => draw(performance.now()), 16);</script>"
# the page tells when the film has moved, at the latest after 6 s
TELL = """<script>addEventListener("load", () => { let tries = 0; const tell = () => {
  const film = document.querySelector("#film"), canvas = film && film.querySelector("canvas");
  if (film && film.querySelector("input").value === "0" && tries++ < 60) { setTimeout(tell, 100); return; }
  dispatchEvent(new Event("resize"));
  const ink = film ? canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data : [];
  parent.postMessage({
    wide: innerWidth, overhang: document.documentElement.scrollWidth - innerWidth,
    frame: film ? film.querySelector("input").value : -1, drawn: Number(ink.some(v => v > 0)),
    first: [...document.querySelectorAll("h1, .law, main > p")].filter(e => e.getBoundingClientRect().top < 900).length,
    cut: [...document.querySelectorAll("td, th, .values, p, h1, dd")].filter(e => {
      const around = e.closest(".scroll"), edge = around ? around.getBoundingClientRect().right : innerWidth;
      return e.getBoundingClientRect().right > edge + 1;
    }).length,
  }, "*");
}; setTimeout(tell, 500); });</script>"""


def told(report: Path, folder: Path, width: int) -> dict[str, str]:
    """What a page says of itself in a frame of that width."""
    text = report.read_text(encoding="utf-8")
    text = text.replace("<head>", "<head>" + CLOCK, 1).replace("</body>", TELL + "</body>")
    (folder / "told.html").write_text(text, encoding="utf-8")
    (folder / "around.html").write_text(NARROW % (width, "told.html"), encoding="utf-8")
    page = opened(folder / "around.html", 1400, 1000, "--dump-dom", "--virtual-time-budget=9000")
    return dict(re.findall(r'data-(\w+)="(-?\d+)"', page))


@pytest.mark.parametrize("width", [1200, 800, 400])
def test_the_film_plays_and_nothing_is_cut_off(report, tmp_path, width):
    says = told(report, tmp_path, width)
    assert says["wide"] == str(width) and int(says["overhang"]) <= 0 and says["cut"] == "0", says
    assert int(says["frame"]) > 0 and says["drawn"] == "1", says


@pytest.mark.deep
@pytest.mark.parametrize("width", [1200, 800, 400])
@pytest.mark.parametrize("kind", ["of_a_bed", "of_films", "of_a_curve"])
def test_so_it_is_of_every_kind_of_recording(other_reports, tmp_path, kind, width):
    says = told(other_reports[kind], tmp_path, width)
    assert says["wide"] == str(width) and int(says["overhang"]) <= 0 and says["cut"] == "0", says
    # headline, law and at least two answers are on the first screen
    assert int(says["first"]) >= 4
    # a curve of speeds has nothing that could play
    assert (int(says["frame"]) > 0 and says["drawn"] == "1") == (kind != "of_a_curve"), says


def test_screenshot_of_the_docs(report, tmp_path):
    shot = tmp_path / "report.png"
    opened(report, 1000, 1300, f"--screenshot={shot}")
    picture = np.asarray(Image.open(shot).convert("L"))
    assert picture.shape[1] >= 1000 and picture.std() > 10
    if PICTURES:
        Image.open(shot).convert("P", palette=Image.Palette.ADAPTIVE).save(Path(PICTURES) / "report.png", optimize=True)
