"""What trackers and codes write becomes a recording with the right values: units, direction of y, times, names."""

import json
import math
import re
import warnings
from itertools import pairwise
from pathlib import Path

import h5py
import numpy as np
import pytest

import granswim_pymunk as gs
from granswim_pymunk.cli import main
from granswim_pymunk.errors import InputError
from granswim_pymunk.recording import read_recording
from granswim_pymunk.recording.importers import IMPORTERS, import_all, import_recording
from granswim_pymunk.recording.importers.stamps import frame_rate
from granswim_pymunk.recording.importers.units import LENGTHS, quantity
from granswim_pymunk.recording.keys import KEYS, commented

pd = pytest.importorskip("pandas")

RATE = 50.0  # Hz
PIXEL = 1e-4  # m
FRAMES = 30


def truth():
    """Two bodies, (T, 2, 2) in m, y up; the second is not seen in frames 7 to 9."""
    t = np.arange(FRAMES) / RATE
    xy = np.empty((FRAMES, 2, 2))
    xy[:, 0] = np.stack([0.02 + 0.011 * t, 0.05 - 0.02 * t - 0.1 * t**2], axis=-1)
    xy[:, 1] = np.stack([0.06 - 0.013 * t, 0.03 + 0.004 * np.sin(9 * t)], axis=-1)
    xy[7:10, 1] = np.nan
    return t, xy


T, XY = truth()
TIMES = T.tolist()
HEIGHT = 800.0  # of the picture [px]


def pixels():
    """The truth as an image tracker sees it: px, y from the top."""
    x, y = XY[..., 0] / PIXEL, HEIGHT - XY[..., 1] / PIXEL
    return np.stack([x, y], axis=-1)


def features():
    """As trackpy's locate and link leave it."""
    px = pixels()
    rows = [
        (px[k, b, 1], px[k, b, 0], 900.0, 3.1, 0.1, 20.0, 1200.0, 0.05, k, b)
        for k in range(FRAMES)
        for b in range(2)
        if np.isfinite(px[k, b, 0])
    ]
    return pd.DataFrame(
        rows, columns=["y", "x", "mass", "size", "ecc", "signal", "raw_mass", "ep", "frame", "particle"]
    )


def quiet(call, *args, **kwargs):
    """Other libraries warn of their own changes; that is not what is tested."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return call(*args, **kwargs)


# ---- the files, each written as its tool writes it --------------------------------------------------

TRACKPY = {"unit": "0.1mm/px", "fps": RATE, "flip_y": HEIGHT}


def trackpy_csv_with_index(folder):
    features().to_csv(folder / "tracks.csv")
    return "tracks.csv", TRACKPY, ("0", "1")


def trackpy_csv_without_index(folder):
    features().to_csv(folder / "tracks.csv", index=False)
    return "tracks.csv", TRACKPY, ("0", "1")


def trackpy_hdf(folder):
    quiet(features().to_hdf, folder / "tracks.h5", key="tracks")
    return "tracks.h5", TRACKPY, ("0", "1")


def trackpy_store(folder):
    trackpy = pytest.importorskip("trackpy")
    frame = features()

    def write():
        with trackpy.PandasHDFStore(str(folder / "store.h5"), "w") as store:
            for k in range(FRAMES):
                store.put(frame[frame.frame == k])

    quiet(write)
    return "store.h5", TRACKPY, ("0", "1")


def _dlc_frame():
    px = pixels()
    columns = pd.MultiIndex.from_product(
        [["DLC_resnet50"], ["nose", "tail tip"], ["x", "y", "likelihood"]], names=["scorer", "bodyparts", "coords"]
    )
    data = np.empty((FRAMES, 6))
    for b in range(2):
        seen = np.isfinite(px[:, b, 0])
        # DeepLabCut gives a place in each frame; where it sees nothing it is not likely
        data[:, 3 * b] = np.where(seen, px[:, b, 0], 11.0)
        data[:, 3 * b + 1] = np.where(seen, px[:, b, 1], 7.0)
        data[:, 3 * b + 2] = np.where(seen, 0.99, 0.02)
    return pd.DataFrame(data, columns=columns)


def deeplabcut_csv(folder):
    _dlc_frame().to_csv(folder / "videoDLC.csv")
    return "videoDLC.csv", TRACKPY, ("nose", "tail tip")


def deeplabcut_h5(folder):
    quiet(_dlc_frame().to_hdf, folder / "videoDLC.h5", key="df_with_missing", mode="w")
    return "videoDLC.h5", TRACKPY, ("nose", "tail tip")


def sleap_h5(folder):
    px = pixels()
    with h5py.File(folder / "analysis.h5", "w") as file:
        # (tracks, 2, nodes, frames)
        file["tracks"] = px.transpose(1, 2, 0)[:, :, None, :]
        file["track_names"] = np.array([b"left", b"right"])
        file["node_names"] = np.array([b"centroid"])
        file["track_occupancy"] = np.isfinite(px[..., 0]).astype(np.uint8)
        file["edge_inds"] = np.zeros((0, 2))
    return "analysis.h5", TRACKPY, ("left", "right")


def trackmate_csv(folder):
    px = pixels() * PIXEL * 1e6  # micron
    rows = [
        "LABEL,ID,TRACK_ID,QUALITY,POSITION_X,POSITION_Y,POSITION_Z,POSITION_T,FRAME,RADIUS,VISIBILITY",
        "Label,Spot ID,Track ID,Quality,X,Y,Z,T,Frame,Radius,Visibility",
        "Label,Spot ID,Track ID,Quality,X,Y,Z,T,Frame,R,Visibility",
        ",,,(quality),(micron),(micron),(micron),(sec),,(micron),",
    ]
    for k in range(FRAMES):
        for b in range(2):
            if np.isfinite(px[k, b, 0]):
                x, y = map(repr, px[k, b].tolist())
                rows.append(f"ID{2 * k + b},{2 * k + b},{b},9.1,{x},{y},0.0,{TIMES[k]!r},{k},5000.0,1")
    rows.append("ID999,999,,1.0,5.0,5.0,0.0,0.0,0,5000.0,1")  # a spot of no track
    (folder / "spots.csv").write_text("\n".join(rows) + "\n")
    return "spots.csv", {"flip_y": HEIGHT * PIXEL * 1e6}, ("0", "1")


def trackmate_xml(folder):
    px = pixels()
    spots, tracks = [], {0: [], 1: []}
    for k in range(FRAMES):
        inside = []
        for b in range(2):
            if np.isfinite(px[k, b, 0]):
                number = 2 * k + b
                tracks[b].append(number)
                x, y = px[k, b].tolist()
                inside.append(
                    f'<Spot ID="{number}" name="ID{number}" POSITION_X="{x!r}" POSITION_Y="{y!r}" POSITION_Z="0.0" '
                    f'POSITION_T="{float(k)}" FRAME="{k}" RADIUS="50.0" QUALITY="3.0"/>'
                )
        spots.append(f'<SpotsInFrame frame="{k}">{"".join(inside)}</SpotsInFrame>')
    edges = "".join(
        f'<Track name="Track_{b}" TRACK_ID="{b}">'
        + "".join(f'<Edge SPOT_SOURCE_ID="{i}" SPOT_TARGET_ID="{j}"/>' for i, j in pairwise(m))
        + "</Track>"
        for b, m in tracks.items()
    )
    (folder / "model.xml").write_text(
        '<?xml version="1.0" encoding="UTF-8"?>\n<TrackMate version="7.11.1"><Model spatialunits="pixel" '
        f'timeunits="frame"><AllSpots nspots="57">{"".join(spots)}</AllSpots><AllTracks>{edges}</AllTracks>'
        '<FilteredTracks><TrackID TRACK_ID="0"/><TrackID TRACK_ID="1"/></FilteredTracks></Model></TrackMate>'
    )
    return "model.xml", TRACKPY, ("0", "1")


def tracker_txt(folder):
    """Tracker's export of two masses: names, then t and x, y of each behind one another."""
    lines = ["#multi:", "\tmass A\t\tmass B\t", "#t\tx\ty\tx\ty\t"]
    for k in range(FRAMES):
        cells = [f"{T[k]:.9E}"]
        for b in range(2):
            cells += [f"{v:.15E}" if np.isfinite(v) else "" for v in XY[k, b].tolist()]
        lines.append("\t".join(cells) + "\t")
    (folder / "tracker.txt").write_text("\n".join(lines) + "\n")
    return "tracker.txt", {}, ("mass_A", "mass_B")


