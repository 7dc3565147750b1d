"""The report in a browser without network: nothing is missing, nothing hangs over the edge.

``GRANSWIM_PICTURES=docs/pictures pytest tests/test_browser.py`` renews the screenshot that the docs show.
"""

import os
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from granswim_pymunk.inference import diagnose

NAMES = ("chromium", "chromium-browser", "google-chrome")
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
    out = tmp_path_factory.mktemp("pendulum")
    diagnose(["pendulum"], out)
    return out / "report.html"


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
# frames are drawn when the machine has time for them: the page tells when the film has moved, at the latest after 6 s
TELL = """<script>addEventListener("load", () => { let tries = 0; const tell = () => {
  if (document.querySelector("#film input").value === "0" && tries++ < 60) { setTimeout(tell, 100); return; }
  const film = document.querySelector("#film"), canvas = film.querySelector("canvas");
  dispatchEvent(new Event("resize"));
  const ink = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  parent.postMessage({
    wide: innerWidth, overhang: document.documentElement.scrollWidth - innerWidth,
    frame: film.querySelector("input").value, drawn: Number(ink.some(v => v > 0)),
    cut: [...document.querySelectorAll("td, th, .values")].filter(e => {
      const around = e.closest(".scroll");
      return !around && e.getBoundingClientRect().right > innerWidth + 1;
    }).length,
  }, "*");
}; setTimeout(tell, 500); });</script>"""


@pytest.mark.parametrize("width", [1200, 800, 400])
def test_the_film_plays_and_nothing_is_cut_off(report, tmp_path, width):
    text = report.read_text(encoding="utf-8")
    assert 'id="film"' in text
    (tmp_path / "told.html").write_text(text.replace("</body>", TELL + "</body>"), encoding="utf-8")
    (tmp_path / "around.html").write_text(NARROW % (width, "told.html"), encoding="utf-8")
    page = opened(tmp_path / "around.html", 1400, 1000, "--dump-dom", "--virtual-time-budget=9000")
    says = dict(re.findall(r'data-(\w+)="(-?\d+)"', page))
    assert says["wide"] == str(width) and int(says["overhang"]) <= 0 and says["cut"] == "0"
    assert int(says["frame"]) > 0 and says["drawn"] == "1", says


def test_screenshot_of_the_docs(report, tmp_path):
    shot = tmp_path / "report.png"
    opened(report, 1000, 1300, f"--screenshot={shot}")
    picture = np.asarray(Image.open(shot).convert("L"))
    assert picture.shape[1] >= 1000 and picture.std() > 10
    folder = os.environ.get("GRANSWIM_PICTURES")
    if folder:
        Image.open(shot).convert("P", palette=Image.Palette.ADAPTIVE).save(Path(folder) / "report.png", optimize=True)
