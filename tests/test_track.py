"""From a film that the test draws to tracks, a recording and a verdict."""

import base64
import contextlib
import io
import json
import re
import shlex
import warnings

import numpy as np
import pytest
from PIL import Image
from test_docs import DOCS, blocks, run
from test_told import SHORT, commands

from granswim_pymunk.cli import main
from granswim_pymunk.errors import InputError
from granswim_pymunk.recording import read_recording
from granswim_pymunk.recording.track_film import open_film

pytest.importorskip("trackpy")
WIDTH, HEIGHT, RATE, SCALE = 640, 480, 60.0, 0.25e-3  # px, px, Hz, m/px
RADIUS, MASS, DRAG = 4e-3, 5e-3, 4e-3  # m, kg, kg/s


def ways(frames=120):
    """Two pucks that glide and are slowed by a linear drag, and do not meet, as in the tutorial; (T, 2, 2) in m."""
    t = np.arange(frames) / RATE
    start = np.array([[0.015, 0.03], [0.145, 0.085]])
    v = np.array([[0.075, 0.006], [-0.062, -0.004]])
    k = DRAG / MASS
    return t, start + v * ((1 - np.exp(-k * t)) / k)[:, None, None]


def picture(xy, rng, radius=RADIUS, dark=True):
    """A grey frame: disks with soft edges in uneven light, with noise. y up in xy, down in the picture."""
    rows, columns = np.mgrid[:HEIGHT, :WIDTH].astype(float)
    light = 150 + 50 * columns / WIDTH - 30 * rows / HEIGHT
    cover = np.zeros_like(light)
    for x, y in xy / SCALE:
        away = np.hypot(columns - x, rows - (HEIGHT - 1 - y))
        cover = np.maximum(cover, np.clip(radius / SCALE + 0.5 - away, 0, 1))
    shade = light * (1 - 0.7 * cover) if dark else 0.3 * light * (1 - cover) + 230 * cover
    return (shade + rng.normal(0, 4, shade.shape)).clip(0, 255).astype(np.uint8)


def film(path, xy, **look):
    import imageio_ffmpeg

    rng = np.random.default_rng(1)
    writer = imageio_ffmpeg.write_frames(str(path), (WIDTH, HEIGHT), fps=RATE, pix_fmt_in="gray", quality=8,
                                         macro_block_size=2)  # fmt: skip
    writer.send(None)
    for frame in xy:
        writer.send(picture(frame, rng, **look))
    writer.close()
    return path


