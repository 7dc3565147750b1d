"""Pictures of a scene: the swimmer with its head and axis marked, grains coloured by speed or contact force.

``draw_frame`` draws one state, into given axes if one likes. A ``Painter`` keeps its figure between frames
and is what a run uses. ``video`` makes a GIF or MP4 of PNG frames. Everything given is in SI; the
pictures' labels choose readable units.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import EllipseCollection, LineCollection, PolyCollection
from matplotlib.colors import LinearSegmentedColormap, PowerNorm, to_rgba_array
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from PIL import Image

from .choices import COLORS
from .errors import InputError
from .files import written_whole
from .scene import Scene
from .snapshot import Contacts, State
from .view import View, anchors, inside, is_bed, shrunk, view_of
from .walls import outline

TRAIL = 300  # states
BACKGROUND = "#fdfcfa"
INK = "#22303c"
FAINT = "#8b98a3"
WALL = "#9aa0a6"
HEAD = "#b3122a"
TAIL = "#f2703d"
FREE = "#3d7ea6"
# a bed at rest stays pale, so that what moves or carries force is what one sees; the swimmer is the one
# warm colour in the picture
SPEED_MAP = LinearSegmentedColormap.from_list(
    "granswim_speed", ["#edf1f2", "#c3dde0", "#7fbcc9", "#3a8fb0", "#1f5f96", "#1b2f6b"]
)
FORCE_MAP = LinearSegmentedColormap.from_list(
    "granswim_force", ["#f0efec", "#d9d6e6", "#aea6d0", "#7d6db3", "#533a8f", "#2c125f"]
)


def readable(value: float, unit: str) -> tuple[float, str]:
    """Factor and unit in which a number of this size reads well: (1000.0, "mm/s") for 0.02 and "m/s"."""
    for factor, prefix in ((1.0, ""), (1e3, "m"), (1e6, "µ"), (1e9, "n")):
        if abs(value) * factor >= 1.0:
            return factor, prefix + unit
    return 1.0, unit


def round_up(value: float) -> float:
    """The next of 1, 1.5, 2, 3, 5, 7 times a power of ten."""
    if not value > 0 or not math.isfinite(value):
        return 1.0
    power = 10.0 ** math.floor(math.log10(value))
    for step in (1.0, 1.5, 2.0, 3.0, 5.0, 7.0):
        if value <= step * power * (1 + 1e-9):
            return step * power
    return 10.0 * power


def body_force(contacts: Contacts, n: int) -> np.ndarray:
    """(n,) sum of the sizes of the normal forces on each body [N]."""
    size = np.abs(contacts.force)
    return np.bincount(contacts.i, size, n) + np.bincount(contacts.j, size, n)


def head_angle(scene: Scene, chain: Sequence[int], state: State) -> float:
    """Direction of a head's axis [rad], from the head towards the tail: the commanded one, where there is."""
    for item in scene.laws_named("bending"):
        if item.bodies is None or scene.bodies[chain[0]].id in item.bodies:
            v = item.values
            return float(v["amplitude"] * math.sin(2 * math.pi * v["frequency"] * state.t + v["phase"]))
    if len(chain) < 2:
        return float(state.angle[chain[0]])
    d = state.xy[chain[1]] - state.xy[chain[0]]
    return math.atan2(d[1], d[0])


@dataclass
class Scale:
    """What a picture's colours and edges mean; two pictures with equal scales can be compared."""

    top: float | None = None  # value of the last colour [m/s or N]
    view: View | None = None

    def copy(self) -> Scale:
        return Scale(self.top, self.view)