def tracker_norwegian(folder):
    """The same where commas stand between columns and as decimal sign, and the minus is U+2212."""
    lines = ["#multi:", ",mass A,,mass B,,", "t,x,y,x,y,"]
    for k in range(FRAMES):
        values = [T[k], *XY[k].ravel().tolist()]
        lines.append(",".join(f"{v:.15E}" if np.isfinite(v) else "" for v in values) + ",")
    written = [line.replace(".", ",").replace("E+", "E").replace("-", "\u2212") for line in lines[3:]]
    (folder / "tracker_no.txt").write_text("\n".join(lines[:3] + written) + "\n")
    return "tracker_no.txt", {}, ("mass_A", "mass_B")


def bare_table(folder):
    """No header: the columns are told by their numbers, a row per frame."""
    rows = [[T[k].item(), *XY[k].ravel().tolist()] for k in range(FRAMES)]
    text = [";".join(repr(v) if np.isfinite(v) else "" for v in row) for row in rows]
    (folder / "bare.csv").write_text("\n".join(text) + "\n")
    return "bare.csv", {"columns": "t=1,A.x=2,A.y=3,B.x=4,B.y=5"}, ("A", "B")


def kinovea_txt(folder):
    lines = ["#Kinovea Trajectory data export", "#T X Y", ""]
    for b, name in enumerate(("left puck", "right puck")):
        lines.append(f"# {name}")
        for k in range(FRAMES):
            if np.isfinite(XY[k, b, 0]):
                x, y = (100 * XY[k, b]).tolist()
                lines.append(f"{1000 * TIMES[k]!r} {x!r} {y!r}")
        lines.append("")
    (folder / "kinovea.txt").write_text("\n".join(lines))
    return "kinovea.txt", {"unit": "cm"}, ("left_puck", "right_puck")


def ethovision_utf16(folder):
    head = [
        '"Number of header lines:";"8"', '"Experiment";"pucks"', '"Trial name";"Trial 1"', '"Subject name";"none"',
        '"Video file";"a.mpg"', '""',
        '"Trial time";"Recording time";"X center";"Y center";"X nose";"Y nose";"Velocity"',
        '"s";"s";"cm";"cm";"cm";"cm";"cm/s"',
    ]  # fmt: skip
    rows = []
    for k in range(FRAMES):
        cells = [repr(5 + TIMES[k]), repr(TIMES[k])]
        for b in range(2):
            cells += [repr(v) if np.isfinite(v) else '"-"' for v in (100 * XY[k, b]).tolist()]
        rows.append(";".join([*cells, '"-"']) + ";")
    (folder / "Raw data.txt").write_bytes(("﻿" + "\r\n".join(head + rows) + "\r\n").encode("utf-16-le"))
    return "Raw data.txt", {}, ("center", "nose")


def german_csv(folder):
    lines = ["Messung vom 3. Mai", "", "Zeit (s);Teilchen;x (cm);y (cm)"]
    for k in range(FRAMES):
        for b in range(2):
            if np.isfinite(XY[k, b, 0]):
                x, y = (100 * XY[k, b]).tolist()
                lines.append(f"{TIMES[k]!r};{'ab'[b]};{x!r};{y!r}".replace(".", ","))
    (folder / "messung.csv").write_bytes("\r\n".join(lines).encode("cp1252"))
    return "messung.csv", {}, ("a", "b")


def excel(folder):
    pytest.importorskip("openpyxl")
    frame = pd.DataFrame({"time [ms]": 1e3 * T, "A_x (mm)": 1e3 * XY[:, 0, 0], "A_y (mm)": 1e3 * XY[:, 0, 1],
                          "B_x (mm)": 1e3 * XY[:, 1, 0], "B_y (mm)": 1e3 * XY[:, 1, 1]})  # fmt: skip
    frame.to_excel(folder / "pucks.xlsx", index=False)
    return "pucks.xlsx", {}, ("A", "B")


def parquet(folder):
    pytest.importorskip("pyarrow")
    frame = pd.DataFrame(
        [(T[k], "pq"[b], *XY[k, b]) for k in range(FRAMES) for b in range(2)], columns=["t", "id", "x", "y"]
    )
    frame.to_parquet(folder / "pucks.parquet")
    return "pucks.parquet", {}, ("p", "q")


def extended_xyz(folder):
    ase = pytest.importorskip("ase")
    io = pytest.importorskip("ase.io")
    frames = []
    for k in range(FRAMES):
        xyz = np.concatenate([1e3 * XY[k], np.zeros((2, 1))], axis=1)
        seen = np.isfinite(xyz[:, 0])
        atoms = ase.Atoms("Ar2", positions=np.where(seen[:, None], xyz, 0.0))[seen]
        atoms.arrays["id"] = np.array([3, 8])[seen]
        atoms.info["Time"] = T[k]
        frames.append(atoms)
    io.write(folder / "pucks.xyz", frames, format="extxyz")
    return "pucks.xyz", {"unit": "mm"}, ("3", "8")


def lammps_dump(folder):
    lines = []
    for k in range(FRAMES):
        seen = [b for b in range(2) if np.isfinite(XY[k, b, 0])]
        lines += ["ITEM: TIMESTEP", str(2000 * k), "ITEM: NUMBER OF ATOMS", str(len(seen)),
                  "ITEM: BOX BOUNDS ff ff pp", "0.0 100.0", "0.0 100.0", "-0.5 0.5",
                  "ITEM: ATOMS id type x y z radius"]  # fmt: skip
        # LAMMPS writes atoms in any order
        lines += [f"{b + 1} 1 {1e3 * XY[k, b, 0]!r} {1e3 * XY[k, b, 1]!r} 0.0 5.0" for b in reversed(seen)]
    (folder / "pucks.lammpstrj").write_text("\n".join(lines).replace("np.float64(", "").replace(")", "") + "\n")
    return "pucks.lammpstrj", {"unit": "mm", "time_unit": "1e-5"}, ("1", "2")


def h5md(folder):
    with h5py.File(folder / "pucks.h5md", "w") as file:
        file.create_group("h5md").attrs["version"] = np.array([1, 1])
        position = file.create_group("particles/pucks/position")
        # the format has no gaps: both are seen in each frame
        position["value"] = np.concatenate([100 * filled(), np.zeros((FRAMES, 2, 1))], axis=2)
        position["value"].attrs["unit"] = "cm"
        position["step"] = 20
        position["time"] = 20.0
        position["time"].attrs["unit"] = "ms"
        box = file.create_group("particles/pucks/box")
        box.attrs["dimension"] = 3
        box.attrs["boundary"] = np.array([b"none", b"none", b"none"])
    return "pucks.h5md", {}, ("0", "1")


def gsd(folder):
    hoomd = pytest.importorskip("gsd.hoomd")
    with hoomd.open(str(folder / "pucks.gsd"), "w") as file:
        for k in range(FRAMES):
            frame = hoomd.Frame()
            frame.configuration.step = 500 * k
            frame.configuration.box = [5000, 5000, 1, 0, 0, 0]
            frame.particles.N = 2
            frame.particles.position = np.concatenate([1e3 * filled()[k], np.zeros((2, 1))], axis=1)
            frame.particles.diameter = [10.0, 10.0]
            file.append(frame)
    return "pucks.gsd", {"unit": "mm", "fps": RATE}, ("0", "1")


def mocap_csv(folder):
    """Of OptiTrack: coordinates along z are there too, and what is not seen is empty."""
    lines = ["Format Version,1.23,Take Name,Take 1,Capture Frame Rate,50.000000,Length Units,Millimeters", "",
             ",Type" + ",Marker" * 6, ",Name" + ",puck:left" * 3 + ",puck:right" * 3, ",ID" + ",A1" * 3 + ",A2" * 3,
             "," + ",Position" * 6, "Frame,Time (Seconds),X,Y,Z,X,Y,Z"]  # fmt: skip
    for k in range(FRAMES):
        cells = [f"{1e3 * x!r},{1e3 * y!r},7.5" if np.isfinite(x) else ",," for x, y in XY[k].tolist()]
        lines.append(f"{k},{TIMES[k]:.6f}," + ",".join(cells))
    (folder / "take.csv").write_text("\n".join(lines) + "\n")
    return "take.csv", {}, ("puck:left", "puck:right")


