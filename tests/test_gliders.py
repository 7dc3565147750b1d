"""Films as school laboratories make them: gliders on a track, places without a clock, arms that whip between frames."""

import math
from dataclasses import replace

import numpy as np
import pytest

from granswim_pymunk.errors import InputError
from granswim_pymunk.inference import diagnose
from granswim_pymunk.inference.candidates import named_terms, with_numbers
from granswim_pymunk.inference.criteria import DEFAULT
from granswim_pymunk.inference.data import prepare
from granswim_pymunk.inference.hypothesis import Hypothesis, Predictor, adjustable_terms
from granswim_pymunk.inference.tracks import model
from granswim_pymunk.inference.tracks.fit import Fitter
from granswim_pymunk.inference.tracks.kicks import all_kicks, not_of, shown_later, unexplained
from granswim_pymunk.inference.tracks.name import Trial
from granswim_pymunk.inference.tracks.signatures import make_bank
from granswim_pymunk.inference.tracks.study import FittedAlone, calibrated, study_of, without_sightings
from granswim_pymunk.inference.tracks.study import _all_again as fitted_again
from granswim_pymunk.recording import Recording, film
from granswim_pymunk.recording.importers import import_all
from granswim_pymunk.scene import Adjustable, Body, Scene, use


def gliders(name: str, m: tuple[float, float], at: tuple[float, float], v: tuple[float, float]) -> Recording:
    """Two gliders that magnets drive apart, read to a millimetre off the scale of a track; y is not read at all."""
    t, n = np.arange(70) / 30, 200
    x, w, seen = np.array(at), np.array(v), []
    for _ in t:
        seen.append(x.copy())
        for _ in range(n):
            f = 2.4e-6 / (x[1] - x[0]) ** 4
            w = w + (np.array([-f, f]) - 0.02 * w) / np.array(m) / (30 * n)
            x = x + w / (30 * n)
    xy = np.full((len(t), 2, 2), np.nan)
    xy[:, :, 0] = np.round(np.array(seen), 3)
    bodies = tuple(Body(b, "free", 0.01, mass) for b, mass in zip("ab", m, strict=True))
    laws = (use("rail", bodies=["a", "b"], direction=(1.0, 0.0)), use("contact_elastic", restitution=1.0))
    return Recording(name, Scene(bodies, laws), t, ("a", "b"), xy, sampling=30.0, position_noise=5e-4)


def test_a_stream_has_no_component_that_a_rail_takes_away():
    """Of a stream across it the difference of two runs is rounding, which looks like no other column."""
    one = gliders("one", (0.18, 0.32), (0.3, 0.75), (0.0, -0.4))
    films = [one, gliders("two", (0.4, 0.17), (0.1, 0.6), (0.25, -0.2))]
    study = study_of(films, [], np.random.default_rng(0), lambda *a: None, lambda share: False)
    naive, recalibrated = calibrated(study)
    terms = named_terms(study.cases)
    bank = make_bank(study.fitter, recalibrated, terms)
    flows = [s for s in bank.signatures if s.term.mechanism == "ambient_flow" and s.directions.shape[1]]
    assert flows and not any("u_y" in free.name for s in flows for free in s.term.free)

    # fitted again without a sighting, a law whose numbers no signature of the new bank has gets its own
    push = next(s for s in bank.signatures if s.term.mechanism == "linear_drag" and len(s.term.free) > 1)
    less = type(push)(with_numbers(push.term, [0]), push.directions[:, :1], push.surviving, push.gain)
    fit = study.fitter.fit(naive.hypothesis.with_term(less.term), None, naive.starts)
    alive = [Trial(less, fit, recalibrated.chi2 - fit.chi2, 1.0)]
    tried = FittedAlone(naive, recalibrated, terms, bank, alive, [], [], fit, 1.0, {"recalibrated": 1.0})
    lost = np.zeros(study.cases[0].values.shape, dtype=bool)
    lost[5, 0] = True
    fewer = without_sightings(study, {"one": lost})
    again = fitted_again(fewer, tried)
    assert len(again.alive) == 1
    assert again.alive[0].signature.directions.shape[0] == len(again.bank.left) == len(bank.left) - 1


