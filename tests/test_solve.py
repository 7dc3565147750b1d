"""Least squares over segments that join closely."""

from types import SimpleNamespace

import numpy as np
import pytest

from granswim_pymunk.inference.hypothesis import Free, Hypothesis, Term
from granswim_pymunk.inference.tracks.fit import Straight, joined
from granswim_pymunk.inference.tracks.name import Trial, _to_its_end
from granswim_pymunk.inference.tracks.solve import Blocks, Problem, descend


def chained(tie: float, seen_only: bool) -> tuple[Problem, float]:
    """Ten segments of a straight line that a drift bends, each with a place and a speed of its own; the least chi2.

    tie : spread of the steps from the end of one segment to the start of the next
    """
    rng = np.random.default_rng(5)
    count, frames, dt = 10, 20, 0.05
    s = dt * np.arange(frames)
    rows, by_value, by_start = [], [], []
    for k in range(count):
        data = np.zeros((frames, 2 * count))
        data[:, 2 * k], data[:, 2 * k + 1] = 1.0, s
        rows.append(rng.normal(size=frames) + 30.0 * (k * frames * dt + s) ** 2)
        by_start.append(data)
        by_value.append(0.5 * s**2)
    span = frames * dt
    for k in range(1, count):
        step = np.zeros((2, 2 * count))
        step[0, [2 * k - 2, 2 * k - 1, 2 * k]] = 1.0, span, -1.0
        step[1, [2 * k - 1, 2 * k + 1]] = 1.0, -1.0
        rows.append(np.zeros(2))
        by_start.append(step / tie)
        by_value.append(np.array([0.5 * span**2, span]) / tie)
    r, value, start = np.concatenate(rows), np.concatenate(by_value)[:, None], np.concatenate(by_start)
    whole = np.hstack([value, start])
    least = float(np.sum((r - whole @ np.linalg.lstsq(whole, r, rcond=None)[0]) ** 2))
    seen = count * frames if seen_only else None

    def evaluate(values: np.ndarray, starts: list[np.ndarray]) -> list[np.ndarray]:
        return [r - value @ values - start @ starts[0]]

    def differentiate(values, starts, residuals, starts_too):
        return [Blocks(residuals[0], value, start, seen=seen)]

    return Problem(evaluate, differentiate, lambda residuals: float(residuals[0] @ residuals[0])), least


@pytest.mark.parametrize("tie", [1.0, 1e-2, 1e-4])
def test_segments_that_join_closely_are_moved_together_at_once(tie):
    """A step that is damped by what ties the starts moves each of them as if it were alone."""

    def left(seen_only: bool) -> float:
        problem, least = chained(tie, seen_only)
        begin, wide = (np.zeros(1), [np.zeros(20)]), (np.array([-np.inf]), np.array([np.inf]))
        values, starts, _ = descend(problem, begin, wide, stale=False, evaluations=6)
        return problem.loss(problem.evaluate(values, starts)) - least

    assert left(True) < 0.02
    if tie < 1e-3:
        assert left(False) > 100


def test_a_search_tells_whether_it_came_to_its_end():
    """After one evaluation in hand it has not: what it is compared with by chi2 may have."""
    problem, least = chained(1e-4, seen_only=False)
    begin, wide = (np.zeros(1), [np.zeros(20)]), (np.array([-np.inf]), np.array([np.inf]))
    *_, ended = descend(problem, begin, wide, stale=False, evaluations=3)
    assert not ended
    values, starts, ended = descend(problem, begin, wide, stale=False, evaluations=400)
    assert ended and problem.loss(problem.evaluate(values, starts)) == pytest.approx(least, rel=1e-3)


def test_a_short_search_through_segments_goes_on_where_it_may_matter():
    """A drag that explains all was given up ten steps on its way, with 600 of chi2 left at an impact."""
    calls = []

    class Fits:
        def refitted(self, fit, evaluations):
            calls.append(evaluations)
            return SimpleNamespace(values=fit.values, starts=fit.starts, chi2=150.0, excess=0.0, ended=True)

    def tried(chi2: float, excess: float, ended: bool) -> Trial:
        fit = SimpleNamespace(hypothesis=None, values=np.zeros(1), starts={}, chi2=chi2, excess=excess, ended=ended)
        signature = SimpleNamespace(term=SimpleNamespace(free=(SimpleNamespace(inner=False),)))
        return Trial(signature, fit, 3000.0 - chi2, float("inf"))

    base = SimpleNamespace(chi2=3000.0)
    short = _to_its_end(Fits(), base, tried(800.0, 600.0, False), least=1000.0)
    assert short.gain == 2850.0 and len(calls) == 1
    for other, least in ((tried(800.0, 600.0, True), 1000.0), (tried(2500.0, 2300.0, False), 1000.0)):
        assert _to_its_end(Fits(), base, other, least) is other
    assert len(calls) == 1