def wide_table(folder):
    lines = ["t,x1,y1,x2,y2"]
    for k in range(FRAMES):
        cells = [repr(v) if np.isfinite(v) else "" for v in XY[k].ravel().tolist()]
        lines.append(",".join([repr(float(T[k])), *cells]))
    (folder / "wide.csv").write_text("\n".join(lines) + "\n")
    return "wide.csv", {}, ("1", "2")


def long_table(folder):
    frame = pd.DataFrame([(b + 4, k, *(XY[k, b] / 0.0254)) for k in range(FRAMES) for b in range(2)],
                         columns=["object", "frame", "pos_x", "pos_y"])  # fmt: skip
    frame.to_csv(folder / "long.txt", sep="\t", index=False)
    return "long.txt", {"unit": "in", "fps": RATE}, ("4", "5")


def filled():
    t, xy = T, XY.copy()
    xy[:, 1] = np.stack([0.06 - 0.013 * t, 0.03 + 0.004 * np.sin(9 * t)], axis=-1)
    return xy


FILES = (
    trackpy_csv_with_index, trackpy_csv_without_index, trackpy_hdf, trackpy_store, deeplabcut_csv, deeplabcut_h5,
    sleap_h5, trackmate_csv, trackmate_xml, tracker_txt, tracker_norwegian, kinovea_txt, ethovision_utf16, german_csv,
    excel, parquet, mocap_csv, extended_xyz, lammps_dump, h5md, gsd, wide_table, long_table, bare_table,
)  # fmt: skip
NAMES = {"german_csv": "long", "excel": "wide", "parquet": "long", "lammps_dump": "lammps", "extended_xyz": "extxyz",
         "wide_table": "wide", "long_table": "long", "bare_table": "wide"}  # fmt: skip
WITHOUT_GAPS = {"h5md", "gsd"}


@pytest.mark.parametrize("write", FILES, ids=lambda f: f.__name__)
def test_found_by_looking_into_it_with_the_right_values(write, tmp_path):
    file, options, ids = write(tmp_path)
    (done,) = import_all(tmp_path / file, tmp_path / "out", bodies=["*:5mm:10g"], picture=False, **options)
    assert done.format == NAMES.get(write.__name__, write.__name__.split("_")[0])
    r = read_recording(tmp_path / "out")
    assert r.ids == ids
    np.testing.assert_allclose(r.t, T, rtol=0, atol=1e-12)
    # GSD holds single precision, ASE writes eight decimals
    exact = 1e-8 if write is gsd else 1e-11 if write is extended_xyz else 1e-13
    np.testing.assert_allclose(r.xy, filled() if write.__name__ in WITHOUT_GAPS else XY, rtol=0, atol=exact)
    assert r.sampling == pytest.approx(RATE)
    assert {(b.radius, b.mass) for b in r.scene.bodies} == {(0.005, 0.01)}


def test_every_importer_is_tried():
    tried = {NAMES.get(f.__name__, f.__name__.split("_")[0]) for f in FILES}
    assert tried == {importer.name for importer in IMPORTERS}


class TestTrackers:
    def test_pictures_have_y_down_and_pixels_need_a_size(self, tmp_path):
        file, _, _ = trackpy_csv_with_index(tmp_path)
        with pytest.raises(InputError, match=r"in pixels.*--unit"):
            import_recording(tmp_path / file, fps=RATE, bodies=["*:5mm:10g"])
        with pytest.raises(InputError, match="frame rate"):
            import_recording(tmp_path / file, unit="0.1mm/px", bodies=["*:5mm:10g"])
        (down,) = import_recording(tmp_path / file, unit=PIXEL, fps=RATE, bodies=["*:5mm:10g"])
        np.testing.assert_allclose(down.xy[..., 1], XY[..., 1] - HEIGHT * PIXEL, atol=1e-13)
        (kept,) = import_recording(tmp_path / file, unit=PIXEL, fps=RATE, bodies=["*:5mm:10g"], flip_y=False)
        np.testing.assert_allclose(kept.xy[..., 1], HEIGHT * PIXEL - XY[..., 1], atol=1e-13)

    def test_features_that_are_not_linked(self, tmp_path):
        features().drop(columns="particle").to_csv(tmp_path / "f.csv")
        with pytest.raises(InputError, match="not linked"):
            import_recording(tmp_path / "f.csv", unit=PIXEL, fps=RATE, bodies=["*:5mm:10g"])

    def test_short_tracks_can_be_left_out(self, tmp_path):
        frame = features()
        frame.loc[len(frame)] = [1, 2, 900.0, 3, 0.1, 20.0, 1200.0, 0.05, 3, 77]
        frame.to_csv(tmp_path / "tracks.csv")
        (r,) = import_recording(tmp_path / "tracks.csv", bodies=["*:5mm:10g"], min_frames=5, **TRACKPY)
        assert r.ids == ("0", "1")

    def test_several_animals_of_deeplabcut(self, tmp_path):
        frame = _dlc_frame()
        frame.columns = pd.MultiIndex.from_tuples(
            [("DLC", f"animal{b + 1}", "center", c) for b in range(2) for c in ("x", "y", "likelihood")],
            names=["scorer", "individuals", "bodyparts", "coords"],
        )
        frame.to_csv(tmp_path / "many.csv")
        (r,) = import_recording(tmp_path / "many.csv", bodies=["*:5mm:10g"], **TRACKPY)
        assert r.ids == ("animal1.center", "animal2.center")
        np.testing.assert_allclose(r.xy, XY, atol=1e-13)

    def test_tracker_with_one_mass_and_a_decimal_comma(self, tmp_path):
        lines = ["mass A", "t\tx\ty"] + [
            f"{t}\t{x}\t{y}".replace(".", ",") for t, (x, y) in zip(T, XY[:, 0], strict=True)
        ]
        (tmp_path / "a.txt").write_text("\n".join(lines))
        (r,) = import_recording(tmp_path / "a.txt", bodies=["*:5mm:10g"])
        assert r.ids == ("mass_A",)
        np.testing.assert_allclose(r.xy[:, 0], XY[:, 0], atol=1e-13)

    def test_the_masses_of_tracker_and_the_names_of_bodies(self, tmp_path):
        """One mass is the one body that is named; of several the message says how to name them."""
        (tmp_path / "a.txt").write_text("mass_A\nt,x,y\n" + "\n".join(f"0.{k},{k},{k * k}" for k in range(9)))
        (r,) = import_recording(tmp_path / "a.txt", bodies=["ball:5mm:10g"])
        assert r.ids == ("ball",)
        file, _, _ = tracker_txt(tmp_path)
        with pytest.raises(InputError, match=r"'mass_B' is not in the scene; it has: mass_A \(--body 'mass_B:RADIUS"):
            import_recording(tmp_path / file, bodies=["mass_A:5mm:10g"])

    @pytest.mark.parametrize("head, sign", [(('"mass A"', '"t\tx\ty"'), "\t"), (("mass A", '"t,x,y"'), ","), ((), ";")])
    def test_a_spreadsheet_that_took_each_row_for_one_cell(self, tmp_path, head, sign):
        head = head or ('"t;x;y"',)
        rows = [f'"{sign.join(map(repr, [t, *xy]))}"' for t, xy in zip(TIMES, XY[:, 0].tolist(), strict=True)]
        (tmp_path / "a.csv").write_text("\n".join([*head, *rows]))
        (r,) = import_recording(tmp_path / "a.csv", bodies=["*:5mm:10g"])
        np.testing.assert_allclose(r.t, T)
        np.testing.assert_allclose(r.xy[:, 0], XY[:, 0])

    def test_quoted_numbers_with_a_decimal_comma_are_no_rows(self, tmp_path):
        (tmp_path / "a.csv").write_text("x\n" + "\n".join(f'"{k},{k}5"' for k in range(9)))
        (r,) = import_recording(tmp_path / "a.csv", bodies=["*:5mm:10g"], fps=10, delimiter=";")
        assert r.xy[2, 0, 0] == 2.25

    def test_a_time_code_of_kinovea(self, tmp_path):
        (tmp_path / "k.txt").write_text(
            "#Kinovea Trajectory data export\n#T X Y\n0:00:00:00 866,00 320,00\n0:00:00:50 847,00 321,00\n"
            "0:00:01:00 820,00 322,00\n"
        )
        (r,) = import_recording(tmp_path / "k.txt", unit="1mm/px", bodies=["*:5cm:10g"])
        np.testing.assert_allclose(r.t, [0, 0.5, 1.0])
        np.testing.assert_allclose(r.xy[:, 0, 0], [0.866, 0.847, 0.820])
        (r,) = import_recording(tmp_path / "k.txt", unit="1mm/px", fps=25, bodies=["*:5cm:10g"])
        np.testing.assert_allclose(r.t, [0, 0.04, 0.08])

    def test_nodes_of_one_animal_of_sleap(self, tmp_path):
        with h5py.File(tmp_path / "a.h5", "w") as file:
            file["tracks"] = pixels().transpose(2, 1, 0)[None]
            file["track_names"] = np.array([], dtype="S1")
            file["node_names"] = np.array([b"head", b"tail"])
        (r,) = import_recording(tmp_path / "a.h5", bodies=["*:5mm:10g"], **TRACKPY)
        assert r.ids == ("head", "tail")
        np.testing.assert_allclose(r.xy, XY, atol=1e-13)

    def test_simple_tracks_of_trackmate(self, tmp_path):
        points = "".join(f'<detection t="{k}" x="{k}.5" y="2.0" z="0"/>' for k in range(4))
        (tmp_path / "t.xml").write_text(
            '<?xml version="1.0"?><Tracks nTracks="1" spaceUnits="mm" frameInterval="0.25" timeUnits="sec">'
            f'<particle nSpots="4">{points}</particle></Tracks>'
        )
        (r,) = import_recording(tmp_path / "t.xml", bodies=["*:5mm:10g"])
        np.testing.assert_allclose(r.t, [0, 0.25, 0.5, 0.75])
        np.testing.assert_allclose(r.xy[:, 0], [[0.0005 + 0.001 * k, -0.002] for k in range(4)])