@pytest.mark.deep
def test_laws_of_which_a_number_was_not_found_are_looked_for_no_more(monkeypatch):
    """A ball falls with 7.6 m/s^2: where the law that was found ended at a bound, the next one is asked."""
    t = np.arange(40) / 60
    xy = np.stack([1.0 * t, 4.0 * t - 0.5 * 7.57 * t**2], axis=1)[:, None]
    xy = xy + np.random.default_rng(2).normal(0.0, 1e-3, xy.shape)
    scene = Scene((Body("ball", "free", 0.12, 0.62),), (use("gravity"),), gravity=(0.0, -9.81))
    film, left = Recording("ball", scene, t, ("ball",), xy, sampling=60.0), []

    def found(fitter, base, laws, revised, spread):
        if not left:
            left.append(laws[0].mechanism)
            return [], base, {laws[0].mechanism: "its number ends where its search ends"}
        return laws, revised, {}

    monkeypatch.setattr(model, "with_numbers_that_were_found", found)
    verdict = diagnose([film]).verdict
    assert verdict["mechanisms"] and left[0] not in {m["name"] for m in verdict["mechanisms"]}
    assert any(note.startswith(f"{left[0]}: not named") for note in verdict["notes"])


def test_a_table_of_places_alone_is_read_with_a_frame_rate(tmp_path):
    (tmp_path / "a.csv").write_text("x,y\n1,5\n2,6\n3,7\n4,8\n5,9\n")
    how = {"bodies": ["*:12cm:0.62"], "scene": "drop", "picture": False}
    with pytest.raises(InputError, match="--fps"):
        import_all(tmp_path / "a.csv", tmp_path / "no", **how)
    (done,) = import_all(tmp_path / "a.csv", tmp_path / "out", fps=50.0, unit="1mm/px", **how)
    np.testing.assert_allclose(done.recording.t, np.arange(5) / 50)
    np.testing.assert_allclose(done.recording.xy[:, 0, 0], [0.001, 0.002, 0.003, 0.004, 0.005])
    # with a body named in each row, each row of a body is its next frame
    (tmp_path / "b.csv").write_text("body,x,y\na,1,5\na,2,6\na,3,7\na,4,8\nb,1,1\nb,2,1\nb,3,1\nb,4,1\n")
    (done,) = import_all(tmp_path / "b.csv", tmp_path / "b", fps=50.0, **how)
    assert done.recording.xy.shape == (4, 2, 2) and np.isfinite(done.recording.xy).all()


@pytest.mark.parametrize(
    ("stamps", "row"), [("0 1 2 30 4 5", "row 5"), ("0 1 2 0.3 4 5", "row 5"), ("0 1 2 3 4 5", "")]
)
def test_a_stamp_out_of_order_is_told_with_its_row(tmp_path, stamps, row):
    rows = "\n".join(f"{t},{k},{2 * k}" for k, t in enumerate(stamps.split()))
    (tmp_path / "a.csv").write_text("t,x,y\n" + rows + "\n")
    (done,) = import_all(tmp_path / "a.csv", tmp_path / "out", bodies=["*:5mm:10g"], scene="drop", picture=False)
    told = [note for note in done.notes if "is it a slip?" in note]
    assert [note.startswith(row) for note in told] == ([True] if row else [])


def test_a_column_that_goes_back_again_and_again_is_hardly_the_time(tmp_path):
    """Headings in another order than the columns: x was read as the time, and its rows sorted without a word."""
    rows = "\n".join(f"{t},{k},{2 * k}" for k, t in enumerate([0, 1, 2, 3, 2.5, 1.5, 0.5]))
    (tmp_path / "a.csv").write_text("t,x,y\n" + rows + "\n")
    (done,) = import_all(tmp_path / "a.csv", tmp_path / "out", bodies=["*:5mm:10g"], scene="drop", picture=False)
    (told,) = [note for note in done.notes if "is another column the time" in note]
    assert told.startswith("body ") and "goes back in 3 of its 7 rows" in told


