"""Physics that acts in the held-out part alone: what was named of the rest is not called complete."""

from types import SimpleNamespace

import numpy as np
import pytest

import granswim_pymunk as gs
from granswim_pymunk.inference.judge import HELD_OUT_OFF, Claim, Judgement, Remains, as_large_by_chance
from granswim_pymunk.inference.tracks import held_out
from granswim_pymunk.inference.tracks.believed import FARTHER_OFF
from granswim_pymunk.inference.tracks.model import MORE_TO_SEE, Tracks
from granswim_pymunk.report.sentences import headline


def test_an_error_is_held_against_repeats_of_the_right_law():
    rng = np.random.default_rng(1)
    repeats = 1e-3 * np.exp(0.2 * rng.normal(size=10))
    assert as_large_by_chance(1e-3, repeats) > 0.2
    assert as_large_by_chance(2.5e-3, repeats) < 0.005
    # too few to tell, or none
    assert as_large_by_chance(1.0, repeats[:3]) == 1.0
    assert as_large_by_chance(1.0, np.zeros(0)) == 1.0
    # by chance one in twenty is beyond its 5 %
    drawn = np.exp(0.2 * rng.normal(size=(2000, 11)))
    below = np.mean([as_large_by_chance(row[0], row[1:]) < 0.05 for row in drawn])
    assert below == pytest.approx(0.05, abs=0.02)


def _glide(late: float) -> tuple[np.ndarray, np.ndarray]:
    """A puck of 20 g with a drag of 0.01 kg/s; from t = 1.5 s on a wind pushes it across [m/s^2]."""
    t = np.arange(0, 2.0, 0.02)
    k, v = 0.01 / 0.02, 0.5
    x = v / k * (1 - np.exp(-k * t))
    after = np.maximum(t - 1.5, 0.0)
    y = late * (after - (1 - np.exp(-k * after)) / k) / k
    noise = np.random.default_rng(7).normal(size=(len(t), 1, 2))
    return t, np.stack([x, y], axis=-1)[:, None, :] + 3e-4 * noise


@pytest.mark.deep
@pytest.mark.parametrize("late", [0.0, 0.3])
def test_complete_is_not_said_where_only_held_out_data_show_more(late):
    t, xy = _glide(late)
    verdict = gs.diagnose(t, xy, radius=0.01, mass=0.02).to_dict()
    assert [m["name"] for m in verdict["mechanisms"]] == ["linear_drag"]
    assert verdict["complete"] == (late == 0.0)
    if late:
        left = verdict["remains"]
        assert left["times_floor"] > 5 and left["when"]["t"][0] >= 1.5
        assert left["looks_like"] == "physics that the training part does not show"


@pytest.mark.deep
@pytest.mark.parametrize("late", [0.0, 0.3])
def test_the_first_screen_says_what_only_held_out_data_show(late):
    """Nothing is missing in what was learnt from: no law is claimed, and nobody is told that all is well."""
    t = np.arange(0, 2.0, 0.02)
    after = np.maximum(t - 1.5, 0.0)
    xy = np.stack([0.5 * t, late * after**2 / 2], axis=-1)[:, None, :]
    found = gs.diagnose(t, xy + 3e-4 * np.random.default_rng(7).normal(size=xy.shape), radius=0.01, mass=0.02)
    verdict = found.to_dict()
    assert verdict["verdict"] == "no_mismatch" and not verdict["mechanisms"] and verdict["remains"] is None
    assert verdict["complete"] == (late == 0.0)
    assert found.found is not None
    assert ("held-out data are off" in headline(found.found)) == (late > 0)
    assert any("--hold-out" in note for note in verdict["notes"]) == (late > 0)


def test_complete_is_what_the_page_says_beside_it():
    """Farther off than every repeat with the right law: not complete, whatever their spread."""

    def beyond(rms: float | None, repeats: int) -> bool:
        errors = np.linspace(1.0, 2.0, repeats) if repeats else np.zeros(0)
        tracks = SimpleNamespace(held={"revised": SimpleNamespace(rms=rms)}, right=errors, _matters=lambda rms: True)
        return bool(Tracks._beyond_the_right_law(tracks))  # type: ignore[arg-type]

    assert beyond(2.1, 10) and not beyond(1.9, 10)
    assert not beyond(9.0, 3) and not beyond(9.0, 0) and not beyond(None, 10)


@pytest.mark.parametrize(
    ("size", "passes", "off", "beyond", "why"),
    [
        (1.0, False, "", False, ["noise alone is like it with p = 0.0004"]),
        (1.0, False, "", True, ["noise alone is like it with p = 0.0004", HELD_OUT_OFF]),
        (1.0, True, FARTHER_OFF, False, [FARTHER_OFF]),
        (1.0, True, "", False, [MORE_TO_SEE]),
        (9.0, False, "", True, []),  # its size says so
        (9.0, True, FARTHER_OFF, False, [FARTHER_OFF]),
    ],
)
def test_what_is_left_is_told_with_what_decided_that_it_is_no_noise(size, passes, off, beyond, why):
    left = SimpleNamespace(passes=passes, chance=4e-4)
    tracks = SimpleNamespace(_between_kicks=lambda fit: left, _beyond_the_right_law=lambda: beyond)
    judged = Judgement("missing_physics", Claim((SimpleNamespace(mechanism="linear_drag"),), None))
    remains = Remains(1e-3, size, ("a",), None, None, "nothing that was tried")
    more = passes and not off
    told = Tracks._with_why(tracks, remains, judged, off=off, more=more)  # type: ignore[arg-type]
    assert told.as_dict()["why"] == why


def test_held_out_data_show_no_other_physics_where_a_form_without_a_name_is_followed_on(monkeypatch):
    monkeypatch.setattr(held_out, "shown_later", lambda case: "")
    case = SimpleNamespace(name="one", t=np.arange(20) * 0.1, channels=[SimpleNamespace(body="a")])
    errors = held_out.Errors(1e-3, {}, scored={"one": np.where(np.arange(20) < 10, np.nan, 3.0)[:, None]})
    named, nameless = (held_out.left_of_held_out(errors, [case], 5e-4, form).looks_like for form in (False, True))
    assert named == "physics that the training part does not show" and nameless == "nothing that was tried"


def test_what_an_experimenter_does_not_care_about_is_not_missing():
    def matters(rms: float, tolerance: float | None) -> bool:
        recording = SimpleNamespace(tolerance=tolerance, angle_tolerance=None)
        study = SimpleNamespace(cases=[SimpleNamespace(recording=recording)])
        tracks = SimpleNamespace(unit="m rms", study=study, floor=(3e-4, 3e-4))
        return bool(Tracks._matters(tracks, rms))  # type: ignore[arg-type]

    assert matters(4e-3, None) and matters(4e-3, 3e-3)
    assert not matters(4e-3, 2e-2) and not matters(3e-4, 1e-9)