class TestTables:
    def write(self, folder, text, name="table.csv"):
        (folder / name).write_text(text)
        return folder / name

    def test_without_a_header_columns_have_numbers(self, tmp_path):
        source = self.write(tmp_path, "0 1 2\n0.1 3 4\n0.2 5 6\n")
        with pytest.raises(InputError, match=r"no header.*--columns"):
            import_recording(source, bodies=["a:1:1"])
        (r,) = import_recording(source, bodies=["a:1:1"], columns="t=1,x=2,y=3")
        np.testing.assert_array_equal(r.xy[:, 0], [[1, 2], [3, 4], [5, 6]])

    @pytest.mark.parametrize("form", [".3f", ".17g"])
    def test_a_table_without_a_header_begins_with_a_clock_that_rises_evenly(self, tmp_path, form):
        stamps = [f"{k / 30:{form}}" for k in range(9)]
        ways = [f"{0.1 * k:.3f}\t{1 - 0.02 * k**2:.3f}" for k in range(9)]
        source = self.write(tmp_path, "\n".join(f"{t}\t{xy}" for t, xy in zip(stamps, ways, strict=True)))
        (done,) = import_all(source, tmp_path / "out", bodies=["a:1mm:1g"], picture=False)
        np.testing.assert_allclose(done.recording.t, np.arange(9) / 30, atol=6e-4)
        np.testing.assert_allclose(done.recording.xy[3, 0], [0.3, 0.82])
        assert any("its columns are taken for t, x and y" in note for note in done.notes)
        source = self.write(tmp_path, "\n".join(f"{t} {k * k}" for k, t in enumerate(stamps)))
        (r,) = import_recording(source, bodies=["a:1cm:1g"], scene="drop")
        np.testing.assert_allclose(r.xy[:, 0, 1], np.arange(9) ** 2)
        source = self.write(tmp_path, "\n".join(f"{k}\t{xy}" for k, xy in enumerate(ways)))
        with pytest.raises(InputError, match=r"goes up by one: does it count frames \(--columns t=1,x=2,y=3 --fps HZ"):
            import_recording(source, bodies=["a:1mm:1g"])
        (r,) = import_recording(source, bodies=["a:1mm:1g"], time_unit="s")
        assert r.t[-1] == 8

    def test_no_other_first_column_is_taken_for_a_clock(self, tmp_path):
        """Of x, y of a throw, of pixels, and of x beside t."""
        rng = np.random.default_rng(2)
        noisy = [f"{0.03 * k + rng.normal(0, 2e-3):.4f} {0.01 * k * k}" for k in range(12)]
        pixels = [f"{round(7.3 * k)} {k * k}" for k in range(12)]
        for rows in (noisy, pixels, [f"{0.02 * k * k:.4f} {k / 30:.4f}" for k in range(12)]):
            with pytest.raises(InputError, match=r"no header.*--columns"):
                import_recording(self.write(tmp_path, "\n".join(rows)), bodies=["a:1mm:1g"])

    @pytest.mark.parametrize("header", ["t s v a", "t s v", "t(s) s(m)", "time,s[cm],v[cm/s]"])
    def test_the_letter_of_a_way_is_the_place_along_a_line(self, tmp_path, header):
        sign = "," if "," in header else " "
        rows = [sign.join(f"{a:.6g}" for a in (0.1 * k, 0.01 * k**2, 0.2 * k, 2.0)[: len(re.split("[ ,]", header))])
                for k in range(9)]  # fmt: skip
        source = self.write(tmp_path, "\n".join([header, *rows]))
        unit = 0.01 if "cm" in header else 1.0
        (r,) = import_recording(source, bodies=["a:1mm:1g"], scene="cart")
        np.testing.assert_allclose(r.xy[:, 0, 0], unit * 0.01 * np.arange(9) ** 2)
        (r,) = import_recording(source, bodies=["a:1mm:1g"], scene="drop")
        np.testing.assert_allclose(r.xy[:, 0, 1], unit * 0.01 * np.arange(9) ** 2)

    def test_one_of_several_runs_of_a_motion_sensor_may_be_the_vertical_one(self, tmp_path):
        header = ",".join(f"{what} Run #{run}" for run in (1, 2) for what in ("Time (s)", "Position (m)"))
        source = self.write(tmp_path, header + "\n0,1,0,2\n0.1,1.1,0.1,2.1\n0.2,1.3,0.2,2.3\n")
        with pytest.raises(InputError, match=r"several runs.*'x=Position .*y=Position \(m\) Run #1 where it is"):
            import_recording(source, bodies=["a:1mm:1g"], scene="drop", columns="t=Time (s) Run #1")

    @pytest.mark.parametrize("header", ["", "theta\n"])
    def test_angles_alone_with_a_frame_rate(self, tmp_path, header):
        """Of a pendulum of 0.4 m: the length of its rod is that of its period."""
        angles = (0.1 * np.cos(math.sqrt(9.81 / 0.4) * np.arange(200) / 20)).tolist()
        source = self.write(tmp_path, header + "".join(f"{a}\n" for a in angles))
        said = {"bodies": ["a:1cm:1g"], "columns": None if header else "angle=1"}
        (r,) = import_recording(source, fps=20.0, scene="pendulum", **said)
        np.testing.assert_allclose(r.angle[:, 0], angles)
        assert r.scene.laws_named("pin")[0].values["length"] == pytest.approx(0.4, rel=3e-3)
        if said["columns"]:
            with pytest.raises(InputError, match=r"no clock is found.*--fps HZ where each row is the next frame"):
                import_recording(source, **said)

    def test_rows_and_encoding_that_are_told(self, tmp_path):
        text = "größe;1\nkeine;2\nt;x;y\n0;1,5;2\n1;1,6;2\n"
        (tmp_path / "a.csv").write_bytes(text.encode("utf-16-be"))
        (r,) = import_recording(tmp_path / "a.csv", bodies=["a:1:1"], skip_rows=2, encoding="utf-16-be", decimal=",")
        np.testing.assert_array_equal(r.xy[:, 0], [[1.5, 2], [1.6, 2]])

    def test_a_row_of_units(self, tmp_path):
        source = self.write(tmp_path, "time,x,y,angle\nms,mm,mm,deg\n0,1,2,90\n20,3,4,180\n")
        (r,) = import_recording(source, bodies=["a:1mm:1g"])
        np.testing.assert_allclose(r.xy[:, 0], [[0.001, 0.002], [0.003, 0.004]])
        np.testing.assert_allclose(r.angle[:, 0], [math.pi / 2, math.pi])
        assert r.t[1] == pytest.approx(0.02)

    def test_a_decimal_comma_that_was_denied(self, tmp_path):
        source = self.write(tmp_path, "t;x;y\n0;1,5;2\n1;1,6;2\n")
        with pytest.raises(InputError, match="decimal comma"):
            import_recording(source, bodies=["a:1:1"], decimal=".")

    @pytest.mark.parametrize(
        ("name", "data", "message"),
        [
            ("a.png", b"\x89PNG\r\n\x1a\n0000", "PNG picture"),
            ("a.mp4", b"\x00\x00\x00\x20ftypisom0000", "film.*granswim track"),
            ("a.mat", b"MATLAB 5.0 MAT-file", "MATLAB"),
            ("a.zip", b"PK\x03\x04rest", "ZIP"),
            ("a.csv", b"", "is empty"),
            ("a.csv", b"colour,size\nred,3\nblue,4\n", "no time and positions.*colour, size"),
            ("a.csv", b"t,s\n0,3\n1,4\n", "no time and positions.*t, s"),
            ("a.bin", bytes(range(1, 200)) * 9, "binary file"),
            ("a.xlsx", b"PK\x03\x04 no workbook", "not a workbook"),
            ("a.xyz", b"2\nProperties=species:S:1:pos:R:3\nA 0 0 0\n", "ends within a frame"),
            ("a.dump", b"ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n2\nITEM: ATOMS id x y\n1 2\n", "row 5"),
            ("a.xml", b"<TrackMate><Model>", "not XML"),
        ],
    )
    def test_what_is_none_of_these_is_named(self, tmp_path, name, data, message):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(InputError, match=message) as caught:
            import_recording(tmp_path / name, bodies=["*:1:1"], fps=1, unit=1)
        assert "\n" not in str(caught.value) and len(str(caught.value)) < 400

    def test_an_hdf5_file_of_something_else(self, tmp_path):
        with h5py.File(tmp_path / "a.h5", "w") as file:
            file["temperature"] = [1.0, 2.0]
        with pytest.raises(InputError, match="it holds: temperature"):
            import_recording(tmp_path / "a.h5")