def test_bodies_may_be_called_as_their_headings_are(tmp_path):
    """ "x1 is hardly seen" was said of a column x1 that was there in every row: its body is called 1."""
    rows = "\n".join(f"{k / 10},{k / 100},{1 - k / 100}" for k in range(12))
    (tmp_path / "a.csv").write_text("t,x1,x2\n" + rows + "\n")
    (done,) = import_all(
        tmp_path / "a.csv", tmp_path / "out", bodies=["x1:1cm:179.3g", "x2:1.1cm:319.7g"], scene="cart", picture=False
    )
    assert done.recording.ids == ("x1", "x2") and [b.mass for b in done.recording.scene.bodies] == [0.1793, 0.3197]
    assert "'1' is taken for x1" in done.notes


@pytest.mark.parametrize("rate", [25.0, 60.0, 100.0])
def test_arms_that_whip_between_frames_are_struck_by_nothing(rate):
    """The lower one of two arms of 20 cm turns by a radian in 30 ms: a film that is slower shows steps of its speed."""
    arm, q, p = 0.0985, 1.4, -0.4
    first = np.array([arm * math.sin(q), -arm * math.cos(q)])
    at = (first, 2 * first + [arm * math.sin(p), -arm * math.cos(p)])
    bodies = tuple(
        Body(b, "free", 0.02, 0.095, initial=(*xy, 0.0, 0.0), inertia=3.07e-4) for b, xy in zip("ab", at, strict=True)
    )
    hinges = (
        use("hinge", bodies=["a"], anchor_a=(0.0, 0.0985), anchor=(0.0, 0.0)),
        use("hinge", bodies=["a", "b"], anchor_a=(0.0, -0.0985), anchor_b=(0.0, 0.0985)),
    )
    scene = Scene(bodies, (use("gravity"), *hinges), gravity=(0.0, -9.81))
    seen = film(scene, np.arange(0.0, 5.6, 1.0 / rate), rng=np.random.default_rng(3), noise=5e-4)
    case = prepare(replace(seen, position_noise=5e-4), held_out=False, split=True)
    assert not unexplained(case)


def on_springs(*adjustable: Adjustable, stiffness: tuple[float, float] = (8.0, 12.0)):
    """Two carts on springs of their own, as a case."""
    bodies = tuple(Body(b, "free", 0.02, 0.2, initial=(x, 0.0, 0.0, 0.0)) for b, x in (("a", 0.36), ("b", 0.95)))
    a, b = stiffness
    laws = (
        use("rail", bodies=["a", "b"], direction=(1.0, 0.0)),
        use("spring", bodies=["a"], anchor=(0.0, 0.0), stiffness=a, length=0.3),
        use("spring", bodies=["b"], anchor=(0.8, 0.0), stiffness=b, length=0.1),
    )
    scene = Scene(bodies, laws, adjustable=adjustable)
    seen = film(scene, np.arange(0.0, 2.0, 1 / 60), rng=np.random.default_rng(0), noise=5e-4)
    return prepare(seen, held_out=False, split=True)


def test_a_spring_that_hardens_is_asked_for_where_the_scene_has_several():
    """Each law takes the anchor and the length of the spring that it hardens."""
    labels = {t.label for t in named_terms([on_springs()])}
    assert {"nonlinear_spring", "nonlinear_spring (each body)"} <= labels


