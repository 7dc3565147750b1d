"""What a scene's hash covers, and laws on their way to other processes."""

import copy
import math
import pickle
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from granswim_pymunk.fingerprint import fingerprint
from granswim_pymunk.laws import AUTOMATIC, Law, Parameter, all_laws, law
from granswim_pymunk.laws.base import _REGISTRY
from granswim_pymunk.scene import Body, Scene, use
from granswim_pymunk.sweep import _pack

K = [Parameter("k", "N/m", "stiffness")]


@pytest.fixture(autouse=True)
def registry():
    before = dict(_REGISTRY)
    yield
    _REGISTRY.clear()
    _REGISTRY.update(before)


def declared(function: Callable[..., Any], **more: Any) -> Law:
    how = {"kind": "body", "expression": "", "reference": "", "parameters": K, "name": "trap"} | more
    return law(**how)(function)


def scene(own: Law) -> Scene:
    return Scene(bodies=(Body("a", "free", 1e-2, 1e-3, initial=(0.0, 0.0, 0.0, 0.0)),), laws=(use(own, k=1.0),))


def two(x, k):
    return -2.0 * k * x, 0.0


def three(x, k):
    return -3.0 * k * x, 0.0


def helper_two(x):
    return 2.0 * x


def helper_three(x):
    return 3.0 * x


def test_hash_tells_laws_apart_that_differ_in_a_literal() -> None:
    assert scene(declared(two)).hash != scene(declared(three)).hash
    # what the scene says is the same: only what the laws do is not
    assert scene(declared(two)).identity == scene(declared(three)).identity


def test_hash_covers_what_a_law_draws_on() -> None:
    """Defaults, closure values, globals, helpers and their helpers, nested functions, arrays, the declaration."""

    def closing(number):
        def inner(x, k):
            return -number * k * x, 0.0

        return inner

    def calling(inner):
        text = "def outer(x, k):\n    return helper(x) * k, 0.0\n"
        space: dict[str, Any] = {"helper": inner}
        exec(text, space)
        return space["outer"]

    def with_default(default):
        def inner(x, k=default):
            return -k * x, 0.0

        return inner

    def reading(value):
        space: dict[str, Any] = {"number": value}
        exec("def inner(x, k):\n    return -number * k * x, 0.0\n", space)
        return space["inner"]

    def nested(number):
        space: dict[str, Any] = {}
        exec(f"def inner(x, k):\n    f = lambda y: {number} * y\n    return f(x), 0.0\n", space)
        return space["inner"]

    pairs = [
        (closing(2.0), closing(3.0)),
        (closing(np.array([1.0, 2.0])), closing(np.array([1.0, 2.5]))),
        (calling(helper_two), calling(helper_three)),
        (calling(closing(2.0)), calling(closing(3.0))),
        (with_default(1.0), with_default(2.0)),
        (reading(2.0), reading(3.0)),
        (nested(2.0), nested(3.0)),
    ]
    for a, b in pairs:
        assert scene(declared(a)).hash != scene(declared(b)).hash
        assert scene(declared(a)).hash == scene(declared(a)).hash
    assert scene(declared(closing(2.0))).hash == scene(declared(closing(2.0))).hash
    assert scene(declared(two)).hash != scene(declared(two, form_of="spring")).hash


def test_hash_follows_a_changed_global() -> None:
    space: dict[str, Any] = {"number": 2.0}
    exec("def inner(x, k):\n    return -number * k * x, 0.0\n", space)
    own = declared(space["inner"])
    before = scene(own).hash
    space["number"] = 3.0
    assert scene(own).hash != before


def test_hash_is_the_same_in_another_process() -> None:
    names = [name for name, item in all_laws().items() if item.shipped]
    text = (
        "from granswim_pymunk.fingerprint import fingerprint\nfrom granswim_pymunk.laws import all_laws\n"
        f"print(fingerprint([all_laws()[name].fingerprint for name in {names!r}]))"
    )
    said = {subprocess.check_output([sys.executable, "-c", text], text=True) for _ in range(2)}
    assert said == {fingerprint([all_laws()[name].fingerprint for name in names]) + "\n"}


def test_fingerprints_of_values() -> None:
    values: list[Any] = [1, 1.0, True, "1", b"1", None, [1], (1,), {1}, {1: 2}, [[1]], np.float32(1), np.ones(1), math]
    assert len({fingerprint(v) for v in values}) == len(values)
    assert fingerprint({"a": 1, "b": 2}) == fingerprint({"b": 2, "a": 1})
    again: list[Any] = []
    again.append(again)
    assert fingerprint(again)

    def forever(n):
        return forever(n - 1) if n else 0

    assert fingerprint(forever)


def test_every_law_of_the_package_comes_back_as_itself() -> None:
    for item in all_laws().values():
        if item.shipped:
            assert pickle.loads(pickle.dumps(item)) is item
    assert pickle.loads(pickle.dumps(AUTOMATIC)) is AUTOMATIC and copy.deepcopy(AUTOMATIC) is AUTOMATIC


def test_a_law_without_a_name_in_its_module_travels_as_a_whole() -> None:
    number = 4.0

    def trap(x, k):
        return -number * k * x, 0.0

    sent = pickle.dumps(declared(trap))
    assert pickle.loads(sent) is _REGISTRY["trap"]  # here it is known
    del _REGISTRY["trap"]
    once, twice = pickle.loads(sent), pickle.loads(sent)
    assert once is twice and once.function(1.0, 2.0) == (-8.0, 0.0)
    # another law of that name is not taken for it
    declared(two)
    assert pickle.loads(sent) is once


def test_a_law_that_changed_on_the_way_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    spring = all_laws()["spring"]
    sent = pickle.dumps(spring)
    monkeypatch.setattr(spring.function, "__defaults__", (5.0,))
    with pytest.raises(pickle.UnpicklingError, match="law spring"):
        pickle.loads(sent)


def test_a_law_of_no_module_hinders_nothing() -> None:
    space: dict[str, Any] = {}
    exec("def adrift(x, k):\n    return -k * x, 0.0\n", space)
    own = declared(space["adrift"], name="adrift")
    assert own.function.__module__ is None and not own.shipped
    assert pickle.loads(pickle.dumps(own)) is own
    assert _pack(math.sqrt, math.sqrt)