class TestSaid:
    def test_quantities(self):
        near = [("5mm", 0.005), ("5 mm", 0.005), ("0.1mm/px", 1e-4), ("mm/px", 1e-3), ("1e-2", 0.01), ("mm", 1e-3),
                ("1/30 m", 1 / 30), (0.25, 0.25), (".5cm", 0.005), ("1e-4m", 1e-4)]  # fmt: skip
        for text, value in near:
            assert quantity(text, LENGTHS, per=("px",)) == pytest.approx(value), text
        for text in ("", "parsec", "5mm/s", "mm5", "1/0 m", "--", "5 5"):
            assert quantity(text, LENGTHS, per=("px",)) is None, text

    def test_bodies_laws_and_gravity_from_the_command_line(self, tmp_path, capsys):
        file, _, _ = wide_table(tmp_path)
        code = main([
            "import", str(tmp_path / file), "--body", "*:5mm:10g", "--body", "2:6mm:20g:free", "--gravity",
            "--law", "pin:2,anchor=0.06 0.3,length=0.27", "--law", "linear_drag,c=1e-3", "--out", str(tmp_path / "out"),
        ])  # fmt: skip
        out = capsys.readouterr().out
        assert code == 0 and "2 bodies (1, 2), 30 frames" in out
        assert "a body is not seen, on average, in 5.0% of the frames between its first and its last (longest" in out
        r = read_recording(tmp_path / "out")
        assert r.scene.body("1").radius == 0.005 and r.scene.body("2").mass == 0.02
        assert r.scene.gravity == (0.0, -9.81)
        pin = r.scene.laws_named("pin")[0]
        assert pin.bodies == ("2",) and pin.values["anchor"] == (0.06, 0.3) and pin.values["length"] == 0.27
        assert r.scene.laws_named("linear_drag")[0].values["c"] == 1e-3
        assert (tmp_path / "out/tracks.png").read_bytes()[:4] == b"\x89PNG"

    @pytest.mark.parametrize(
        ("more", "message"),
        [
            (["--gravity", "1,2,3"], "gravity"),
            (["--law", "pim:a"], "unknown law 'pim'"),
            (["--law", "pin:1,lenght=2"], "unknown parameter 'lenght'"),
            (["--law", "pin:1,length"], "PARAMETER=VALUE"),
            (["--scene", "pendulums"], "is no file, and none of pendulum, wheel"),
            (["--flip-y", "up"], "height or no"),
            (["--decimal", "x"], "should be . or ,"),
            (["--skip-rows", "-1"], "zero or more"),
        ],
    )
    def test_what_is_wrong_is_said_in_a_line(self, tmp_path, capsys, more, message):
        file, _, _ = wide_table(tmp_path)
        try:
            code = main(["import", str(tmp_path / file), "--body", "*:5mm:10g", *more, "--out", str(tmp_path / "out")])
        except SystemExit as stopped:
            code = stopped.code
        said = capsys.readouterr().err
        assert code == 2
        assert re.search(message, said), said
        assert not (tmp_path / "out").exists()

    def test_absurd_units_are_warned_of(self, tmp_path):
        t = np.arange(20) / 10
        lines = ["t,x,y"] + [f"{a},{24 * a},{0.0}" for a in t.tolist()]
        (tmp_path / "fast.csv").write_text("\n".join(lines))
        (fast,) = import_all(tmp_path / "fast.csv", tmp_path / "slow", bodies=["a:2.5mm:1g"])
        assert not [w for w in fast.look.warnings if "m/s" in w]
        (fast,) = import_all(tmp_path / "fast.csv", tmp_path / "fast", bodies=["a:2.5mm:1g"], unit="10 m")
        assert any("5 mm across move at 240 m/s" in w and "--unit" in w for w in fast.look.warnings)
        assert json.loads(json.dumps(fast.as_dict()))["speed"] == pytest.approx(240)

    def test_a_density_is_asked_of_what_may_be_a_sphere(self, tmp_path):
        (tmp_path / "a.csv").write_text("t,x\n" + "\n".join(f"{0.1 * k},{0.02 * k}" for k in range(20)))
        for scene, told in (("cart", 0), ("puck", 1)):
            (done,) = import_all(tmp_path / "a.csv", tmp_path / scene, bodies=["a:5mm:0.4kg"], scene=scene)
            assert sum("kg/m^3" in w for w in done.look.warnings) == told

    @pytest.mark.parametrize(
        "uneven, said",
        [
            (0.0, "2 frames have no row, 3.3% of the film (longest gap 0.03 s), no jumps"),
            (4e-3, "  time stamps are uneven: "),
            (5e-5, "2 frames have no row"),
        ],
    )
    def test_frames_without_a_row_are_a_gap_where_stamps_are_even(self, tmp_path, uneven, said):
        t = np.arange(60) / 100
        t = np.delete(t, [20, 21]) + uneven * np.random.default_rng(7).normal(size=58).round(2)
        (tmp_path / "a.csv").write_text("t,x,y\n" + "\n".join(f"{a},{0.3 * a},0.0" for a in t.tolist()))
        (done,) = import_all(tmp_path / "a.csv", tmp_path / "out", bodies=["a:1cm:10g"], picture=False)
        assert any(said in line for line in done.lines()), done.lines()

    def test_a_program_that_writes_when_it_can_leaves_no_frames_out(self, tmp_path):
        """Steps from 0.8 to 1.1 of the usual one, and every fifth of any length: nothing was there to be seen."""
        rng = np.random.default_rng(8)
        steps = np.where(np.arange(119) % 5, rng.uniform(0.8, 1.1, 119), rng.uniform(2.0, 7.0, 119)) * 0.005
        t = np.cumsum(steps)
        (tmp_path / "a.csv").write_text("t,x,y\n" + "\n".join(f"{a},{0.3 * a},0.0" for a in t.tolist()))
        (done,) = import_all(tmp_path / "a.csv", tmp_path / "out", bodies=["a:1cm:10g"], picture=False)
        (said,) = [line for line in done.lines() if "uneven" in line]
        assert re.search(r"23 of 118 steps are longer than 1.5 times the usual 0.00\d+ s, up to 0.03\d* s, no", said)
        assert done.look.gaps == 0 and not any("not seen in" in line or "no row" in line for line in done.lines())

    def test_bodies_of_several_sizes_are_told_by_the_smallest_and_the_largest(self, tmp_path):
        file, _, _ = wide_table(tmp_path)
        (done,) = import_all(
            tmp_path / file, tmp_path / "out", bodies=["1:12cm:0.6kg", "2:3.3cm:58g"], picture=False
        )  # fmt: skip
        assert any("sizes: 6.6 cm to 24 cm across" in line for line in done.lines())
        (done,) = import_all(tmp_path / file, tmp_path / "alike", bodies=["*:5mm:10g"], picture=False)
        assert any("sizes: 1 cm across" in line for line in done.lines())

    def test_gaps_jumps_and_noise_are_found(self, tmp_path):
        rng = np.random.default_rng(3)
        t = np.arange(400) / 100
        x = 0.1 * np.sin(3 * t) + rng.normal(0, 2e-4, 400)
        x[150] += 0.05  # the tracker was somewhere else once
        keep = np.ones(400, bool)
        keep[200:240] = False
        lines = ["t,x,y"] + [f"{a},{b},0.0" for a, b in zip(t[keep].tolist(), x[keep].tolist(), strict=True)]
        (tmp_path / "a.csv").write_text("\n".join(lines))
        (done,) = import_all(tmp_path / "a.csv", tmp_path / "out", bodies=["a:1cm:10g"])
        assert done.look.noise == pytest.approx(2e-4, rel=0.2)
        assert done.look.jumps == 1 and "t = 1.5 s" in done.look.jump_at
        assert any("no body is seen for 0.41 s" in w for w in done.look.warnings)

    @pytest.mark.parametrize(
        "scale, rate, said",
        [
            (1.0, 60.0, ""),
            (2.0, 60.0, "--unit, times 0.5"),
            (1.0, 7.5, "--fps, times 8"),  # filmed in slow motion, believed to be what is played
            (1.28, 60.0, "--unit, times 0.78"),
            (1.05, 60.0, ""),
            (0.9, 60.0, ""),  # a medium may bear it
        ],
    )
    def test_a_fall_at_another_rate_than_gravity_is_doubted(self, tmp_path, scale, rate, said):
        rng, t = np.random.default_rng(4), np.arange(60) / 60
        x, y = 1.5 * t + rng.normal(0, 5e-4, 60), 3.5 * t - 4.905 * t**2 + rng.normal(0, 5e-4, 60)
        rows = [f"{k},{a},{b}" for k, (a, b) in enumerate(zip((scale * x).tolist(), (scale * y).tolist(), strict=True))]
        (tmp_path / "throw.csv").write_text("\n".join(["frame,x,y", *rows]))
        (done,) = import_all(tmp_path / "throw.csv", tmp_path / "out", bodies=["a:2cm:50g"], fps=rate, scene="drop")
        doubt = [w for w in done.look.warnings if "gravity" in w]
        assert (len(doubt) == 1 and said in doubt[0]) if said else not doubt

    def test_a_fall_through_a_drag_is_not_doubted(self, tmp_path):
        """v' = g (1 - (v/u)^2), from rest: y = u^2/g ln(cosh(g t/u))."""
        t = np.arange(60) / 60
        for u in (3.0, 8.0, 30.0):
            y = -(u**2) / 9.81 * np.log(np.cosh(9.81 * t / u)) + np.random.default_rng(9).normal(0, 5e-4, 60)
            rows = [f"{a},0.0,{b}" for a, b in zip(t.tolist(), y.tolist(), strict=True)]
            (tmp_path / "drop.csv").write_text("\n".join(["t,x,y", *rows]))
            (done,) = import_all(tmp_path / "drop.csv", tmp_path / "out", bodies=["a:2cm:50g"], scene="drop")
            assert not [w for w in done.look.warnings if "gravity" in w]

    def bouncing(self, folder, restitution, wrong=0.0):
        """A ball that drops from 1 m, 60 frames a second; a point of the tracker may be wrong."""
        rng, t = np.random.default_rng(6), np.arange(60) / 60
        hit = math.sqrt(2 / 9.81)
        up = t - hit
        y = np.where(up < 0, 1 - 4.905 * t**2, restitution * 9.81 * hit * up - 4.905 * up**2)
        y += rng.normal(0, 5e-4, 60)
        y[40] += wrong
        x = 0.5 * t + rng.normal(0, 5e-4, 60)
        rows = [f"{a},{b},{c}" for a, b, c in zip(t.tolist(), x.tolist(), y.tolist(), strict=True)]
        (folder / "ball.csv").write_text("\n".join(["t,x,y", *rows]))
        return folder / "ball.csv"

    @pytest.mark.parametrize("restitution, wrong", [(0.8, 0.0), (-1.0, 0.0), (-1.0, 0.2)])
    def test_a_bounce_where_the_scene_has_no_wall_is_told(self, tmp_path, restitution, wrong):
        source = self.bouncing(tmp_path, restitution, wrong)
        (done,) = import_all(source, tmp_path / "out", bodies=["ball:2cm:3g"], scene="drop", picture=False)
        told = [w for w in done.look.warnings if "[[wall]]" in w]
        if restitution < 0:  # it falls on
            assert not told
        else:
            assert len(told) == 1 and "ball turns round within two frames at t = 0.4" in told[0]

    def test_the_floor_of_the_page_on_importing_holds_a_ball(self, tmp_path):
        page = (Path(__file__).parent.parent / "docs/import_tracks.md").read_text(encoding="utf-8")
        (text,) = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
        (tmp_path / "floor.toml").write_text(text)
        source = self.bouncing(tmp_path, 0.8)
        (done,) = import_all(
            source, tmp_path / "out", bodies=["ball:2cm:3g"], scene=tmp_path / "floor.toml", picture=False
        )
        assert not [w for w in done.look.warnings if "[[wall]]" in w]
        assert [wall.id for wall in read_recording(tmp_path / "out").scene.walls] == ["floor"]

    @pytest.mark.parametrize("length, said", [(0.5, ""), (1.0, "a point on a rod of 1 m")])
    def test_a_swing_of_another_period_than_its_rod_has_is_doubted(self, tmp_path, length, said):
        from scipy.integrate import solve_ivp

        t = np.arange(300) / 30
        angle = solve_ivp(lambda _, s: [s[1], -9.81 / 0.5 * np.sin(s[0])], (0, 10), [1.2, 0], t_eval=t, rtol=1e-8).y[0]
        rows = [f"{a},{b}" for a, b in zip(t.tolist(), angle.tolist(), strict=True)]
        (tmp_path / "swing.csv").write_text("\n".join(["t,angle", *rows]))
        (done,) = import_all(
            tmp_path / "swing.csv", tmp_path / "out", bodies=["b:5cm:1kg"], scene="pendulum",
            laws=[f"pin:b,length={length}"],
        )  # fmt: skip
        doubt = [w for w in done.look.warnings if "swings" in w]
        assert (len(doubt) == 1 and said in doubt[0]) if said else not doubt

    def test_places_read_off_a_scale_are_no_jumps(self, tmp_path):
        t = np.arange(60) / 25
        x = np.round(0.187 + 0.2425 * t, 3)
        x[40:] = x[39] + np.round(0.02 * (t[40:] - t[39]), 3)
        rows = [f"{a},{b}" for a, b in zip(t.tolist(), x.tolist(), strict=True)]
        (tmp_path / "read.csv").write_text("\n".join(["t,x_metros", *rows]))
        (done,) = import_all(tmp_path / "read.csv", tmp_path / "out", bodies=["g:2cm:0.4kg"], scene="cart")
        assert done.look.jumps == 0

    def test_each_key_that_is_written_has_a_remark(self, tmp_path):
        file, _, _ = wide_table(tmp_path)
        import_all(tmp_path / file, tmp_path / "out", bodies=["*:5mm:10g"], laws=["linear_drag,c=1e-3"], gravity=9.81)
        text = (tmp_path / "out/recording.toml").read_text()
        first = {}
        for line in text.splitlines():
            if " = " in line:
                first.setdefault(line.split(" = ")[0], line)
        assert {"format", "title", "sampling", "gravity", "id", "radius", "mass", "name", "c"} <= first.keys()
        bare = [name for name, line in first.items() if "  # " not in line and not line.endswith("[")]
        assert not bare, bare

    def test_remarks_never_change_a_value(self):
        text = (
            'title = "a [b] # c"\n[scene]\ngravity = [\n    0.0,\n    -9.81,\n]\n[[law]]\nname = "pin"\nlength = 1.0\n'
        )
        assert "# m: length L of the rod" in commented(text)
        assert len({(k.table, k.name) for k in KEYS}) == len(KEYS)