class Painter:
    """Draws states of one scene into one figure, again and again.

    Parameters
    ----------
    scene : its bodies listed, rows of the states in that order
    color : "speed" or "force": what colours the grains
    top : value of the last colour [m/s or N]; left out, it follows the states (and only grows)
    view : (x low, x high, y low, y high) [m]; left out, the box of a bed, else what the states need
    width : of the picture [pixels]
    ax : axes to draw into, instead of a figure of the painter's own
    trails : draw the paths of mobile bodies (see ``remember``); left out, in scenes of at most 12 bodies
        without a bed
    """

    def __init__(
        self,
        scene: Scene,
        color: str = "speed",
        *,
        top: float | None = None,
        view: View | None = None,
        width: int = 1200,
        ax: Axes | None = None,
        trails: bool | None = None,
    ) -> None:
        if color not in COLORS:
            raise InputError(f"unknown color {color!r}; expected one of {', '.join(COLORS)}")
        self.scene = scene
        self.color = color
        self.bed = is_bed(scene)
        self._fixed_top, self._fixed_view = top, view
        self.scale = Scale(top if top is not None else self._expected(), view or view_of(scene))
        self.radius = np.array([b.radius for b in scene.bodies])
        role = np.array([b.role for b in scene.bodies])
        self.wall = role == "wall"
        self.grain = role == "grain"
        self.chain = np.isin(role, ("head", "tail"))
        mobile = int((~self.wall).sum())
        self.trails = trails if trails is not None else (mobile <= 12 and not self.bed)
        # the view of a bed is known before it moves; elsewhere it is only when the run is over
        self.live = self.bed or view is not None
        self._path: list[np.ndarray] = []
        self._own = ax is None
        self._width = width
        self._ax = ax
        self._built: View | None = None

    def _expected(self) -> float | None:
        """A swimmer stirs its bed about as fast as its head swings the next disk: A 2 pi f 2 r [m/s]."""
        swings = [
            item.values["amplitude"] * 2 * math.pi * item.values["frequency"]
            for item in self.scene.laws_named("bending")
        ]
        if self.color != "speed" or not swings or not self.scene.swimmer:
            return None
        fastest = max(swings) * 2 * self.scene.bodies[self.scene.swimmer[0]].radius
        return round_up(fastest) if fastest > 0 else None

    # ---- scales -------------------------------------------------------------------------------

    def values(self, state: State, contacts: Contacts | None) -> np.ndarray:
        """(n,) what colours the bodies: speed [m/s] or sum of contact forces [N]."""
        if self.color == "force":
            return np.zeros(len(self.radius)) if contacts is None else body_force(contacts, len(self.radius))
        return np.hypot(state.v[:, 0], state.v[:, 1])

    def fit(self, state: State, contacts: Contacts | None = None, force: np.ndarray | None = None) -> None:
        """Widen view and colours so that this state fits in; ``force``: (n,) sums of its contact forces [N]."""
        value = force if force is not None and self.color == "force" else self.values(state, contacts)
        if self._fixed_top is None:
            among = value[self.grain] if self.grain.any() else value[~self.wall]
            # a handful of grains knocked by the tail may be off the scale
            high = float(np.quantile(among, 0.99)) if len(among) else 0.0
            if high > 0 and (self.scale.top is None or high > self.scale.top):
                self.scale.top = round_up(high)
        if self._fixed_view is None and not self.bed:
            need = view_of(self.scene, state.xy)
            now = self.scale.view or need
            # `need` has its margin: only what would touch the edge asks for more
            if inside(shrunk(need, 0.06), now):
                return
            self.scale.view = view_of(self.scene, _corners(now, need, len(self.radius)))

    def settle(self, positions: np.ndarray) -> None:
        """The view that these positions (T, n, 2) [m] need, and no more."""
        if self._fixed_view is None and not self.bed and len(positions):
            self.scale.view = view_of(self.scene, positions)

    # ---- drawing ------------------------------------------------------------------------------

    def _build(self) -> None:
        view = self.scale.view
        assert view is not None
        self._built = view
        wide, tall = view[1] - view[0], view[3] - view[2]
        if self._own:
            width = self._width
            side = 14  # pixels around the box
            top_band, bottom_band = 44, 62
            inner = width - 2 * side
            height = inner * tall / wide + top_band + bottom_band
            height = 2 * round(height / 2)  # video coders want even numbers
            self.figure = Figure(figsize=(width / 100, height / 100), dpi=100, facecolor=BACKGROUND)
            FigureCanvasAgg(self.figure)
            ax = self.figure.add_axes(
                (
                    side / width,
                    bottom_band / height,
                    inner / width,
                    (height - top_band - bottom_band) / height,
                )
            )
            self._bands = (side / width, bottom_band / height, top_band / height, inner, height)
        else:
            assert self._ax is not None
            ax = self._ax
            figure = ax.figure
            assert isinstance(figure, Figure)
            self.figure = figure
        self.ax = ax
        ax.set_xlim(view[0], view[1])
        ax.set_ylim(view[2], view[3])
        ax.set_aspect("equal")
        ax.set_xticks([])
        ax.set_yticks([])
        for spine in ax.spines.values():
            spine.set_visible(False)
        ax.set_facecolor("#ffffff" if self.bed else BACKGROUND)
        self._pixel = wide / (self._width if self._own else 600)  # m
        self._draw_fixed()
        self._make_disks()
        self._make_swimmers()
        if self._own:
            self._make_labels()

    def _draw_fixed(self) -> None:
        """Anchors, rails, ground: what does not change."""
        ax, view = self.ax, self.scale.view
        assert view is not None
        for item in self.scene.laws_named("rail"):
            d = np.array(item.values["direction"])
            d = d / np.hypot(*d)
            for row in self.scene.rows(item):
                initial = self.scene.bodies[row].initial
                if initial is None:
                    continue
                r = self.radius[row]
                side = np.array([-d[1], d[0]]) * (-r if d[0] >= 0 else r)
                far = 2 * max(view[1] - view[0], view[3] - view[2])
                ends = np.array(initial[:2]) + side + np.outer([-far, far], d)
                ax.plot(ends[:, 0], ends[:, 1], color=FAINT, lw=2.0, zorder=1, solid_capstyle="butt")
        size = 0.018 * max(view[1] - view[0], view[3] - view[2])
        for item, _, (x, y) in anchors(self.scene):
            if item.name == "pin":
                ax.add_patch(Rectangle((x - 2 * size, y), 4 * size, 0.7 * size, color=WALL, lw=0, zorder=2))
                ax.plot([x], [y], "o", ms=7, color=INK, zorder=6)
            else:
                ax.plot([x], [y], "s", ms=9, color=INK, zorder=6)
        self._rods = LineCollection([], colors=INK, linewidths=2.2, zorder=3, capstyle="round")
        self._springs = LineCollection([], colors="#56687a", linewidths=1.6, zorder=3, joinstyle="round")
        self._trail = LineCollection([], linewidths=1.6, zorder=2, capstyle="round")
        self._chains = LineCollection([], zorder=5, capstyle="round")
        for collection in (self._rods, self._springs, self._trail, self._chains):
            ax.add_collection(collection, autolim=False)

    def _disks(self, rows: np.ndarray, zorder: float, edge: Any, width: float) -> EllipseCollection:
        # far away, a small ball is still to be seen
        diameter = np.maximum(2 * self.radius[rows], 9 * self._pixel)
        disks = EllipseCollection(
            diameter, diameter, np.zeros(len(rows)), units="xy", offsets=np.zeros((len(rows), 2)),
            offset_transform=self.ax.transData, edgecolors=edge, linewidths=width, zorder=zorder,
        )  # fmt: skip
        self.ax.add_collection(disks, autolim=False)
        return disks

    def _make_disks(self) -> None:
        fine = float(np.median(self.radius)) / self._pixel if len(self.radius) else 0.0
        line = 0.0 if fine < 2 else min(0.05 * fine, 0.9)
        edge = "#5b6b78" if self.grain.any() else INK
        self._bodies = self._disks(np.arange(0), 3, edge, line)
        self._walls = self._disks(np.arange(0), 2, "none", 0.0)
        self._tails = self._disks(np.arange(0), 5.5, "#7c2a10", 0.9)
        self._draw_walls()
        self._map = SPEED_MAP if self.color == "speed" else FORCE_MAP

    def _draw_walls(self) -> None:
        """Straight walls; with a period, their images in the view."""
        view, length = self._built, self.scene.periodic_x
        assert view is not None
        corners = [outline(wall) for wall in self.scene.walls]
        if length:
            turns = [np.floor((c[:, 0].mean() - view[0]) / length) for c in corners]
            at = [(c, turn + image) for c, turn in zip(corners, turns, strict=True) for image in (-1, 0, 1)]
            corners = [c - [turn * length, 0.0] for c, turn in at]
        if corners:
            self.ax.add_collection(
                PolyCollection(corners, facecolors=WALL, edgecolors=WALL, linewidths=1.2, zorder=2), autolim=False
            )

    def _place(self, disks: EllipseCollection, rows: np.ndarray, xy: np.ndarray) -> np.ndarray:
        """Put disks at wrapped places, twice where they reach over the seam; returns the rows drawn."""
        at = xy[rows].copy()
        length = self.scene.periodic_x
        view = self._built
        assert view is not None
        if length:
            at[:, 0] = view[0] + (at[:, 0] - view[0]) % length
            left = at[:, 0] - self.radius[rows] < view[0]
            right = at[:, 0] + self.radius[rows] > view[0] + length
            at = np.vstack([at, at[left] + [length, 0.0], at[right] - [length, 0.0]])
            rows = np.concatenate([rows, rows[left], rows[right]])
        diameter = np.maximum(2 * self.radius[rows], 9 * self._pixel)
        disks.set_widths(diameter)
        disks.set_heights(diameter)
        disks.set_angles(np.zeros(len(rows)))
        disks.set_offsets(at)
        return rows

    def _make_swimmers(self) -> None:
        self._axis = LineCollection([], colors=HEAD, linewidths=2.4, zorder=7, capstyle="round")
        self.ax.add_collection(self._axis, autolim=False)
        (self._eyes,) = self.ax.plot([], [], "o", color="white", ms=4, mew=0, zorder=8)

    def _make_labels(self) -> None:
        side, bottom, top, inner, height = self._bands
        view = self._built
        assert view is not None
        wide = view[1] - view[0]
        text = self.figure.text
        self._time = text(
            side,
            1 - 0.52 * top,
            "",
            color=INK,
            fontsize=14,
            va="center",
            family="DejaVu Sans",
            fontweight="bold",
        )
        self._title = text(1 - side, 1 - 0.52 * top, "", color=FAINT, fontsize=11, va="center", ha="right")
        self._title.set_parse_math(False)  # a title is a text, whatever dollars stand in it
        self._title.set_text(_short(self.scene.title, 70))
        # scale bar: about an eighth of the picture
        length = round_up(wide / 9)
        factor, unit = (1e3, "mm") if length < 0.5 else (1.0, "m")
        bar = self.figure.add_axes((side, 0.0, 1 - 2 * side, bottom))
        bar.set_axis_off()
        bar.set_xlim(0, inner)
        bar.set_ylim(0, bottom * height)
        pixels = length / wide * inner
        middle = 0.5 * bottom * height
        bar.plot([1, 1 + pixels], [middle + 10, middle + 10], color=INK, lw=3, solid_capstyle="butt")
        for end in (1, 1 + pixels):
            bar.plot([end, end], [middle + 5, middle + 15], color=INK, lw=1.4, solid_capstyle="butt")
        bar.text(
            1 + pixels / 2,
            middle - 9,
            f"{length * factor:g} {unit}",
            color=INK,
            fontsize=11,
            ha="center",
            va="center",
        )
        self._legend(bar, inner, middle, pixels)
        self._bar_ax = None
        coloured = self.grain.any() or not self.chain.any()
        if coloured:
            self._bar_ax = self.figure.add_axes(
                (1 - side - 0.25 - 10 / self._width, 0.55 * bottom, 0.25, 0.17 * bottom)
            )

    def _legend(self, bar: Axes, inner: float, middle: float, taken: float) -> None:
        """Between scale bar and colour bar, where there is room."""
        free = inner - 0.25 * self._width - 130 - taken
        if not self.chain.any() or free < 240:
            return
        x = taken + 0.5 * free - 90
        bar.plot([x], [middle], "o", ms=12, color=HEAD, mec="#5e0a16")
        bar.plot([x - 15, x - 6], [middle, middle], color=HEAD, lw=2.4, solid_capstyle="round")
        bar.text(x + 14, middle, "head and its axis", color=INK, fontsize=11, va="center")
        bar.plot([x + 165], [middle], "o", ms=12, color=TAIL, mec="#7c2a10")
        bar.text(x + 179, middle, "tail", color=INK, fontsize=11, va="center")

    def _draw_bar(self, top: float) -> None:
        ax = self._bar_ax
        if ax is None:
            return
        ax.clear()
        factor, unit = readable(top, "m/s" if self.color == "speed" else "N")
        shown = PowerNorm(0.5, 0.0, top * factor)
        bar = self.figure.colorbar(ScalarMappable(shown, self._map), cax=ax, orientation="horizontal")
        bar.set_ticks([f * top * factor for f in (0.0, 0.1, 0.4, 1.0)])
        bar.set_ticklabels([f"{f * top * factor:.3g}" for f in (0.0, 0.1, 0.4, 1.0)])
        bar.outline.set_visible(False)  # type: ignore[operator]
        ax.tick_params(labelsize=9, length=2, pad=2, colors=INK)
        what = "speed" if self.color == "speed" else "contact force"
        ax.text(
            -0.03,
            0.5,
            f"{what} [{unit}]",
            transform=ax.transAxes,
            ha="right",
            va="center",
            fontsize=11,
            color=INK,
        )
        self._bar_top = top

    def paint(self, state: State, contacts: Contacts | None = None, *, grow: bool = True) -> Figure:
        """Draw this state; with ``grow`` the scale follows what it needs."""
        if grow:
            self.fit(state, contacts)
        if self._built != self.scale.view:
            if self._built is not None and not self._own:
                assert self._ax is not None
                self._ax.clear()
            self._build()
            self._bar_top = math.nan
        xy, view = state.xy, self._built
        assert view is not None
        length = self.scene.periodic_x
        top = self.scale.top or 1.0
        rows = np.flatnonzero(self.wall)
        self._place(self._walls, rows, xy)
        self._walls.set_facecolor(WALL)

        norm = PowerNorm(0.5, 0.0, top, clip=True)
        value = self.values(state, contacts)
        plain = np.flatnonzero(~self.wall & ~self.chain)
        drawn = self._place(self._bodies, plain, xy)
        if self.grain.any() or self.color == "force":
            self._bodies.set_facecolor(self._map(norm(value[drawn])))
        else:
            # pale disks on a pale ground would vanish: a few free bodies start from a stronger colour
            self._bodies.set_facecolor(self._map(0.25 + 0.75 * norm(value[drawn])))

        rows = np.flatnonzero(self.chain)
        drawn = self._place(self._tails, rows, xy)
        heads = np.array([self.scene.bodies[k].role == "head" for k in drawn], dtype=bool)
        faces = np.where(heads[:, None], to_rgba_array(HEAD), to_rgba_array(TAIL))
        self._tails.set_facecolor(list(map(tuple, faces)))
        edges = np.where(heads[:, None], to_rgba_array("#5e0a16"), to_rgba_array("#7c2a10"))
        self._tails.set_edgecolor(list(map(tuple, edges)))

        axes, eyes = [], []
        for chain in self.scene.chains:
            angle = head_angle(self.scene, chain, state)
            r = self.radius[chain[0]]
            ahead = -np.array([math.cos(angle), math.sin(angle)])
            at = xy[chain[0]].copy()
            if length:
                at[0] = view[0] + (at[0] - view[0]) % length
            for shift in (0.0, *((-length, length) if length else ())):
                start = at + np.array([shift, 0.0])
                axes.append([start, start + 2.3 * r * ahead])
                eyes.append(start)
        self._axis.set_segments(axes)
        if axes:
            self._axis.set_linewidth(max(1.5, 0.16 * self.radius[self.chain].mean() / self._pixel))
            points = np.array(eyes)
            self._eyes.set_data(points[:, 0], points[:, 1])
            # a white dot of a third of the head, in points
            self._eyes.set_markersize(max(0.6 * self.radius[self.chain].mean() / self._pixel * 0.72, 2.5))
        self._draw_links(xy)
        self._draw_chains(contacts, xy, top)
        if self.trails:
            self._draw_trail()
        if self._own:
            self._time.set_text(_clock(state.t, self.scene))
            if self._bar_top != top:
                self._draw_bar(top)
        return self.figure

    def _draw_links(self, xy: np.ndarray) -> None:
        rods, springs = [], []
        for item, row, anchor in anchors(self.scene):
            a, b = np.array(anchor), xy[row]
            if item.name == "pin":
                rods.append([a, b])
            else:
                springs.append(_zigzag(a, b, self.radius[row], 12 * self._pixel))
        self._rods.set_segments(rods)
        self._springs.set_segments(springs)

    def _draw_chains(self, contacts: Contacts | None, xy: np.ndarray, top: float) -> None:
        """Force chains: a line between centres, as wide as the force is large."""
        if self.color != "force" or contacts is None or not len(contacts.i):
            self._chains.set_segments([])
            return
        keep = contacts.force > 0.02 * top
        i, j, force = contacts.i[keep], contacts.j[keep], contacts.force[keep]
        length, view = self.scene.periodic_x, self._built
        assert view is not None
        a = xy[i].copy()
        d = xy[j] - xy[i]
        if length:
            a[:, 0] = view[0] + (a[:, 0] - view[0]) % length
            d[:, 0] -= length * np.round(d[:, 0] / length)
        segments = np.stack([a, a + d], axis=1)
        width = (
            np.minimum(force / (0.5 * top), 1.0) ** 0.7
            * 0.8
            * float(np.mean(self.radius))
            / self._pixel
            * 0.72
        )
        if length:
            over = (a[:, 0] + d[:, 0] > view[1]) | (a[:, 0] + d[:, 0] < view[0])
            side = np.where(d[over, 0] > 0, -length, length)
            other = segments[over] + np.stack([side, np.zeros_like(side)], axis=1)[:, None, :]
            segments, width = np.vstack([segments, other]), np.concatenate([width, width[over]])
        self._chains.set_segments(list(segments))
        self._chains.set_linewidth(list(width))
        self._chains.set_color("#1b0b3b")
        self._chains.set_alpha(0.75)

    def remember(self, state: State) -> None:
        """Lengthen the paths by this state, which need not be painted."""
        if self.trails:
            self._path.append(state.xy[~self.wall].copy())

    def _draw_trail(self) -> None:
        path = np.array(self._path[-TRAIL:])  # (T, k, 2)
        if len(path) < 2:
            return
        if self.scene.periodic_x:
            return
        segments = np.stack([path[:-1], path[1:]], axis=2).reshape(-1, 2, 2)
        fade = np.repeat(np.linspace(0.05, 0.55, len(path) - 1), path.shape[1])
        colors = np.tile(to_rgba_array(FREE), (len(segments), 1))
        colors[:, 3] = fade
        self._trail.set_segments(list(segments))
        self._trail.set_color(list(map(tuple, colors)))

    def restart(self) -> None:
        """Forget the paths drawn so far."""
        self._path.clear()

    # ---- pictures -----------------------------------------------------------------------------

    def image(self) -> Image.Image:
        """What has been painted, as an RGB picture."""
        canvas = self.figure.canvas
        assert isinstance(canvas, FigureCanvasAgg)
        canvas.draw()
        return Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")

    def save(self, path: str | Path) -> None:
        """Write the picture as PNG."""
        save_image(self.image(), path)