@pytest.mark.deep
def test_the_tutorial_from_a_film_of_pucks_to_a_verdict(tmp_path):
    """The code and the commands of the page; noise of the film keeps the encoder busy for ten seconds."""
    page = DOCS / "tutorial_video.md"
    (code,) = blocks(page, "python")
    run(code, tmp_path)
    movie = tmp_path / "pucks.mp4"
    drawn = open_film(movie)
    assert (drawn.width, drawn.height, drawn.rate) == (640, 480, 60.0)
    assert sum(1 for _ in drawn.frames()) == 120
    said = {}
    with contextlib.chdir(tmp_path):
        for line in commands(page):
            name, *words = shlex.split(line)[1:]
            with contextlib.redirect_stdout(io.StringIO()) as out:
                assert main([name, *words, *(SHORT[name] if name == "run" else ())]) == 0, line
            said[name] = out.getvalue()
    assert list(said) == ["track", "diagnose", "run"] and any((tmp_path / "out/revised").iterdir())
    assert "2 bodies" in said["track"] and "bodies are dark, 32 px across" in said["track"]
    t, xy = ways()
    r = read_recording(tmp_path / "pucks")
    assert r.sampling == pytest.approx(RATE) and len(r.ids) == 2
    np.testing.assert_allclose(r.t, t, atol=1e-9)
    order = [int(np.argmin(np.hypot(*(xy[0] - r.xy[0, k]).T))) for k in range(2)]
    assert sorted(order) == [0, 1]
    error = r.xy - xy[:, order]
    assert np.sqrt(np.mean(error**2)) < 0.25 * SCALE
    assert (tmp_path / "pucks/film.mp4").read_bytes() == movie.read_bytes()
    assert (tmp_path / "pucks/found.png").read_bytes()[:4] == b"\x89PNG"
    # where the film lies, so that the report draws the simulation over it
    assert r.film is not None and (r.film.scale, r.film.rate, r.film.left) == (SCALE, RATE, 0.0)
    assert r.film.top == pytest.approx((HEIGHT - 1) * SCALE)
    verdict = json.loads((tmp_path / "out/pucks/verdict.json").read_text())
    assert verdict["verdict"] == "missing_physics"
    (found,) = verdict["mechanisms"]
    assert found["name"] == "linear_drag"
    assert found["parameters"]["c"]["value"] == pytest.approx(DRAG, rel=0.05)
    page = (tmp_path / "out/pucks/report.html").read_text(encoding="utf-8")
    played = json.loads(re.search(r'id="film".*?<script type="application/json">(.*?)</script>', page, re.S)[1])
    texts, shown, box = played["pictures"]
    assert len(texts) == len(shown) == len(played["t"]) == 120 and max(shown) == 119
    np.testing.assert_allclose(box, [-SCALE / 2, -SCALE / 2, WIDTH * SCALE, HEIGHT * SCALE])
    assert 50_000 < sum(map(len, texts)) < 2_000_000
    # in the picture of the last frame the pucks are dark where the tracks say
    picture = np.asarray(Image.open(io.BytesIO(base64.b64decode(texts[shown[-1]]))).convert("L"), dtype=float)
    across = picture.shape[1]
    assert across == 480
    for x, y in xy[-1]:
        column, row = (x - box[0]) / box[2] * across, (box[1] + box[3] - y) / box[3] * picture.shape[0]
        assert picture[int(row), int(column)] < 0.6 * np.median(picture)


def test_a_film_without_its_place_and_one_that_is_none(tmp_path):
    """The film is only shown: what is wrong with it is said, and stops nothing."""
    from granswim_pymunk.recording.backdrop import Backdrop, pictures_at, read_backdrop

    (tmp_path / "film.mp4").write_bytes(b"#EXTM3U\nfile:///etc/hostname\n")
    assert read_backdrop(tmp_path) is None
    film = Backdrop(tmp_path / "film.mp4", 1e-4, 0.0, 0.1, 60.0, 0.5)
    film.write(tmp_path)
    assert read_backdrop(tmp_path) == film
    assert film.frames_at(np.array([0.0, 0.5, 1.0])).tolist() == [-1, 0, 30]
    assert pictures_at(film, np.array([0.5, 1.0]), 100) is None
    for text, said in (("scale = 0.0", "above zero"), ("scale = 'a'", "a number"), ("size = 1", "unknown key")):
        (tmp_path / "film.toml").write_text(f"left = 0.0\ntop = 0.1\nrate = 60.0\n{text}\n")
        with pytest.raises(InputError, match=said):
            read_backdrop(tmp_path)
    (tmp_path / "film.toml").write_text("left = 0.0\n")
    with pytest.raises(InputError, match="no scale"):
        read_backdrop(tmp_path)


def test_bright_bodies_a_known_length_and_a_folder_of_pictures(tmp_path):
    from granswim_pymunk.recording.track_film import track

    _, xy = ways(24)
    folder = tmp_path / "frames"
    folder.mkdir()
    rng = np.random.default_rng(2)
    for k, frame in enumerate(xy):
        Image.fromarray(picture(frame, rng, dark=False)).save(folder / f"{k:04d}.png")
    with pytest.raises(InputError, match="--fps"):
        track(folder, tmp_path / "out", radius="4mm", scale="160mm=640px")
    done = track(folder, tmp_path / "out", radius="4mm", scale="160mm=640px", fps=RATE, gravity=9.81)
    assert len(done.recording.ids) == 2 and any("bright" in note for note in done.notes)
    assert any("ball of water" in note for note in done.notes)
    assert (tmp_path / "out/film.mp4").stat().st_size > 1000
    assert done.recording.scene.gravity == (0.0, -9.81)