def test_an_adjustable_number_is_shared_by_those_of_which_the_same_is_believed():
    number = Adjustable("spring", "stiffness", 4.0, 20.0)
    apart = adjustable_terms([on_springs(number)])
    assert [(t.label, t.bodies, t.free[0].first) for t in apart] == [
        ("spring.stiffness[a]", ("a",), 8.0), ("spring.stiffness[b]", ("b",), 12.0)
    ]  # fmt: skip
    (together,) = adjustable_terms([on_springs(number, stiffness=(8.0, 8.0))])
    assert together.label == "spring.stiffness" and together.bodies is None
    # what is believed beyond the bounds is not meant
    (one,) = adjustable_terms([on_springs(number, stiffness=(8.0, 50.0))])
    assert one.label == "spring.stiffness[a]"
    each = adjustable_terms([on_springs(replace(number, per="body"))])
    assert [t.free[0].first for t in each] == [8.0, 12.0]


def with_a_force_and_a_drag():
    """A film of gliders, its fitter, the scene without a law fitted, and a hypothesis of the two laws that act."""
    case = prepare(gliders("one", (0.18, 0.32), (0.3, 0.75), (0.0, -0.4)), held_out=False, split=False)
    fitter = Fitter([case], Predictor({case.name: 1e-3}))
    laws = {t.label: t for t in named_terms([case])}
    return case, fitter, fitter.fit(Hypothesis(), None), Hypothesis((laws["distance_force"], laws["linear_drag"]))


def test_a_strength_and_a_power_end_where_they_are_from_wherever_they_begin():
    """Along the valley of s (r_0/d)^n differences to one side promise nothing, far from its lowest point."""
    _, fitter, base, both = with_a_force_and_a_drag()
    ends = [fitter.fit(both, begin, base.starts, evaluations=60) for begin in ([10, 3, 0.02], [1000, 5, 0.02])]
    assert ends[0].chi2 == pytest.approx(ends[1].chi2, abs=1e-3)
    np.testing.assert_allclose(ends[0].values, ends[1].values, rtol=1e-4)
    assert ends[0].values[1] == pytest.approx(4.0, abs=0.05)


def test_a_run_that_flies_off_to_no_number_spoils_none_that_comes_after():
    """Simulations are begun again with other starts and numbers; one whose places are no numbers is not."""
    case, fitter, base, both = with_a_force_and_a_drag()

    def seen(*values: float) -> np.ndarray:
        return fitter.vector(case, both, np.array(values), base.starts[case.name])

    before, lost = seen(200.0, 4.0, 0.02), seen(1e90, 4.0, 0.02)
    assert fitter.predictor.failures and np.abs(lost).max() >= DEFAULT.fits.hopeless
    np.testing.assert_allclose(seen(200.0 + 1e-9, 4.0, 0.02), before, atol=1e-6)


def test_what_the_held_out_part_alone_shows_is_told_with_its_time():
    """One glider drives another on without touching it: neither a hand nor physics that nothing tells of."""
    t = np.arange(70) / 30
    # the first comes with 40 cm/s to 10 cm from the second at 1.9 s and stays there
    x = np.stack([0.3 - 0.4 * np.maximum(t - 1.9, 0.0), 0.4 + 0.4 * np.maximum(1.9 - t, 0.0)], axis=1)
    xy = np.stack([x + 5e-4 * np.random.default_rng(3).normal(size=x.shape), np.full(x.shape, np.nan)], axis=2)
    scene = gliders("", (0.2, 0.2), (0.3, 1.2), (0.0, 0.0)).scene
    film = Recording("late", scene, t, ("a", "b"), xy, sampling=30.0, position_noise=5e-4)
    case = prepare(film, held_out=False, split=True)
    kicks = all_kicks(case)
    assert {kick.body for kick in kicks} == {"a", "b"} and not any(case.training[kick.row] for kick in kicks)
    told = shown_later(case)
    assert told.startswith("the velocity of a and b changes by up to 0.4")
    assert not shown_later(replace(case, scored=case.scored & False))
    # a law that acts between both is what they show; one that acts on one of them is not
    frames = 2 * DEFAULT.kicks.half
    assert not_of(kicks, ["a", "b"], frames) == [] and not_of(kicks, ["a"], frames) == kicks