def draw_frame(
    scene: Scene,
    state: State,
    *,
    contacts: Contacts | None = None,
    color: str = "speed",
    top: float | None = None,
    view: View | None = None,
    ax: Axes | None = None,
    width: int = 1200,
    path: str | Path | None = None,
) -> Figure:
    """Draw one state; the figure is returned, and written as PNG where ``path`` is given.

    ``state`` has t [s], xy (n, 2) [m], v (n, 2) [m/s], rows as in ``scene.bodies``; ``contacts`` are
    needed for ``color="force"``. With ``ax`` it is drawn into those axes, without labels
    (equal aspect, SI coordinates, so that tracks can be laid over it).
    """
    painter = Painter(scene, color, top=top, view=view, width=width, ax=ax, trails=False)
    figure = painter.paint(state, contacts)
    if path is not None:
        painter.save(path)
    return figure


def save_image(image: Image.Image, path: str | Path) -> None:
    """Write a PNG beside its place and move it there, so that no half picture is ever seen."""
    with written_whole(path) as stream:
        image.save(stream, format="PNG", compress_level=4)


# ---- small things -----------------------------------------------------------------------------


def _corners(a: View, b: View, n: int) -> np.ndarray:
    """(2, n, 2): two corners of what holds both views, as if all bodies had been there."""
    low = [min(a[0], b[0]), min(a[2], b[2])]
    high = [max(a[1], b[1]), max(a[3], b[3])]
    return np.array([[low] * n, [high] * n])