POWER = Hypothesis((
    Term("push", "push", (Free("push.a", "N", -9.0, 9.0, 0.0, 1.0),), lambda *a: a),
    Term("power", "power", (
        Free("power.s", "N", -50.0, 50.0, 1.0, 1.0), Free("power.n", "1", 0.5, 8.0, 2.0, 0.1, inner=True),
    ), lambda *a: a),
))  # fmt: skip


def powers_left(
    true: tuple[float, float], begin: tuple[float, float], plainly: bool, evaluations: int
) -> tuple[float, bool]:
    """What a search for s and n of s r^-n, seen at r from 3 to 6, leaves of chi2, and whether a strength vanished."""
    r, at, x = np.linspace(3.0, 6.0, 40), np.array([1, 2]), np.array([0.5, *begin])
    seen = true[0] * r ** -true[1]
    straight = Straight.of(POWER, x, at, plainly)

    def evaluate(part, starts):
        s, n = straight.values(part)
        return [(seen - s * r**-n) / 1e-4]

    def differentiate(part, starts, residuals, anew):
        s, n = straight.values(part)
        columns = np.column_stack([r**-n, -s * np.log(r) * r**-n]) / 1e-4
        return [Blocks(residuals[0], columns * straight.slopes(part), np.zeros((40, 0)))]

    problem = Problem(evaluate, differentiate, lambda residuals: float(residuals[0] @ residuals[0]))
    part, starts, _ = descend(
        problem, (straight.begin, [np.zeros(0)]), straight.bounds, stale=False, evaluations=evaluations
    )
    return problem.loss(evaluate(part, starts)), straight.gone(part)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_search_walks_along_a_straight_valley(sign):
    """Strength and exponent lie along a bent one: a few steps do in ln s what many do in s."""
    true, begin = (sign * 45.0, 7.5), (sign * 0.1, 1.0)
    assert powers_left(true, begin, False, 10)[0] < 1e-3
    assert powers_left(true, begin, True, 10)[0] > 1000


def test_a_strength_that_vanishes_is_told():
    """No step leads from one sign to the other: the search goes on in the number itself."""
    assert powers_left((-2.0, 3.0), (0.5, 3.0), False, 60)[1]
    assert not powers_left((2.0, 3.0), (0.5, 3.0), False, 60)[1]


def test_numbers_of_laws_without_a_shape_stay_as_they_are():
    x, at = np.array([-0.5, 4.0, 2.0]), np.array([0, 1, 2])
    straight = Straight.of(POWER, x, at)
    assert np.allclose(straight.begin, [-0.5, np.log(4.0), 2.0]) and np.allclose(straight.values(straight.begin), x)
    assert np.allclose(straight.slopes(straight.begin), [1.0, 4.0, 1.0])
    assert np.allclose(straight.bounds[0], [-9.0, -np.inf, 0.5]) and straight.bounds[1][1] == np.log(50.0)
    assert np.array_equal(Straight.of(POWER, np.array([0.0, 0.0, 2.0]), at).sign, np.zeros(3))
    assert np.array_equal(Straight.of(POWER, x, at, plainly=True).begin, x)
    # a step that is far too long asks for a strength beyond all numbers, which is no warning
    assert np.isfinite(straight.values(np.array([-0.5, 800.0, 2.0]))).all()


@pytest.mark.parametrize(("again", "stands"), [(100.8, "before"), (99.0, "again"), (150.0, "whole")])
def test_of_two_ends_with_the_same_joints_the_better_one_stands(again, stands):
    """Begun where one start passes, a search may end above the fit with these joints that was there before."""

    def fit(name, chi2):
        told = {"values": np.ones(1), "covariance": np.eye(1), "starts": None, "hypothesis": None, "count": 100}
        return SimpleNamespace(name=name, chi2=chi2, ties=2, allowed_rise=6.0, **told)

    whole = SimpleNamespace(fit_from=lambda begin: fit("whole", 101.0))
    fitter = SimpleNamespace(
        closeness=1e-9, segmented=True, stop=lambda: False, in_one=lambda: whole, continued=lambda fit: None,
        fit=lambda *a, **how: fit("again", again),
    )  # fmt: skip
    found_by, found = joined(fitter, fit("before", 100.0))
    assert found.name == stands and found_by is (whole if stands == "whole" else fitter)
