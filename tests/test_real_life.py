"""Cases under real-life conditions: what is drawn, what an ideal test could tell, and how answers are scored."""

from __future__ import annotations

import hashlib
import json
import math
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from granswim_pymunk.cli import main
from granswim_pymunk.errors import InputError
from granswim_pymunk.proof import bed_cases, prove, real_beds, real_life, windows
from granswim_pymunk.proof.bed_cases import drawn_number
from granswim_pymunk.proof.beds import draw_bed, packed
from granswim_pymunk.proof.cases import Case
from granswim_pymunk.proof.conceal import conceal, real_kind
from granswim_pymunk.proof.ideal import EXACT, Errors, Response, Truth
from granswim_pymunk.proof.prove import DEVELOPMENT_SECRET, full_cases, sliced, table_text
from granswim_pymunk.proof.real_beds import real_bed_case
from granswim_pymunk.proof.real_life import disturbed, draw_errors, real_bodies_case
from granswim_pymunk.proof.real_score import read_real_rows, real_figures, score_real
from granswim_pymunk.proof.seal import checked_out, generator, opened, series_secret
from granswim_pymunk.proof.setups import Setup, cart, meeting, meetings, pendulum, pucks
from granswim_pymunk.proof.world import Effect, World
from granswim_pymunk.recording import read_recording
from granswim_pymunk.scene import Body, Scene
from granswim_pymunk.validation import real_left
from granswim_pymunk.validation.real_figures import main as real_figures_command


def slider(duration: float = 1.0, rate: float = 100.0, noise: float = 1e-4) -> Setup:
    """One puck that slides to the right."""
    body = Body("a", "free", 0.02, 0.05, initial=(0.0, 0.0, 0.4, 0.0))
    t = np.arange(int(duration * rate) + 1) / rate
    return Setup("table", Scene((body,), ()), t, 1e-3, noise, ("linear_drag", "quadratic_drag", "uniform_force"), ())


def response(truth: Truth, errors: Errors | None = None, part: float = 1.0) -> Response:
    start = World(truth.setup.scene, [], truth.setup.dt).start()
    return Response(truth, errors or Errors(truth.setup.noise), start, part)


