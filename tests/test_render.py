"""Pictures: things are where they should be, in the colours that say what they mean."""

import dataclasses
import math

import imageio_ffmpeg
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from PIL import Image

from granswim_pymunk.engine import Contacts, State
from granswim_pymunk.errors import InputError
from granswim_pymunk.render import (
    HEAD,
    TAIL,
    WALL,
    Painter,
    draw_frame,
    frame_options,
    readable,
    round_up,
)
from granswim_pymunk.scene import Body, Scene, swimmer, use
from granswim_pymunk.video import write_video
from granswim_pymunk.view import view_of


def little_bed(head=(0.012, 0.01)):
    """A swimmer, two grains and both wall rows in a box of 40 x 20 mm."""
    walls = tuple(
        Body(f"w{k}", "wall", 1e-3, 1.0, initial=(1e-3 + 2e-3 * (k % 20), -1e-3 if k < 20 else 0.021, 0, 0))
        for k in range(40)
    )
    grains = (
        Body("g0", "grain", 1e-3, 4e-6, initial=(0.010, 0.005, 0, 0)),
        Body("g1", "grain", 1e-3, 4e-6, initial=(0.012, 0.005, 0, 0)),
    )
    bending = use("bending", stiffness=2e-3, amplitude=math.pi / 4, frequency=9.0)
    return Scene(
        bodies=(*swimmer(head=head), *grains, *walls), laws=(bending,), periodic_x=0.04, title="little bed"
    )


def at_rest(scene, t=0.0):
    initial = np.array([b.initial for b in scene.bodies], dtype=float)
    zero = np.zeros(len(initial))
    return State(t=t, xy=initial[:, :2].copy(), v=initial[:, 2:].copy(), angle=zero, spin=zero)


def pixels(image, color, near=12):
    """Rows and columns of the pixels of that colour."""
    rgb = np.asarray(image.convert("RGB"), dtype=int)
    return np.nonzero(np.abs(rgb - np.round(255 * np.array(to_rgb(color)))).max(axis=2) <= near)


def to_pixel(painter, x, y):
    """Column and row in the picture of a place [m]."""
    height = painter.image().height
    column, row = painter.ax.transData.transform((x, y))
    return column, height - row


def test_head_is_where_it_should_be():
    scene = little_bed()
    painter = Painter(scene)
    painter.paint(at_rest(scene))
    image = painter.image()
    rows, columns = pixels(image, HEAD)
    x, y = to_pixel(painter, 0.012, 0.01)
    # the legend below the box has a head too
    inside = rows < to_pixel(painter, 0, -0.002)[1]
    head = inside & (np.hypot(columns - x, rows - y) < 1.2 * 1.5e-3 / painter._pixel)
    assert head.sum() > 500
    assert columns[head].mean() == pytest.approx(x, abs=4)
    assert rows[head].mean() == pytest.approx(y, abs=2)
    # at t = 0 the axis points along -x, away from the tail
    axis = inside & ~head
    assert axis.any() and columns[axis].max() < x
    assert abs(rows[axis].mean() - y) < 2
    tails = pixels(image, TAIL)[1]
    assert tails[tails > x].size > 1000


def test_axis_follows_the_drive():
    scene = little_bed()
    painter = Painter(scene)
    painter.paint(at_rest(scene, t=1 / 36))  # a quarter period: 45 degrees
    rows, columns = pixels(painter.image(), HEAD)
    x, y = to_pixel(painter, 0.012, 0.01)
    away = (np.hypot(columns - x, rows - y) > 1.3 * 1.5e-3 / painter._pixel) & (
        rows < to_pixel(painter, 0, -0.002)[1]
    )
    assert away.sum() > 20
    # against the segment's direction (cos, sin): to the left and, in the picture, down
    assert columns[away].max() < x and rows[away].min() > y
    assert np.mean((rows[away] - y) / (x - columns[away])) == pytest.approx(1.0, abs=0.1)


def test_seam_shows_both_halves():
    scene = little_bed()
    state = at_rest(scene)
    state.xy[:7, 0] += 0.04 * 3 - 0.012  # the head's centre on the seam, three turns on
    painter = Painter(scene)
    painter.paint(state)
    rows, columns = pixels(painter.image(), HEAD)
    inside = rows < to_pixel(painter, 0, -0.002)[1]
    left, right = to_pixel(painter, 0.0, 0.01)[0], to_pixel(painter, 0.04, 0.01)[0]
    width = 1.5e-3 / painter._pixel
    assert (inside & (columns < left + width)).sum() > 300
    assert (inside & (columns > right - width)).sum() > 300


def test_speed_colours_grains():
    scene = little_bed()
    state = at_rest(scene)
    state.v[8] = 0.1, 0.0
    painter = Painter(scene, top=0.1)
    painter.paint(state)
    image = painter.image()
    quiet = image.getpixel(tuple(round(p) for p in to_pixel(painter, 0.010, 0.005)))
    fast = image.getpixel(tuple(round(p) for p in to_pixel(painter, 0.012, 0.005)))
    assert min(quiet) > 220 and max(fast) < 120
    wall = image.getpixel(tuple(round(p) for p in to_pixel(painter, 0.009, -0.001)))
    assert np.abs(np.array(wall) - 255 * np.array(to_rgb(WALL))).max() < 3


