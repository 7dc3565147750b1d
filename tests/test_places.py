"""Places where nothing is missing: z of the first is no larger than chance makes it."""

import numpy as np
import pytest

from granswim_pymunk.inference.criteria import using
from granswim_pymunk.validation.place_nulls import EVERY, of_bodies, page


@pytest.mark.deep
def test_a_window_across_an_impact_is_no_place():
    """Its own start is hard to find from frames before the impact; the whole run passes there within the noise."""
    with using(EVERY):
        z, places = of_bodies(23)
    assert places == 10 and abs(z) < 4


def test_the_table_tells_numbers_that_are_too_large():
    z = np.random.default_rng(0).normal(size=60)
    good, wrong = (page({"bodies": list(z + off)}).splitlines()[-1].split("|") for off in (0.0, 1.0))
    assert float(good[6]) > 0.05 > float(wrong[6]) and int(wrong[5].split()[0]) > int(good[5].split()[0])