class TestIdeal:
    def test_a_steady_force_has_the_closed_standard_error(self) -> None:
        """sigma sqrt(720/(fps T^5)) with a free start; tilt and scale are not in the way of a force across."""
        setup = slider(duration=2.0)
        truth = Truth(setup, first=Effect("uniform_force", {"a": (0.0, 0.02)}))
        r = response(truth)
        sigma = r.left(r.strength("first"), by=EXACT)
        assert sigma == pytest.approx(0.02 / (1e-4 * np.sqrt(720 / (100 * 2.0**5))), rel=0.03)
        # a tilt of unknown size up to 0.5 mm/m hides a force below it
        assert r.sigma("first") == pytest.approx(0.02 / (9.81 * 5e-4), rel=0.05)

    def test_a_number_that_may_be_adjusted_conceals_nothing(self) -> None:
        setup = next(s for k in range(20) if (s := meeting(np.random.default_rng(k))).scene.adjustable)
        assert [a.name for a in setup.scene.adjustable] == ["contact_elastic.restitution"]
        truth = Truth(setup, first=Effect("restitution", {"restitution": 0.8}))
        assert response(truth).sigma("first") == pytest.approx(0.0, abs=1e-3)
        fixed = replace(setup, scene=replace(setup.scene, adjustable=()))
        assert response(replace(truth, setup=fixed)).sigma("first") > 5

    def test_slow_noise_and_jitter_take_strength_away(self) -> None:
        setup = slider()
        truth = Truth(setup, first=Effect("linear_drag", {"c": 0.01, "p": 0}))


        def sigma(errors: Errors) -> float:
            r = response(truth, errors)
            return r.left(r.strength("first"), by=EXACT)

        clean = sigma(Errors(1e-4))
        slow = sigma(Errors(1e-4, slow=1e-4, frames=20.0))
        jitter = sigma(Errors(1e-4, jitter=5e-4))
        assert slow < 0.6 * clean
        # 0.5 ms at 0.4 m/s are 0.2 mm, twice the noise
        assert jitter == pytest.approx(clean / np.sqrt(1 + 4), rel=0.15)

    def test_covariance_is_that_of_the_noise_that_is_drawn(self) -> None:
        errors = Errors(1e-4, pixel=2e-4, slow=1.5e-4, frames=8.0)
        rng = np.random.default_rng(0)
        drawn = np.array([disturbed(np.full((60, 2), 0.1 * rng.random()), errors, rng, 2)[:, 0] for _ in range(3000)])
        drawn -= drawn.mean(axis=1, keepdims=True)
        t = np.arange(60) / 100
        centre = np.eye(60) - 1 / 60
        expected = centre @ errors.covariance(t, np.zeros(60)) @ centre
        found = drawn.T @ drawn / len(drawn)
        assert np.diag(found).mean() == pytest.approx(np.diag(expected).mean(), rel=0.05)
        assert np.diag(found, 5).mean() == pytest.approx(np.diag(expected, 5).mean(), rel=0.1)

    def test_a_rival_that_is_the_same_has_no_d_prime(self) -> None:
        setup = replace(pendulum(np.random.default_rng(4)), noise=1e-4)
        setup = replace(setup, scene=replace(setup.scene, adjustable=(), laws=setup.scene.laws[:2]), angles=True)
        truth = Truth(setup, first=Effect("linear_drag", {"c": 0.02, "p": 0}))
        found = response(truth).rivals("first", ("linear_drag", "ambient_flow", "added_mass"))
        assert set(found) == {"ambient_flow", "added_mass"}
        assert found["ambient_flow"] < 0.01 and found["added_mass"] > 3

    def test_what_is_left_falls_with_every_name(self) -> None:
        truth = Truth(slider(2.0), first=Effect("linear_drag", {"c": 0.01, "p": 0}), scale=0.005,
                      second=Effect("quadratic_drag", {"c": 0.02, "p": 0}), tilt=(0.0, 0.005))  # fmt: skip
        left = response(truth).remains()
        assert left[""] > left["first"] > left["first+second"] > left["first+second+tilt"]
        assert left["first+scale+second+tilt"] == 0.0
        assert left["first+second+tilt"] < 1e-6  # a wrong scale is nothing to free flight with drag

    def test_a_stated_error_is_fitted_before_anything_is_left(self) -> None:
        """Contract: ``mass_error`` and ``radius_error`` are nuisances of the fit; what is not stated is exact."""
        setup = pucks(np.random.default_rng(1))
        off = {name: 1.0 + 0.01 * (-1) ** k for k, name in enumerate(setup.mobile)}
        truth = Truth(setup, mass=off)
        r = response(truth, part=0.5)
        held, stated, other = (r.remains(m, s)[""] for m, s in ((None, None), (0.02, None), (None, 0.02)))
        # half a standard deviation each is all that a prior of 2 % leaves, of any number of masses
        assert held > 10 and stated <= 0.5 * math.sqrt(len(setup.mobile)) + 1e-6 and other > 3 * stated

    def test_numbers_are_those_in_the_believed_masses(self) -> None:
        truth = Truth(slider(), first=Effect("linear_drag", {"c": 0.01, "p": 0}), mass={"a": 1.02})
        assert response(truth).believed()["first"].values["c"] == pytest.approx(0.01 / 1.02, rel=1e-4)
        truth = replace(truth, mass={}, scale=0.005, first=Effect("quadratic_drag", {"c": 0.05, "p": 0}))
        assert response(truth).believed()["first"].values["c"] == pytest.approx(0.05 / 1.005, rel=1e-4)

    def test_an_ideal_analyst_finds_what_the_film_tells(self) -> None:
        """A mass in free flight is not told, and is as it is believed; radii of pucks that collide are."""
        truth = Truth(slider(), first=Effect("linear_drag", {"c": 0.01, "p": 0}), mass={"a": 1.02}, scale=0.005)
        assert response(truth).ideal()["first"].values["c"] == pytest.approx(0.01 / 1.02, rel=1e-3)
        setup = pucks(np.random.default_rng(1))
        off = {name: 1.0 + 0.005 * (-1) ** k for k, name in enumerate(setup.mobile)}
        truth = Truth(setup, first=Effect("linear_drag", {"c": 0.02, "p": 0}), radius=off)
        assert response(truth, part=0.5).ideal()["first"].values["c"] == pytest.approx(0.02, rel=0.02)

    def test_bodies_that_collide_have_numbers_too(self) -> None:
        setup = pucks(np.random.default_rng(1))
        assert 3 <= len(meetings(setup)) <= 10 and 4 <= len(setup.mobile) <= 6
        off = {name: 1.0 + 0.005 * (-1) ** k for k, name in enumerate(setup.mobile)}
        truth = Truth(setup, first=Effect("linear_drag", {"c": 0.02, "p": 0}), radius=off)
        r = response(truth, part=0.5)
        assert r.sigma("first") > 5
        assert r.believed()["first"].values["c"] == pytest.approx(0.02, rel=0.3)