def test_the_scale_of_linked_disks(tmp_path):
    from granswim_pymunk.recording.track_film import track

    t = np.arange(20) / RATE
    line = np.stack([0.03 + 2 * RADIUS * np.arange(5), np.full(5, 0.05)], axis=-1)
    xy = line + np.stack([0.02 * t, 0.01 * t], axis=-1)[:, None, :]
    movie = film(tmp_path / "chain.mp4", xy, radius=0.93 * RADIUS)
    done = track(movie, tmp_path / "out", radius=RADIUS, scale="linked", radius_px=0.93 * RADIUS / SCALE)
    assert len(done.recording.ids) == 5
    # disks that touch pull each other's centres a little: two percent of the scale
    np.testing.assert_allclose(np.ptp(done.recording.xy[0, :, 0]), 8 * RADIUS, rtol=0.02)
    moved = done.recording.xy[-1] - done.recording.xy[0]
    np.testing.assert_allclose(np.hypot(*moved.T), np.hypot(0.02, 0.01) * t[-1], rtol=0.03)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--radius", "4furlongs"], "radius"),
        (["--scale", "4"], "px across: too few"),
        (["--scale", "nothing"], "0.1mm/px, 50mm=640px or linked"),
        (["--scale", "linked"], "--radius-px"),
        (["--bright"], "no body|followed"),
    ],
)
def test_what_is_wrong_is_said_in_a_line(tmp_path, capsys, options, message):
    import re

    rng = np.random.default_rng(4)
    from PIL import Image

    folder = tmp_path / "frames"
    folder.mkdir()
    for k in range(6):
        blank = rng.normal(120, 1, (60, 80)).clip(0, 255).astype(np.uint8)
        Image.fromarray(blank).save(folder / f"{k}.png")
    arguments = {"--radius": "1mm", "--scale": "0.25mm/px", "--fps": "30"}
    flags = []
    for name, value in zip(options[::2], options[1::2], strict=False):
        arguments[name] = value
    if len(options) % 2:
        flags = options[-1:]
    code = main(["track", str(folder), *[part for pair in arguments.items() for part in pair], *flags,
                 "--minmass", "1e9", "--out", str(tmp_path / "out")])  # fmt: skip
    said = capsys.readouterr().err
    assert code == 2 and re.search(message, said), said
    assert said.count("\n") == 1 and not (tmp_path / "out").exists()


def test_what_is_no_film_is_said(tmp_path):
    (tmp_path / "a.mp4").write_bytes(b"nothing of a film")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with pytest.raises(InputError, match="not a film"):
            open_film(tmp_path / "a.mp4")
    with pytest.raises(InputError, match="no such file"):
        open_film(tmp_path / "b.mp4")
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="no pictures"):
        open_film(tmp_path / "empty")


def test_a_film_beside_imported_tracks(tmp_path, capsys):
    """Positions in pixels, as trackers write them, and the film they were read from."""
    t, xy = ways(30)
    movie = film(tmp_path / "pucks.mp4", xy)
    lines = ["frame,particle,x,y"]
    lines += [f"{k},{b},{x / SCALE},{HEIGHT - 1 - y / SCALE}" for k in range(30) for b, (x, y) in enumerate(xy[k])]
    (tmp_path / "tracks.csv").write_text("\n".join(lines) + "\n")
    words = ["import", str(tmp_path / "tracks.csv"), "--unit", "0.25mm/px", "--fps", "60", "--body", "*:4mm:5g",
             "--scene", "puck", "--film", str(movie)]  # fmt: skip
    assert main([*words, "--flip-y", str(HEIGHT - 1), "--out", str(tmp_path / "out")]) == 0
    r = read_recording(tmp_path / "out")
    assert r.film is not None and (r.film.scale, r.film.rate, r.film.left) == (SCALE, RATE, 0.0)
    assert r.film.top == pytest.approx((HEIGHT - 1) * SCALE)
    np.testing.assert_allclose(r.xy, xy, atol=1e-12)
    np.testing.assert_allclose(r.t, t, atol=1e-12)
    capsys.readouterr()
    assert main([*words, "--flip-y", "no", "--out", str(tmp_path / "no")]) == 2
    assert "--flip-y HEIGHT" in capsys.readouterr().err and not (tmp_path / "no").exists()