def test_force_draws_chains():
    scene = little_bed()
    none = np.zeros(0, dtype=int)
    empty = Contacts(none, none, np.zeros((0, 2)), np.zeros(0), np.zeros(0))
    one = Contacts(np.array([7]), np.array([8]), np.array([[1.0, 0.0]]), np.array([1e-3]), np.array([1e-7]))
    painter = Painter(scene, "force", top=1e-3)
    pictures = []
    for contacts in (empty, one):
        painter.paint(at_rest(scene), contacts)
        pictures.append(painter.image())
    at = tuple(round(p) for p in to_pixel(painter, 0.011, 0.005))  # where they touch
    assert min(pictures[0].getpixel(at)) > 60 and max(pictures[1].getpixel(at)) < 110


def test_scale_only_grows_and_can_be_fixed():
    scene = dataclasses.replace(little_bed(), laws=())
    state = at_rest(scene)
    painter, fixed = Painter(scene), Painter(scene, top=0.5)
    tops = []
    for speed in (0.012, 0.2, 0.05):
        state.v[7:9, 0] = speed
        for each in (painter, fixed):
            each.paint(state)
        tops.append(painter.scale.top)
    assert tops == [0.015, 0.2, 0.2]
    assert fixed.scale.top == 0.5


def pendulum():
    return Scene(
        bodies=(Body("bob", "free", 0.02, 0.1, initial=(0.3, 0.0, 0.0, 0.0)),),
        laws=(use("gravity"), use("pin", bodies=["bob"], anchor=(0.0, 0.0), length=0.3)),
        gravity=(0.0, -9.81),
    )


def test_view_holds_anchor_and_path():
    scene = pendulum()
    path = np.array([[[0.3, 0.0]], [[0.0, -0.3]], [[-0.3, 0.0]]])
    low_x, high_x, low_y, high_y = view_of(scene, path)
    assert low_x < -0.32 and high_x > 0.32 and low_y < -0.32 and high_y > 0.02
    assert high_x - low_x < 0.9
    assert view_of(little_bed()) == pytest.approx((0.0, 0.04, -0.002, 0.022))


def test_rod_is_drawn():
    scene = pendulum()
    painter = Painter(scene)
    painter.paint(at_rest(scene))
    image = painter.image()
    for part in (0.25, 0.5, 0.75):
        assert max(image.getpixel(tuple(round(p) for p in to_pixel(painter, 0.3 * part, 0.0)))) < 110
        assert min(image.getpixel(tuple(round(p) for p in to_pixel(painter, 0.3 * part, -0.05)))) > 220


def test_view_follows_what_leaves_it():
    scene = Scene(bodies=(Body("a", "free", 0.01, 1.0, initial=(0, 0, 0, 0)),))
    painter = Painter(scene)
    state = at_rest(scene)
    painter.paint(state)
    state.xy[0] = 3.0, -2.0
    painter.paint(state)
    x0, x1, y0, y1 = painter.scale.view
    assert x0 < 0 and x1 > 3.01 and y0 < -2.01 and y1 > 0


def test_draw_frame_into_axes_and_file(tmp_path):
    scene = little_bed()
    ax = Figure().add_subplot()
    draw_frame(scene, at_rest(scene), ax=ax)
    assert ax.get_xlim() == pytest.approx((0.0, 0.04)) and ax.get_aspect() == 1.0
    ax.plot([0.012], [0.01], "k+")  # SI coordinates: tracks can be laid over it
    draw_frame(scene, at_rest(scene), path=tmp_path / "a.png", width=600)
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.width == 600 and len(picture.convert("RGB").getcolors(10**6)) > 50
    assert [p.name for p in tmp_path.iterdir()] == ["a.png"]


@pytest.fixture
def frames(tmp_path):
    scene = little_bed()
    painter = Painter(scene, width=400)
    state = at_rest(scene)
    names = []
    for k in range(6):
        state.xy[:7, 0] += 1e-3
        painter.paint(state)
        names.append(tmp_path / f"{k}.png")
        painter.save(names[-1])
    return names


def test_gif(frames, tmp_path):
    write_video(frames, tmp_path / "a.gif", fps=20)
    with Image.open(tmp_path / "a.gif") as picture:
        assert picture.n_frames == 6 and picture.info["duration"] == 50
        size = picture.size
    with Image.open(frames[0]) as frame:
        assert size == frame.size


def test_mp4(frames, tmp_path):
    write_video(frames, tmp_path / "a.mp4", fps=20)
    count, seconds = imageio_ffmpeg.count_frames_and_secs(str(tmp_path / "a.mp4"))
    assert count == 6 and seconds == pytest.approx(0.3, abs=0.06)
    assert not list(tmp_path.glob(".*part*"))


def test_video_that_cannot_be_made(frames, tmp_path):
    with pytest.raises(InputError, match="no frames"):
        write_video([], tmp_path / "a.gif")
    with pytest.raises(InputError, match=r"\.gif or \.mp4"):
        write_video(frames, tmp_path / "a.avi")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"colour": "speed"}, "unknown key 'colour'"),
        ({"color": "red"}, "color"),
        ({"count": "many"}, "count"),
        ({"count": True}, "count"),
        ({"top": -1.0}, "above zero"),
        ({"view": [0.0, 1.0]}, "view"),
        ({"video": "avi"}, "video"),
        ({"width": 50}, "width"),
    ],
)
def test_bad_frame_options(options, words):
    with pytest.raises(InputError, match=words):
        frame_options(options)


def test_numbers_read_well():
    assert readable(0.02, "m/s") == (1e3, "mm/s")
    assert readable(3.0, "N") == (1.0, "N")
    assert [round_up(v) for v in (0.011, 0.02, 4.0, 8.0)] == pytest.approx([0.015, 0.02, 5.0, 10.0])
    with pytest.raises(InputError, match="color"):
        Painter(little_bed(), "heat")