class TestDraw:
    def test_streams_of_a_case(self) -> None:
        """What is concealed changes the tracks alone; the same seed draws the same."""
        a, b = (real_bodies_case(4, DEVELOPMENT_SECRET, effect) for effect in ("null", "restitution"))
        assert a.truth["setup"] == b.truth["setup"] == "meeting" and not a.truth["effects"]
        assert b.truth["effects"][0]["name"] == "restitution" and b.truth["sigma"] > 4
        assert a.recording.scene.bodies == b.recording.scene.bodies and a.truth["tilt"] == b.truth["tilt"]
        again = real_bodies_case(4, DEVELOPMENT_SECRET, "null")
        assert np.array_equal(again.recording.xy, a.recording.xy, equal_nan=True) and again.truth == a.truth

    def test_nuisances_are_those_of_a_laboratory(self) -> None:
        rng = np.random.default_rng(3)
        drawn = [draw_errors(rng, 1e-4, 100.0, 200) for _ in range(400)]
        errors = [d.errors for d in drawn]
        assert {d.stated for d in drawn} == {"right", "double", "half", "missing"}
        assert all(3 <= e.frames <= 30 and e.slow <= 1e-4 for e in errors if e.slow)
        assert {e.jitter for e in errors} == {0.0, 5e-4} and {e.outliers for e in errors} == {0.0, 0.005}
        assert 0.4 < np.mean([e.slow > 0 for e in errors]) < 0.6
        stated = {d.stated: real_life.stated_noise(d) for d in drawn if d.errors.pixel == 0}
        assert stated == {"right": 1e-4, "double": 2e-4, "half": 5e-5, "missing": None}

    def test_errors_are_stated_in_half_of_the_cases(self) -> None:
        rng = np.random.default_rng(0)
        said = [real_life.stated_errors(rng, Errors(1e-4, jitter=5e-4)) for _ in range(300)]
        assert {s["mass_error"] for s in said} == {None, 0.02} and {s["time_noise"] for s in said} == {None, 5e-4}
        assert {real_life.stated_errors(rng, Errors(1e-4))["time_noise"] for _ in range(30)} == {None}
        assert 120 < sum(s["radius_error"] is None for s in said) < 180

    def test_a_film_shows_what_is_drawn(self) -> None:
        errors = Errors(1e-4, pixel=3e-4, outliers=0.005, bursts=(9,))
        values = disturbed(np.zeros((4000, 4)), errors, np.random.default_rng(5), 2)
        seen = values[np.isfinite(values)]
        assert np.allclose(seen / 3e-4, np.round(seen / 3e-4), atol=1e-4)
        far = np.isfinite(values[:, :2]).all(axis=1) & (np.hypot(*values[:, :2].T) > 1e-3)
        assert 8 < far.sum() < 36
        gone = np.isnan(values[:, 0]).astype(int) + np.isnan(values[:, 2])
        assert 9 <= gone.sum() <= 18 and not gone[:5].any()

    def test_a_second_effect_is_a_fraction_of_the_first(self) -> None:
        """By what it changes: an added mass that the prior of the mass hides is no weak one."""
        cases = [real_bodies_case(seed, DEVELOPMENT_SECRET).truth for seed in (12, 18, 24)]
        two = [t for t in cases if len(t["effects"]) == 2]
        assert two and all(t["effects"][0]["name"] != t["effects"][1]["name"] for t in two)
        for t in two:
            assert set(t["left"]) >= {"", "first", "second", "first+second"}
            # what is left of both is no more than naming one of them leaves
            assert t["left"]["first+second"] <= min(t["left"]["first"], t["left"]["second"]) + 1e-6

    def test_a_case_is_written_and_sealed(self, tmp_path: Path) -> None:
        folder = conceal(1, tmp_path / "out", DEVELOPMENT_SECRET, tmp_path / "sealed", kind="real-life")
        sealed = json.loads((tmp_path / "sealed" / "real-life-1.json").read_text())
        truth = opened(sealed, (tmp_path / "out" / "real-life-1.sha256").read_text())
        recording = read_recording(folder)
        assert truth["setup"] == "cart" and recording.title == "real-life case"
        noise = truth["errors"]["white"], truth["errors"]["pixel"]
        assert recording.position_noise == pytest.approx(np.hypot(noise[0], noise[1] / np.sqrt(12)), rel=0.01)

    def test_the_command(self, tmp_path: Path, capsys) -> None:
        secret = tmp_path / "secret"
        secret.write_text("0123456789abcdef")
        given = ["conceal", "--seed", "2", "--out", str(tmp_path / "o"), "--secret", str(secret), "--real-life"]
        assert main([*given, "--effect", "null"]) == 0
        assert (tmp_path / "o" / "real-life-2" / "tracks.csv").exists()
        assert main([*given, "--kind", "curve"]) == 2
        assert "curve is not drawn under real-life conditions" in capsys.readouterr().err
        assert real_kind("bodies") == real_kind("real-life") == "real-life"