class TestScenes:
    def swing(self, folder, *, anchor=(0.1, 0.4), length=0.25, start=0.9, noise=1e-4, frames=600):
        """A CSV of a pendulum in cm, with a picture's y, 60 a second."""
        from scipy.integrate import solve_ivp

        t = np.arange(frames) / 60
        a = solve_ivp(lambda _, s: [s[1], -9.81 / length * np.sin(s[0]) - 0.35 * s[1]], (0, frames / 60), [start, 0.0],
                      t_eval=t, rtol=1e-9, atol=1e-9).y[0]  # fmt: skip
        rng = np.random.default_rng(5)
        xy = np.array(anchor) + length * np.stack([np.sin(a), -np.cos(a)], axis=-1) + rng.normal(0, noise, (frames, 2))
        lines = ["frame,x (cm),y (cm)"] + [f"{k},{100 * x!r},{60 - 100 * y!r}" for k, (x, y) in enumerate(xy.tolist())]
        (folder / "swing.csv").write_text("\n".join(lines))
        return folder / "swing.csv"

    def cart(self, folder, *, unit=5e-3, tau=0.1, noise=5e-4):
        """A log of a cart whose motor lags: time, place in mm and what the motor was told, which changes at once."""
        t = np.arange(240) / 50
        told = np.where(t % 1.2 < 0.6, 60.0, -40.0) * (t > 0.3)
        v = x = 0.0
        way = [x]
        for command in unit * told[:-1]:
            # exactly, over a row: v goes to the command like exp(-t/tau)
            kept = math.exp(-0.02 / tau)
            x += 0.02 * command + (v - command) * tau * (1 - kept)
            v = command + (v - command) * kept
            way.append(x)
        seen = 1000 * (np.array(way) + np.random.default_rng(1).normal(0, noise, len(t)))
        rows = [f"{a:.2f};{b:.3f};{c:g}" for a, b, c in zip(t.tolist(), seen.tolist(), told.tolist(), strict=True)]
        (folder / "log.csv").write_text("\n".join(["Zeit [s];Ort [mm];Motor", *rows]))
        return folder / "log.csv"

    def test_what_a_motor_was_told_is_a_column_of_the_log(self, tmp_path, capsys):
        log = self.cart(tmp_path)
        assert main(["import", str(log), "--body", "cart:5cm:500g", "--scene", "cart", "--input", f"{log}:Motor",
                     "--law", "drive:cart,gain=0.005", "--out", str(tmp_path / "cart")]) == 0  # fmt: skip
        assert "commands of cart change at once" in capsys.readouterr().out
        read = read_recording(tmp_path / "cart")
        assert [item.name for item in read.scene.laws] == ["rail", "drive"]
        times, values = (np.array(v) for v in read.scene.inputs["cart"])
        assert np.interp([0.39, 0.5999, 0.6001], times, values) == pytest.approx([60.0, 60.0, -40.0])
        verdict = gs.diagnose(read, seed=1).verdict
        assert [m["name"] for m in verdict["mechanisms"]] == ["actuator_lag"] and verdict["complete"]
        tau = verdict["mechanisms"][0]["parameters"]["tau"]
        assert tau["low"] < 0.1 < tau["high"] < 0.102

    @pytest.mark.parametrize(
        ("given", "words"),
        [
            ("{log}", "its columns are .*: say which, as --input BODY=log.csv:COLUMN"),
            ("{log}:Moter", "has no column 'Moter'"),
            ("waggon={log}:Motor", "'waggon' is no body that is seen; these are: cart"),
            ("nowhere.csv", "no such file"),
            ("{folder}/twice.csv", "row 3: has two commands at t = 0 s"),
            ("{folder}/empty.csv", "has no command in column cart"),
            ("{folder}/words.csv", "row 2: cart should be a number, got 'fast'"),
        ],
    )
    def test_commands_that_cannot_be_read(self, tmp_path, given, words):
        log = self.cart(tmp_path)
        for name, rows in (("twice", "0,1\n0,2"), ("empty", "0,\n1,"), ("words", "0,fast")):
            (tmp_path / f"{name}.csv").write_text(f"t,cart\n{rows}\n")
        with pytest.raises(InputError, match=words):
            import_recording(
                log, bodies=["cart:5cm:500g"], scene="cart", inputs=[given.format(log=log, folder=tmp_path)]
            )

    def test_the_clock_that_was_said_is_that_of_the_commands_of_the_same_log(self, tmp_path):
        """A log without a header: its columns have numbers, in the recording and where its commands are."""
        log = tmp_path / "log.csv"
        log.write_text("".join(f"60;{0.1 * k:g};{k * k};{k > 3:d}\n" for k in range(9)))
        (r,) = import_recording(
            log, bodies=["cart:5cm:500g"], scene="cart", columns="t=2,x=3", unit="mm", inputs=[f"cart={log}:4"]
        )
        assert r.t == pytest.approx(0.1 * np.arange(9))
        assert np.interp([0.29, 0.41], *r.scene.inputs["cart"]) == pytest.approx([0.0, 1.0])

    def test_a_commanded_angle_is_given_as_a_place_and_its_rate(self, tmp_path):
        t = np.arange(120) / 50
        goal, angle = 0.5 * np.sin(3 * t), 0.5 * np.sin(3 * (t - 0.04))
        rows = np.column_stack([t, goal, angle, np.gradient(goal, t)])
        log = tmp_path / "servo.csv"
        np.savetxt(log, rows, "%.8g", ",", header="t,goal,position,rate", comments="")
        with pytest.raises(InputError, match=r"only the angle of arm is seen.*x=ANGLE --scene cart.*rate") as caught:
            import_recording(log, bodies=["arm:1cm:1kg"], columns="t=t,angle=position", inputs=[f"arm={log}:goal"])
        assert "\n" not in str(caught.value)
        (r,) = import_recording(
            log, bodies=["arm:1cm:1kg"], columns="t=t,x=position", inputs=[f"{log}:rate"], scene="cart"
        )
        assert [item.name for item in r.scene.laws] == ["rail", "drive"]
        rate = np.interp(t, *r.scene.inputs["arm"])
        way = np.append(0, np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(t)))
        np.testing.assert_allclose(way, goal, atol=2e-3)

    def test_commands_of_arrays(self):
        t = np.arange(6) * 0.1
        told = np.array([0.0, 0.0, 0.2, 0.2, 0.2, 0.2])
        xy = np.column_stack([np.cumsum(told) * 0.1, 0 * t])
        known = {"radius": "5cm", "mass": "1kg", "names": "cart", "scene": "cart"}
        made = gs.make_recording(t, xy, inputs={"cart": told}, **known)
        assert [item.name for item in made.scene.laws] == ["rail", "drive"]
        assert np.interp([0.15, 0.25], *made.scene.inputs["cart"]) == pytest.approx([0.0, 0.2])
        linear = gs.make_recording(t, xy, inputs={"cart": np.column_stack([t, told])}, hold=False, **known)
        assert np.interp(0.15, *linear.scene.inputs["cart"]) == pytest.approx(0.1)
        for inputs, words in (({"car": told}, "no such body"), ({"cart": told[:3]}, r"should be \(T,\) = \(6,\)")):
            with pytest.raises(InputError, match=words):
                gs.make_recording(t, xy, inputs=inputs, **known)

    def test_a_pendulum_finds_its_pin(self, tmp_path):
        (r,) = import_recording(self.swing(tmp_path), bodies=["bob:1cm:50g"], scene="pendulum", fps=60, flip_y=60.0)
        pin = r.scene.laws_named("pin")[0].values
        assert pin["length"] == pytest.approx(0.25, rel=1e-3)
        assert pin["anchor"] == pytest.approx((0.1, 0.4), abs=3e-4)
        assert r.scene.gravity == (0.0, -9.81) and r.scene.adjustable[0].name == "pin.length"

    def test_a_wrong_scale_does_not_displace_the_pivot(self, tmp_path):
        """The length of the arc is then that of the picture, the period's another one: both are told."""
        (done,) = import_all(
            self.swing(tmp_path), tmp_path / "out", bodies=["bob:1cm:50g"], scene="pendulum", fps=60, flip_y=60.0,
            unit="1.006 cm", picture=False,
        )  # fmt: skip
        pin = done.recording.scene.laws_named("pin")[0].values
        assert pin["length"] == pytest.approx(1.006 * 0.25, rel=5e-4)
        assert pin["anchor"] == pytest.approx((0.1006, 0.4024), abs=2e-4)
        (note,) = [n for n in done.notes if "hangs on a rod" in n]
        told = re.search(r"by its arc; but .* point on a rod of ([\d.]+) m.* 0\.6\d* % too large \(--unit", note)
        assert told and float(told[1]) == pytest.approx(0.25, rel=1e-3)

    def test_a_short_arc_asks_for_the_length(self, tmp_path):
        source = self.swing(tmp_path, start=0.01)
        with pytest.raises(InputError, match="--law 'pin:bob,length"):
            import_recording(source, bodies=["bob:1cm:50g"], scene="pendulum", fps=60, flip_y=60.0)
        laws = ["pin:bob,length=0.25"]
        (r,) = import_recording(source, bodies=["bob:1cm:50g"], scene="pendulum", laws=laws, fps=60, flip_y=60.0)
        assert r.scene.laws_named("pin")[0].values["anchor"] == pytest.approx((0.1, 0.4), abs=3e-3)

    def one_coordinate(self, folder, coordinate, **swing):
        """The same pendulum, of which one coordinate is in the file."""
        table = pd.read_csv(self.swing(folder, **swing))
        table[["frame", f"{coordinate} (cm)"]].to_csv(folder / "one.csv", index=False)
        return folder / "one.csv"

    @pytest.mark.parametrize("start", [0.12, 0.9])
    def test_a_pendulum_of_which_x_alone_is_measured_has_the_length_of_its_period(self, tmp_path, start):
        source = self.one_coordinate(tmp_path, "x", start=start)
        (done,) = import_all(
            source, tmp_path / "out", bodies=["bob:1cm:50g"], scene="pendulum", fps=60, picture=False
        )  # fmt: skip
        pin = done.recording.scene.laws_named("pin")[0].values
        assert pin["length"] == pytest.approx(0.25, rel=3e-3)
        assert pin["anchor"] == pytest.approx((0.1, pin["length"]), abs=5e-4)  # y stands as 0 where it hangs
        (bounds,) = done.recording.scene.adjustable
        assert (bounds.low, bounds.high) == pytest.approx((0.95 * pin["length"], 1.05 * pin["length"]), rel=1e-3)
        (note,) = [n for n in done.notes if "hangs on a rod" in n]
        assert "by its period of 1.0" in note and "x alone is measured" in note
        assert not done.look.warnings

    @pytest.mark.parametrize(
        "coordinate, frames, words",
        [("x", 40, "x alone is measured, which has no arc, and no period can be told.*--law 'pin:bob,length"),
         ("y", 600, "y alone is measured, which goes along gravity.*--columns x=NAME")],
    )  # fmt: skip
    def test_one_coordinate_that_tells_no_rod_is_named(self, tmp_path, coordinate, frames, words):
        source = self.one_coordinate(tmp_path, coordinate, frames=frames)
        with pytest.raises(InputError, match=words):
            import_recording(source, bodies=["bob:1cm:50g"], scene="pendulum", fps=60)

    @pytest.mark.parametrize("rate, told", [(60, ""), (54, "is that of a point on a rod of 0.30")])
    def test_an_arc_and_a_period_of_two_lengths_are_both_told(self, tmp_path, rate, told):
        (done,) = import_all(
            self.swing(tmp_path), tmp_path / "out", bodies=["bob:1cm:50g"], scene="pendulum", fps=rate, flip_y=60.0,
            picture=False,
        )  # fmt: skip
        (note,) = [n for n in done.notes if "hangs on a rod" in n]
        assert (told in note and "--fps, times 1.1" in note) if told else "; but" not in note

    def test_a_length_that_was_said_and_that_of_the_period_are_both_told(self, tmp_path):
        source = self.one_coordinate(tmp_path, "x", start=0.12)
        (done,) = import_all(
            source, tmp_path / "out", bodies=["bob:1cm:50g"], scene="pendulum", laws=["pin:bob,length=0.28"], fps=60,
            picture=False,
        )  # fmt: skip
        assert done.recording.scene.laws_named("pin")[0].values["length"] == 0.28
        (note,) = [n for n in done.notes if "hangs on a rod" in n]
        assert "a point on a rod of 0.2" in note and "--adjustable pin.length=0.23" in note

    @pytest.mark.deep
    def test_own_csv_of_a_pendulum_to_a_verdict_in_two_commands(self, tmp_path, capsys):
        source = self.swing(tmp_path, noise=5e-4, frames=360)
        assert main(["import", str(source), "--body", "bob:1cm:50g", "--scene", "pendulum", "--fps", "60",
                     "--flip-y", "60", "--out", str(tmp_path / "swing")]) == 0  # fmt: skip
        assert main(["diagnose", str(tmp_path / "swing"), "--out", str(tmp_path / "out")]) == 0
        verdict = json.loads((tmp_path / "out/verdict.json").read_text())
        # a drag on a rod's end and a viscous bearing are one and the same on a pendulum
        assert verdict["verdict"] == "missing_physics"
        assert verdict["mechanisms"][0]["name"] in ("linear_drag", "joint_drag")
        capsys.readouterr()

    def test_cart_puck_drop_swimmer(self, tmp_path):
        t = np.arange(60) / 30
        along = np.stack([0.3 + 0.1 * np.cos(2 * t), 0.2 + 0.05 * np.cos(2 * t)], axis=-1)
        (tmp_path / "cart.csv").write_text(
            "t,x,y\n" + "\n".join(f"{a},{x},{y}" for a, (x, y) in zip(t, along, strict=True))
        )
        (r,) = import_recording(
            tmp_path / "cart.csv", bodies=["cart:2cm:1kg"], scene="cart", laws=["spring:cart,anchor=0 0,stiffness=4"]
        )
        assert r.scene.laws_named("rail")[0].values["direction"] == pytest.approx((0.894427, 0.447214), abs=1e-6)
        assert r.scene.laws_named("spring")[0].values["stiffness"] == 4.0
        (r,) = import_recording(tmp_path / "cart.csv", bodies=["ball:2cm:1kg"], scene="drop")
        assert r.scene.gravity == (0.0, -9.81)
        file, _, _ = wide_table(tmp_path)
        (r,) = import_recording(tmp_path / file, bodies=["*:5mm:10g"], scene="puck")
        assert not r.scene.laws_named("contact_elastic") and r.scene.gravity == (0.0, 0.0)
        (r,) = import_recording(tmp_path / file, bodies=["*:1cm:10g"], scene="puck")
        assert r.scene.laws_named("contact_elastic")[0].values["restitution"] == 1.0
        t = np.arange(200) / 100
        angle = 0.6 * np.sin(2 * math.pi * 7.0 * t)
        lines = ["t,x0,y0,x1,y1,x2,y2"]
        for a, b in zip(t, angle, strict=True):
            lines.append(f"{a},{-0.003 * math.cos(b)},{-0.003 * math.sin(b)},0.0,0.0,0.003,0.0")
        (tmp_path / "swim.csv").write_text("\n".join(lines))
        (r,) = import_recording(tmp_path / "swim.csv", bodies=["*:1.5mm:14mg"], scene="swimmer")
        assert [b.role for b in r.scene.bodies] == ["head", "tail", "tail"]
        assert r.scene.laws_named("bending")[0].values["frequency"] == pytest.approx(7.0, rel=0.02)


