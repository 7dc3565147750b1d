"""Recording and simulations side by side, playing in the page: a canvas, a slider, no file beside the page.

Where scripts are off nothing of it is shown, and the still figures say the same.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..recording.backdrop import Backdrop, pictures_at
from .words import escaped

MOST_FRAMES = 360
MOST_NUMBERS = 120_000  # coordinates in the page, about 0.5 MB
MOST_PICTURES, ACROSS = 150, 480  # of a real film, and their width [px]: about 1.5 MB
BESIDE = 6.0  # radii of what lies around, by which the picture is wider
STEPS = 8000  # places are told to this part of the width of the picture
SHOWN = {"seen": "recording", "naive": "naive", "recalibrated": "recalibrated", "revised": "revised"}


@dataclass(frozen=True)
class Moving:
    """What plays: points that move, the same ones in each panel.

    t : (F,) times [s];  panels : name -> (F, n, 2) places [m], NaN where there are none; "seen" is the recording
    names, radius : of the points, an empty name for one that is only an end of a line;  (n,) [m]
    fixed : (k, 3) disks that never move, x, y, radius [m];  walls : (k, 5) straight ones, from x, y to
        x, y, and their radius [m]
    lines : pairs of points joined by a line; a pair of a point and a place (x, y) hangs from that place
    held : (F,) whether a frame was held out
    around : (F, g, 2) places [m] of what was recorded beside the points and is drawn behind them in every panel, NaN
        where it was not seen;  around_radius : (g,) [m]
    note : a sentence for the caption
    backdrop : the film that the recording was read from, drawn under every panel; None without one
    """

    t: np.ndarray
    panels: Mapping[str, np.ndarray]
    names: Sequence[str]
    radius: np.ndarray
    held: np.ndarray
    fixed: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    walls: np.ndarray = field(default_factory=lambda: np.zeros((0, 5)))
    lines: Sequence[tuple[int, int | tuple[float, float]]] = ()
    around: np.ndarray = field(default_factory=lambda: np.zeros((0, 0, 2)))
    around_radius: np.ndarray = field(default_factory=lambda: np.zeros(0))
    note: str = ""
    backdrop: Backdrop | None = None

    def thinned(self) -> Moving:
        """With no more frames than a page should carry, the first and last kept."""
        numbers = 2 * (len(self.names) * len(self.panels) + len(self.around_radius))
        most = MOST_FRAMES if self.backdrop is None else MOST_PICTURES
        most = max(2, min(most, MOST_NUMBERS // max(numbers, 1)))
        if len(self.t) <= most:
            return self
        keep = np.unique(np.round(np.linspace(0, len(self.t) - 1, most)).astype(int))
        panels = {name: places[keep] for name, places in self.panels.items()}
        around = self.around[keep] if len(self.around_radius) else self.around
        return replace(self, t=self.t[keep], panels=panels, held=self.held[keep], around=around)


def box(moving: Moving) -> tuple[float, float, float, float] | None:
    """Left, bottom, width and height [m] of all that is drawn; None where nothing is.

    A simulation that flies away does not make the recording a dot: it is cut at twice the recording's size.
    """
    still = np.concatenate([moving.fixed[:, :2], moving.walls[:, :4].reshape(-1, 2)])
    seen = np.concatenate([moving.panels["seen"].reshape(-1, 2), still])
    hung = [place for _, place in moving.lines if not isinstance(place, int)]
    seen = np.concatenate([seen, np.array(hung, dtype=float).reshape(-1, 2)])
    seen = seen[np.isfinite(seen).all(axis=1)]
    every = np.concatenate([places.reshape(-1, 2) for places in moving.panels.values()])
    every = every[np.isfinite(every).all(axis=1)]
    if len(seen) == 0 or len(every) == 0:
        return None
    low, high = seen.min(axis=0), seen.max(axis=0)
    size = max(float((high - low).max()), 2 * float(np.max(moving.radius, initial=0.0)), 1e-9)
    low = np.maximum(np.minimum(low, every.min(axis=0)), low - size)
    high = np.minimum(np.maximum(high, every.max(axis=0)), high + size)
    edge = 1.2 * float(np.max(moving.radius, initial=0.0)) + 0.04 * size
    edge += BESIDE * float(np.max(moving.around_radius, initial=0.0))
    low, high = low - edge, high + edge
    # neither a line nor a ribbon
    least = 0.3 * float((high - low).max())
    middle, span = (low + high) / 2, np.maximum(high - low, least)
    return float(middle[0] - span[0] / 2), float(middle[1] - span[1] / 2), float(span[0]), float(span[1])


def _coded(places: np.ndarray, left: float, bottom: float, size: float) -> list[list[int | None]]:
    """Places as whole numbers, x y x y ..., frame by frame; None where there are none."""
    told = np.round((places - (left, bottom)) / size * STEPS)
    told = np.clip(told, -5 * STEPS, 5 * STEPS)
    return [[None if math.isnan(v) else int(v) for v in frame] for frame in told.reshape(len(places), -1)]


def player(moving: Moving | None) -> str:
    """The panels as HTML with their script; empty where there is nothing to show or only one frame."""
    if moving is None or len(moving.t) < 2:
        return ""
    moving = moving.thinned()
    found = box(moving)
    if found is None:
        return ""
    left, bottom, width, height = found
    size = max(width, height)
    pictures = None if moving.backdrop is None else pictures_at(moving.backdrop, moving.t, ACROSS)
    data: dict[str, Any] = {
        "t": [float(f"{t:.6g}") for t in moving.t],
        "held": [int(h) for h in moving.held],
        "box": [left, bottom, width, height], "size": size, "steps": STEPS,
        "names": list(moving.names), "r": [float(f"{r:.4g}") for r in moving.radius],
        "fixed": [[float(f"{v:.6g}") for v in row] for row in moving.fixed],
        "walls": [[float(f"{v:.6g}") for v in row] for row in moving.walls],
        "lines": [[i, j if isinstance(j, int) else list(j)] for i, j in moving.lines],
        "around": _coded(moving.around, left, bottom, size) if len(moving.around_radius) else [],
        "aroundR": [float(f"{r:.4g}") for r in moving.around_radius],
        "pictures": None if pictures is None else [pictures.data, pictures.shown, pictures.box],
        "panels": [[name, SHOWN[name], _coded(places, left, bottom, size)] for name, places in moving.panels.items()],
    }  # fmt: skip
    # a name of the user's must not end the script
    text = json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    told = ", ".join(SHOWN[name] for name in moving.panels)
    recorded = "Filled: what was recorded" if pictures is None else "The film, with dots at what was recorded"
    return (
        f'<figure id="film" class="film" hidden><canvas role="img" aria-label="{escaped(told)}, playing"></canvas>'
        '<div class="play"><button type="button" aria-label="play or stop">&#9654;</button>'
        f'<input type="range" min="0" max="{len(moving.t) - 1}" value="0" step="1" aria-label="frame">'
        f"<output></output></div><figcaption>{recorded}, in every panel. Rings: the simulation. Lines: "
        "the whole way. Move the slider, or point at a disk for its name and place. A grey band marks frames that were "
        f"held out. {escaped(moving.note)}</figcaption>"
        f'<script type="application/json">{text}</script><script>{SCRIPT}</script></figure>'
    )


SCRIPT = r"""(() => {
const figure = document.currentScript.closest("figure"), canvas = figure.querySelector("canvas");
const film = JSON.parse(figure.querySelector('script[type="application/json"]').textContent);
const slider = figure.querySelector("input"), button = figure.querySelector("button");
const said = figure.querySelector("output"), pen = canvas.getContext("2d");
const [left, bottom, width, height] = film.box, count = film.t.length, panels = film.panels;
const seconds = film.t[count - 1] - film.t[0], lasts = Math.min(Math.max(seconds, 5), 15);
const pictures = (film.pictures ? film.pictures[0] : []).map(text => {
  const picture = new Image(); picture.onload = () => { if (!playing) draw(); };
  picture.src = "data:image/jpeg;base64," + text; return picture;
});
let now = 0, playing = false, before = null, pointed = null, layout = null;
figure.hidden = false;
const style = () => getComputedStyle(document.documentElement);
const unit = film.size < 0.02 ? [1e3, "mm"] : film.size < 2 ? [1e2, "cm"] : [1, "m"];
function lay() {
  const full = figure.clientWidth, n = panels.length, across = full / n < 150 || width > 2.2 * height ? 1 : n;
  const rows = Math.ceil(n / across), gap = 10, w = (full - gap * (across - 1)) / across;
  const h = Math.min(w * height / width, 420), scale = Math.min(w / width, h / height);
  const dpr = window.devicePixelRatio || 1;
  canvas.style.width = full + "px"; canvas.style.height = rows * (h + 22) + "px";
  canvas.width = Math.round(full * dpr); canvas.height = Math.round(rows * (h + 22) * dpr);
  layout = {across, gap, w, h, scale, dpr};
}
function place(k) {
  const {across, gap, w, h} = layout;
  return [(k % across) * (w + gap), Math.floor(k / across) * (h + 22) + 20];
}
const spot = (k, x, y) => {
  const [px, py] = place(k), {w, h, scale} = layout;
  return [px + w / 2 + (x - left - width / 2) * scale, py + h / 2 - (y - bottom - height / 2) * scale];
};
function at(coded, i) {
  const x = coded[2 * i], y = coded[2 * i + 1];
  if (x === null || y === null) return null;
  return [left + x * film.size / film.steps, bottom + y * film.size / film.steps];
}
function disk(k, x, y, r, least) {
  const [px, py] = spot(k, x, y);
  pen.beginPath(); pen.arc(px, py, Math.max(r * layout.scale, least), 0, 2 * Math.PI);
}
function behind(k, frame) {
  const picture = film.pictures && pictures[film.pictures[1][frame]];
  if (!picture || !picture.complete || !picture.naturalWidth) return false;
  const [x, y, w, h] = film.pictures[2], [px, py] = spot(k, x, y + h);
  pen.globalAlpha = 1; pen.drawImage(picture, px, py, w * layout.scale, h * layout.scale);
  return true;
}
function joined(k, coded) {
  for (const [i, j] of film.lines) {
    const a = at(coded, i), b = Array.isArray(j) ? j : at(coded, j);
    if (!a || !b) continue;
    pen.beginPath(); pen.moveTo(...spot(k, ...a)); pen.lineTo(...spot(k, ...b)); pen.stroke();
  }
}
function path(k, frames, i) {
  let drawn = false;
  pen.beginPath();
  for (const coded of frames) {
    const p = at(coded, i);
    if (p) pen[drawn ? "lineTo" : "moveTo"](...spot(k, ...p));
    drawn = p !== null;
  }
  pen.stroke();
}
function draw() {
  const css = style(), ink = css.getPropertyValue("--ink"), soft = css.getPropertyValue("--soft");
  const frame = Math.round(now), seen = panels[0][2][frame];
  pen.setTransform(layout.dpr, 0, 0, layout.dpr, 0, 0);
  pen.clearRect(0, 0, canvas.width, canvas.height);
  pen.font = "13px system-ui, sans-serif";
  panels.forEach(([key, title, frames], k) => {
    const [px, py] = place(k), {w, h} = layout, own = key === "seen" ? ink : css.getPropertyValue("--" + key);
    pen.fillStyle = own; pen.globalAlpha = 1; pen.fillText(title, px + 2, py - 6);
    pen.save(); pen.beginPath(); pen.rect(px, py, w, h); pen.clip();
    pen.fillStyle = css.getPropertyValue("--tint"); pen.fillRect(px, py, w, h);
    const real = behind(k, frame);
    pen.fillStyle = pen.strokeStyle = soft; pen.lineWidth = 2; pen.globalAlpha = 0.5;
    for (const [x, y, r] of film.fixed) { disk(k, x, y, r, 1); pen.fill(); }
    pen.globalAlpha = 0.25;
    film.aroundR.forEach((r, i) => {
      const p = at(film.around[frame], i);
      if (p) { disk(k, ...p, r, 1); pen.fill(); }
    });
    pen.globalAlpha = 0.5;
    for (const [x, y, u, v, r] of film.walls) {
      pen.lineWidth = Math.max(2 * r * layout.scale, 2); pen.lineCap = "round";
      pen.beginPath(); pen.moveTo(...spot(k, x, y)); pen.lineTo(...spot(k, u, v)); pen.stroke();
    }
    pen.strokeStyle = own; pen.lineWidth = 1; pen.globalAlpha = 0.35;
    film.names.forEach((name, i) => { if (name !== "") path(k, frames, i); });
    pen.strokeStyle = pen.fillStyle = ink; pen.lineWidth = 1.5; pen.globalAlpha = key === "seen" ? 0.75 : 0.28;
    joined(k, seen);
    film.r.forEach((r, i) => {
      const p = at(seen, i);
      if (p && film.names[i] !== "") { disk(k, ...p, real ? 0 : r, 2.5); pen.fill(); }
    });
    if (key !== "seen") {
      pen.globalAlpha = 1; pen.strokeStyle = own; pen.lineWidth = 1.8;
      joined(k, frames[frame]);
      film.r.forEach((r, i) => {
        const p = at(frames[frame], i);
        if (p && film.names[i] !== "") { disk(k, ...p, r, 3.5); pen.stroke(); }
      });
    }
    pen.restore();
  });
  pen.globalAlpha = 1;
  const time = `t = ${film.t[frame].toPrecision(4)} s${film.held[frame] ? ", held out" : ""}`;
  said.textContent = pointed ? told(frame) + ", " + time : time;
  slider.value = frame;
}
function told(frame) {
  const {k, i} = pointed, p = at(panels[k][2][frame], i);
  const where = p ? `(${(p[0] * unit[0]).toPrecision(4)}, ${(p[1] * unit[0]).toPrecision(4)}) ${unit[1]}` : "not there";
  return `${film.names[i]}, ${panels[k][1]}: ${where}`;
}
function step(clock) {
  if (!playing) return;
  if (before !== null) now += (clock - before) / 1000 / lasts * (count - 1);
  before = clock;
  if (now > count - 1) now = 0;
  draw(); requestAnimationFrame(step);
}
function play(on) {
  playing = on; before = null; button.innerHTML = on ? "&#10073;&#10073;" : "&#9654;";
  if (on) requestAnimationFrame(step);
}
button.addEventListener("click", () => play(!playing));
slider.addEventListener("input", () => { play(false); now = +slider.value; draw(); });
function point(event) {
  const edge = canvas.getBoundingClientRect(), mx = event.clientX - edge.left, my = event.clientY - edge.top;
  const frame = Math.round(now);
  let best = null, least = 18;
  panels.forEach(([, , frames], k) => film.names.forEach((name, i) => {
    const p = name === "" ? null : at(frames[frame], i);
    if (!p) return;
    const [px, py] = spot(k, ...p), away = Math.hypot(px - mx, py - my) - film.r[i] * layout.scale;
    if (away < least) { least = away; best = {k, i}; }
  }));
  pointed = best;
  if (!playing) draw();
}
canvas.addEventListener("pointermove", point);
canvas.addEventListener("pointerdown", point);
canvas.addEventListener("pointerleave", () => { pointed = null; if (!playing) draw(); });
const held = film.held.indexOf(1);
if (held > 0) {
  const from = (100 * held / (count - 1)).toFixed(1), band = "var(--line)";
  slider.style.background = `linear-gradient(to right, transparent ${from}%, ${band} ${from}%)`;
}
addEventListener("resize", () => { lay(); draw(); });
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
lay(); draw();
figure.dataset.frames = count;
if (!matchMedia("(prefers-reduced-motion: reduce)").matches) play(true);
})();"""