class TestBeds:
    def test_a_bed_is_misjudged_and_filmed_badly(self, monkeypatch) -> None:
        """Radii and masses of the recording are not those of the run; the picture has the noise that is sealed."""
        real = bed_cases.draw_bed

        def short(rng, name, small):
            setup = real(rng, name, small)
            return replace(setup, t=setup.t[:70], scene=replace(setup.scene, adjustable=()))

        monkeypatch.setattr(bed_cases, "draw_bed", short)
        monkeypatch.setattr(windows, "MOST", {True: 2, False: 2})
        case = real_bed_case(1, DEVELOPMENT_SECRET, "null", small=True)
        truth, recording = case.truth, case.recording
        assert truth["category"] == "null" and truth["stated"] == "double" and len(truth["radius"]) > 200
        errors = Errors(**truth["errors"])
        assert recording.position_noise == pytest.approx(2 * errors.fast, rel=0.01)
        packing = packed(short(generator(DEVELOPMENT_SECRET, "real-life-small-bed", 1, "public"), "bed", True).scene,
                         drawn_number(DEVELOPMENT_SECRET, "real-life-small-bed", 1, "packing"))  # fmt: skip
        true = np.array([b.radius for b in packing.bodies if b.mobile])
        believed = np.array([b.radius for b in recording.scene.bodies if b.mobile])
        off = np.array(list(truth["radius"].values()))
        assert believed * off == pytest.approx(true, rel=1e-5) and 0.008 < np.std(off) < 0.032
        assert len(recording.t) == 70 and recording.xy.shape[1] == len(true)

    def test_effects_of_a_bed_come_in_twos_of_which_one_is_small(self, monkeypatch) -> None:
        asked = []

        def reached(sensitivity, plan, target, rough=False):
            asked.append(target)
            return 1.0, target

        monkeypatch.setattr(real_beds, "strong", reached)
        setup = draw_bed(np.random.default_rng(0), "bed", True)
        rng = np.random.default_rng(1)
        drawn = [real_beds.draw_effects(setup, None, rng, None) for _ in range(60)]
        assert {len(d) for d in drawn} == {1, 2} and min(asked) > 0.8
        assert all(9 <= target <= 39 for target in asked if target > 8) and any(target < 8 for target in asked)
        assert all(d[0][0].name != d[1][0].name for d in drawn if len(d) == 2)


TRUTH = {
    "kind": "real-life", "seed": 1, "setup": "table", "category": "mechanism", "sigma": 30.0, "second_sigma": 4.0,
    "effects": [{"name": "linear_drag", "values": {"c": 0.01, "p": 0}, "bodies": None, "other": {}},
                {"name": "uniform_force", "values": {"a": [0.02, 0.0]}, "bodies": None, "other": {}}],
    "believed": [{"name": "linear_drag", "values": {"c": 0.011, "p": 0}, "bodies": None, "other": {}}, None],
    "rivals": {"quadratic_drag": 1.0, "coulomb_substrate": 9.0}, "second_rivals": {}, "mass": {}, "radius": {},
    "scale": 0.005, "tilt": None, "gravity": False, "pin_length": None, "bodies": ["a"],
    "left": {"": 30.0, "first": 6.0, "first+second": 1.0, "first+scale": 5.0, "first+scale+second": 0.0},
}  # fmt: skip