@pytest.mark.parametrize(
    ("rate", "digits", "frames"), [(29.97, 3, 60), (60.0, 2, 300), (240.0, 3, 25), (15.0324, 3, 40)]
)
def test_a_frame_rate_is_that_of_all_rounded_stamps_together(rate, digits, frames):
    t = np.round(np.arange(frames) / rate, digits)
    assert frame_rate(t) == pytest.approx(rate, rel=2 * 10.0**-digits * rate / frames)
    gaps = np.delete(t, [5, 6, 11])
    assert frame_rate(gaps) == pytest.approx(rate, rel=2 * 10.0**-digits * rate / frames)


def test_a_frame_rate_of_uneven_stamps_is_one_over_the_usual_step():
    assert frame_rate(np.array([0.0, 0.1, 0.2, 0.34, 0.44, 0.58, 0.72])) == pytest.approx(1 / 0.12)


def test_a_frame_rate_where_most_steps_have_lost_a_frame():
    t = np.round(np.arange(40) / 360, 6)
    seen = t[np.arange(40) % 3 != 1]
    assert frame_rate(seen) == pytest.approx(360, rel=1e-4)
    # a program that writes when it can has no frames
    uneven = np.cumsum(np.random.default_rng(2).uniform(0.01, 0.03, 60))
    assert frame_rate(uneven) == pytest.approx(1 / np.median(np.diff(uneven)))