def _zigzag(a: np.ndarray, b: np.ndarray, radius: float, width: float) -> np.ndarray:
    """A spring from a to the edge of a disk at b."""
    d = b - a
    full = float(np.hypot(*d))
    if full == 0:
        return np.array([a, b])
    d = d / full
    end = max(full - radius, 0.1 * full)
    across = np.array([-d[1], d[0]])
    s = np.concatenate([[0.0, 0.08], np.linspace(0.12, 0.88, 17), [0.92, 1.0]]) * end
    side = np.zeros(len(s))
    side[2:-2] = width * np.where(np.arange(17) % 2, 1.0, -1.0)
    return a + s[:, None] * d + side[:, None] * across


def _clock(t: float, scene: Scene) -> str:
    if abs(scene.time.start) + (scene.time.duration or 0.0) > 5:
        return f"t = {t:.2f} s"
    if (scene.time.duration or 1.0) < 0.02:
        return f"t = {t * 1e3:.3f} ms"
    return f"t = {t:.3f} s"


def _short(text: str, size: int) -> str:
    return text if len(text) <= size else text[: size - 1] + "…"


def frame_options(data: Mapping[str, Any], file: Any = None) -> dict[str, Any]:
    """Check a scene's [frames] table and give it back. Raises InputError naming the key."""
    known: dict[str, tuple[type, ...]] = {
        "count": (int,),
        "per_second": (int, float),
        "color": (str,),
        "video": (str,),
        "top": (int, float),
        "view": (list, tuple),
        "width": (int,),
    }
    for key, value in data.items():
        if key not in known:
            raise InputError(f"unknown key {key!r}; known: {', '.join(known)}", file=file, where="frames")
        if isinstance(value, bool) or not isinstance(value, known[key]):
            raise InputError(f"{key} cannot be {value!r}", file=file, where="frames")
        if isinstance(value, int | float) and not value > 0:
            raise InputError(f"{key} should be above zero, got {value!r}", file=file, where="frames")
    result = dict(data)
    if result.get("color", "speed") not in COLORS:
        raise InputError(f"color should be one of {', '.join(COLORS)}", file=file, where="frames")
    if result.get("video", "gif") not in ("gif", "mp4", "none"):
        raise InputError("video should be gif, mp4 or none", file=file, where="frames")
    if not 200 <= result.get("width", 1200) <= 4000:
        raise InputError("width should lie between 200 and 4000 pixels", file=file, where="frames")
    if "view" in result:
        view = result["view"]
        numbers = all(isinstance(v, int | float) and math.isfinite(v) for v in view)
        if len(view) != 4 or not numbers or not (view[0] < view[1] and view[2] < view[3]):
            raise InputError("view should be [x low, x high, y low, y high] in m", file=file, where="frames")
        result["view"] = tuple(float(v) for v in view)
    return result