def answer(*names: str, verdict: str = "missing_physics", alike: str = "", complete: bool | None = None) -> dict:
    found = {"c": {"value": 0.011, "low": 0.0105, "high": 0.0115}}
    mechanisms = [{"name": n, "bodies": ["a"], "parameters": found} for n in names]
    rivals = [{"name": alike, "gain_heldout": None, "indistinguishable": True}] if alike else []
    said = {"verdict": verdict, "mechanisms": mechanisms, "rivals": rivals, "explained": {"share": 0.9}}
    return said if complete is None else said | {"complete": complete}


def scored(verdict: dict | None, **changes: object):
    truth = TRUTH | changes
    return score_real({"case": "real-life-1", "truth": truth, "verdict": verdict, "seconds": 5.0, "failed": ""})


class TestScore:
    def test_the_largest_effect_is_asked_for(self) -> None:
        row = scored(answer("linear_drag", complete=False))
        assert row.right_name and row.right_class and not row.strange and row.left == 6.0 and row.seen
        assert row.covered == (True,) and not row.alone and not row.wrong_complete
        row = scored(answer("linear_drag", "uniform_force", complete=True))
        assert row.right_name and row.alone and row.left == 1.0 and not row.seen
        row = scored(answer("linear_drag", "uniform_force", "camera_scale", complete=True))
        assert row.left == 0.0 and not row.strange and row.entries == 3

    def test_equivalent_names_are_of_the_class(self) -> None:
        row = scored(answer("quadratic_drag", complete=True))
        assert not row.right_name and row.right_class and not row.strange and not row.wrong_complete
        row = scored(answer("ambient_flow", alike="linear_drag"))
        assert row.right_class and not row.strange

    def test_wrong_names(self) -> None:
        row = scored(answer("coulomb_substrate", complete=True))
        assert not row.right_class and row.strange == ("coulomb_substrate",) and row.wrong_complete
        row = scored(answer("linear_drag", "added_mass"))
        assert row.right_name and row.strange == ("added_mass",) and row.complete is None
        assert not scored(answer("linear_drag", "added_mass"), mass={"a": 1.01}).strange
        row = scored(answer("unknown", verdict="unmodelled", complete=False))
        assert not row.right_class and not row.entries and not row.strange
        assert not scored(None).right_class

    def test_nulls_may_name_nuisances(self) -> None:
        null = {"effects": [], "believed": [], "category": "null", "sigma": 0.0, "left": {"": 5.0, "scale": 0.0}}
        assert scored(answer(verdict="no_mismatch", complete=True), **null).right_name
        row = scored(answer("camera_scale", verdict="measurement", complete=True), **null)
        assert row.right_name and row.left == 0.0 and not row.wrong_complete
        row = scored(answer("linear_drag", complete=True), **null)
        assert not row.right_name and row.strange == ("linear_drag",) and row.wrong_complete
        assert scored(answer("uniform_force"), **null, tilt=[0.0, 0.005]).right_name

    def test_in_a_pin_a_drag_is_one_of_the_joint(self) -> None:
        verdict = answer("joint_drag")
        verdict["mechanisms"][0]["parameters"]["c"] = {"value": 4.4e-4, "low": 4.3e-4, "high": 4.5e-4}
        row = scored(verdict, setup="pendulum", pin_length=0.2)
        assert row.right_name and not row.strange and row.covered == (True,)

    def test_a_strength_is_that_of_the_mean_radius_of_those_it_acts_on(self) -> None:
        """c of a body of r_0 = 2 cm is c/2 on that of 1 cm alone, if the drag goes with the radius."""
        effects = [TRUTH["effects"][0] | {"values": {"c": 0.022, "p": 1}}]
        truth = {"effects": effects, "believed": effects, "radii": {"a": 0.01, "b": 0.03}}
        assert scored(answer("linear_drag"), **truth).covered == (True,)
        assert scored(answer("linear_drag"), **truth | {"radii": {"a": 0.02}}).covered == (False,)

    def test_numbers_of_an_ideal_analyst_are_counted_beside(self) -> None:
        one = [TRUTH["believed"][0]]
        ideal = [one[0] | {"values": {"c": 0.02, "p": 0}}]
        row = scored(answer("linear_drag"), effects=TRUTH["effects"][:1], believed=one, ideal=ideal)
        assert row.covered == (True,) and row.ideal == (False,) and scored(answer("linear_drag")).ideal is None

    def test_figures_count_what_they_speak_of(self) -> None:
        rows = [scored(answer("linear_drag", complete=False)), scored(answer("coulomb_substrate", complete=True)),
                scored(answer("linear_drag"))]  # fmt: skip
        figures = {f.what: f for f in real_figures(rows)}
        assert (figures["largest effect: right name or class"].hits, len(rows)) == (2, 3)
        assert (f := figures["a wrong name said to be complete, of all cases"]).hits == 1 and f.n == 2
        assert (f := figures["names neither drawn nor equivalent, of all entries"]).hits == 1 and f.n == 3
        assert (f := figures["an ideal test sees what is left: said to be incomplete"]).hits == 1 and f.n == 2
        lines = table_text(rows).splitlines()
        assert len(lines) == 4 and lines[0].startswith("case,setup") and "linear_drag+uniform_force" in lines[1]


    def test_tables_are_read_as_they_were_written_and_summed(self, tmp_path: Path, capsys) -> None:
        rows = [scored(answer("linear_drag", complete=False)), scored(answer("coulomb_substrate", complete=True))]
        rows[1] = replace(rows[1], case="real-life-2")
        tables = [tmp_path / "a.csv", tmp_path / "b.csv"]
        for table, row in zip(tables, rows, strict=True):
            table.write_text(table_text([row]))
        read = [row for table in tables for row in read_real_rows(table)]
        assert read == rows
        assert [f.hits for f in real_figures(read)] == [f.hits for f in real_figures(rows)]
        assert real_figures_command(list(map(str, tables))) == 0
        out = capsys.readouterr().out
        assert "| table | 2 | 1 | 1 | 0 | 0 | 5 |" in out
        assert "- real-life-2 (table): linear_drag + uniform_force of 30 beside scale: coulomb_substrate, comp" in out
        assert real_figures_command([str(tables[0])] * 2) == 2 and "twice" in capsys.readouterr().err
        clean = Path(__file__).parents[1] / "docs" / "proof" / "series-37.csv"
        assert real_figures_command([str(clean), "--kind", "bodies"]) == 0
        assert "right names said to be complete: 96 % (26 of 27)" in capsys.readouterr().out
        assert real_figures_command([str(clean), "--kind", "beds"]) == 2 and "small-unseen" in capsys.readouterr().err
        assert real_figures_command([str(clean), str(tables[0])]) == 2 and "one kind" in capsys.readouterr().err
        tables[0].write_text("case,setup\nreal-life-1,table\n")
        assert real_figures_command([str(tables[0])]) == 2


    def test_a_table_made_before_gets_both_tests(self, tmp_path: Path, monkeypatch, capsys) -> None:
        """Only what was seen to be left is drawn again: what is fitted takes away and never adds."""
        rows = [replace(scored(answer("coulomb_substrate", complete=True)), case=f"real-life-{k}", left=left)
                for k, left in ((1, 12.0), (2, 1.0))]  # fmt: skip
        truth: dict = {**TRUTH}
        for key, left in (("left", 2.0), ("left_held", 12.0)):
            truth[key] = dict.fromkeys(("", "first", "scale", "first+scale"), left)
        drawn = []

        def case(seed: int, secret: bytes) -> Case:
            drawn.append(seed)
            return Case((), truth)

        monkeypatch.setattr(real_left, "real_bodies_case", case)
        table, out = tmp_path / "old.csv", tmp_path / "new.csv"
        table.write_text(table_text(rows))
        asked = ["--series", "52", "--commit", "fb473dd" + "0" * 33, "--out"]
        assert real_left.main([str(table), *asked, str(out)]) == 0
        assert drawn == [1] and [(r.left, r.left_held) for r in read_real_rows(out)] == [(2.0, 12.0), (1.0, None)]
        figures = {f.what: f for f in real_figures(read_real_rows(out))}
        assert figures["an ideal test sees what is left: said to be incomplete"].n == 0
        held = figures["the same where the test takes masses and radii as they are believed"]
        assert (held.hits, held.n) == (0, 1)
        capsys.readouterr()
        assert real_left.main([str(tmp_path / "none.csv"), *asked, str(out)]) == 2
        assert "none.csv" in capsys.readouterr().err
        assert real_left.main([str(table), *asked, str(table / "new.csv")]) == 2 and drawn == [1]


