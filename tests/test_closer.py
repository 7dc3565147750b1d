"""How closely segments are joined once a law was found, and what impacts then show beside it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from granswim_pymunk.engine import Simulation
from granswim_pymunk.inference import diagnose
from granswim_pymunk.inference.candidates import named_terms
from granswim_pymunk.inference.data import prepare
from granswim_pymunk.inference.hypothesis import Hypothesis, Predictor
from granswim_pymunk.inference.judge import Claim
from granswim_pymunk.inference.tracks import model as tracks
from granswim_pymunk.inference.tracks.believed import believed_terms
from granswim_pymunk.inference.tracks.closer import shows_one_more
from granswim_pymunk.inference.tracks.fit import Fitter, joined
from granswim_pymunk.inference.tracks.model import Tracks
from granswim_pymunk.recording import Recording
from granswim_pymunk.scene import Body, Scene, Wall, use

NOISE, DRAG = 4e-4, 3.5e-4


def bouncing(restitution: float) -> Recording:
    """A table tennis ball on a floor, filmed for 3 s at 240 Hz; a restitution of 0.9 is believed."""
    ball, floor = Body("ball", "free", 0.02, 0.0027, initial=(0.0, 0.8, 0.35, 0.0)), Wall((-1.0, 0.0), (3.0, 0.0))
    drag = use("quadratic_drag", c=DRAG)
    true = Scene((ball,), (use("contact_elastic", restitution=restitution), drag), (0.0, -9.81), walls=(floor,))
    t, rng = np.arange(0.0, 3.0, 1 / 240), np.random.default_rng(116)
    xy = Simulation(true, dt=1e-4).sample(t)
    belief = replace(true, bodies=(replace(ball, initial=None),), laws=(use("contact_elastic", restitution=0.9),))
    return Recording("r", belief, t, ("ball",), xy + NOISE * rng.normal(size=xy.shape), position_noise=NOISE)


@pytest.mark.parametrize("restitution, shows", [(0.86, True), (0.9, False)])
def test_beside_a_drag_close_joints_show_what_an_impact_lacks(restitution, shows):
    """Four per cent of a restitution hide in a per cent of each kick; without the drag no close joints follow."""
    case = prepare(bouncing(restitution), held_out=False, split=True)
    fitter, terms = Fitter([case], Predictor({"r": 1e-3})), named_terms([case])
    term = next(t for t in terms if t.label == "quadratic_drag")
    with_drag = Hypothesis(believed_terms([case])).with_term(term)
    loose = fitter.fit(with_drag, [0.0, DRAG], fitter.from_flights(with_drag, [0.0, DRAG]))
    assert loose.chi2 < loose.count + 3 * np.sqrt(2 * loose.count)
    # as closely as the scene with the drag alone follows
    fitter, fit = joined(fitter, loose)
    closer = shows_one_more(fitter, fit, terms) if fitter.segmented else None
    if not shows:
        assert closer is None
        return
    assert closer is not None and closer.closeness < fitter.closeness == 1.0
    # without a law that does, none is told
    others = [t for t in terms if t.mechanism != "restitution"]
    assert shows_one_more(fitter, fit, others) is None


@pytest.mark.deep
def test_a_drag_does_not_hide_a_restitution():
    """The drag alone was named, nothing was told of the impacts, and unseen frames were off by 46 times the noise."""
    verdict = diagnose([bouncing(0.86)]).verdict
    found = {m["name"]: m["parameters"] for m in verdict["mechanisms"]}
    assert set(found) == {"quadratic_drag", "restitution"} and verdict["complete"]
    assert found["restitution"]["restitution"]["value"] == pytest.approx(0.86, abs=0.003)
    assert found["quadratic_drag"]["c"]["value"] == pytest.approx(DRAG, rel=0.03)
    assert verdict["heldout"] == "holds"


@pytest.mark.parametrize(
    "found, passed, passes, stands",
    [
        (2, False, False, True), (2, True, False, True), (1, False, True, True), (1, True, True, False),
        (1, False, False, False), (0, False, True, False),
    ],
)  # fmt: skip
def test_what_closer_joints_show_stands_where_it_is_more(monkeypatch, found, passed, passes, stands):
    """With more laws, or where noise alone is left that was not; a search that is led astray leaves all as it was.

    A square drag of four pucks that left noise alone became a linear drag of each, which leaves as much.
    """
    before, after = ("study", "tried"), ("closer study", "closer")
    model, asked = Tracks.__new__(Tracks), []
    model.study, model.tried, model.fitter = *before, None

    def search_again(study, tried):
        asked.append((study, tried))
        return Claim(("law",) * (found if study == after[0] else 1), study)

    monkeypatch.setattr(tracks, "with_closer_joints", lambda *a: after)
    monkeypatch.setattr(model, "_search_again", search_again, raising=False)
    monkeypatch.setattr(model, "completeness", lambda fit: SimpleNamespace(passes=passed if fit == "loose" else passes),
                        raising=False)
    first = Claim(("law",), "loose")
    claim = model._joined_more_closely(first)
    assert asked == ([after] if stands else [after, before]) and claim.fit == asked[-1][0]
    monkeypatch.setattr(tracks, "with_closer_joints", lambda *a: before)
    assert model._joined_more_closely(first) is first