class TestSeries:
    def test_the_secret_is_the_hash_of_number_and_commit(self) -> None:
        commit = "fb473dd" + "0" * 33
        assert series_secret(20, commit) == hashlib.sha256(f"series 20 {commit}".encode()).hexdigest().encode()
        for number, digits in ((20, "fb473dd"), (0, commit)):
            with pytest.raises(InputError):
                series_secret(number, digits)

    def test_a_series_is_listed_and_scored_from_its_commit(self, tmp_path: Path) -> None:
        def git(*words: str) -> None:
            subprocess.run(["git", "-C", str(tmp_path), "-c", "user.name=n", "-c", "user.email=e", *words], check=True,
                           capture_output=True)  # fmt: skip

        with pytest.raises(InputError, match="from a checkout"):
            checked_out(20, tmp_path)
        git("init")
        (tmp_path / "docs").mkdir()
        (tmp_path / "docs" / "proof_history.md").write_text("| 19 | 1 to 2 | whole |\n| 20 | 3 to 4 | begun |\n")
        git("add", "-A")
        git("commit", "-m", "list")
        assert len(checked_out(20, tmp_path)) == 40
        with pytest.raises(InputError, match="list it before it begins"):
            checked_out(21, tmp_path)
        (tmp_path / "docs" / "proof_history.md").write_text("changed")
        with pytest.raises(InputError, match="differs from its commit"):
            checked_out(20, tmp_path)

    def test_slices_are_parts_of_every_kind(self) -> None:
        cases = full_cases(real_life=True)
        parts = [sliced(cases, k, 7) for k in range(1, 8)]
        assert sorted(c for p in parts for c in p) == sorted(cases) and len({c for p in parts for c in p}) == len(cases)
        assert {kind for kind, _ in parts[0]} == {kind for kind, _ in cases}
        with pytest.raises(InputError):
            sliced(cases, 8, 7)

    def test_a_slice_is_scored_and_gone_on_with(self, tmp_path: Path, monkeypatch, capsys) -> None:
        def diagnosed(recordings, keep, minutes=None):
            return {"verdict": answer("linear_drag", complete=False), "seconds": 1.0, "failed": ""}

        monkeypatch.setattr(prove, "diagnose_alone", diagnosed)
        commit = "a" * 40
        given = ["prove", "--real-life", "--seeds", "1001,1003", "--series", "20", "--commit", commit, "--workers", "1",
                 "--out", str(tmp_path)]  # fmt: skip
        drawn: list[int] = []
        real = prove.conceal

        def counted(seed, *args, **kwargs):
            drawn.append(seed)
            return real(seed, *args, effect="null", **kwargs)

        monkeypatch.setattr(prove, "conceal", counted)
        assert main([*given, "--slice", "1/2"]) == 0
        assert "slice-1-of-2.csv" in capsys.readouterr().out and drawn == [1001]
        assert main([*given, "--slice", "2/2"]) == 0 and drawn == [1001, 1003]
        table = (tmp_path / "slice-2-of-2.csv").read_text().splitlines()
        assert len(table) == 2 and table[1].startswith("real-life-1003,")
        assert len((tmp_path / "real-life.csv").read_text().splitlines()) == 3
        assert json.loads((tmp_path / "series.json").read_text()) == {"series": 20, "commit": commit}
        capsys.readouterr()
        given[given.index(commit)] = "b" * 40
        assert main([*given, "--slice", "1/2"]) == 2
        assert "holds series 20" in capsys.readouterr().err
        given = ["prove", "--real-life", "--seeds", "1001", "--out", str(tmp_path), "--series", "20"]
        for bad in (["--slice", "3/2"], ["--slice", "x"], ["--secret", "s"]):
            assert main([*given, *bad]) == 2


def test_a_cart_keeps_its_rail() -> None:
    """Masses that are off change a cart's swing by the root of the mass, which a free stiffness takes over."""
    setup = next(s for k in range(50) if (s := cart(np.random.default_rng(k))).scene.adjustable
                 and s.scene.adjustable[0].law == "spring")  # fmt: skip
    name = setup.mobile[0]
    truth = Truth(setup, first=Effect("linear_drag", {"c": 0.05, "p": 0}), mass={name: 1.02})
    believed = response(truth).believed()["first"].values["c"]
    assert believed == pytest.approx(0.05 / 1.02, rel=2e-2)
