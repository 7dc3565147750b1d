"""Parts of the tests, as ``--part`` takes them."""

from types import SimpleNamespace

import pytest
from conftest import pytest_collection_modifyitems


def taken(part, items):
    left_out = []
    config = SimpleNamespace(
        getoption=lambda name: part, hook=SimpleNamespace(pytest_deselected=lambda items: left_out.extend(items))
    )
    items = list(items)
    pytest_collection_modifyitems(config, items)
    return items, left_out


def test_parts_hold_each_test_once():
    whole = [f"test_{k}" for k in range(20)]
    parts = [taken(f"{k}/8", whole) for k in range(1, 9)]
    assert sorted(name for items, _ in parts for name in items) == sorted(whole)
    assert all(sorted(items + left_out) == sorted(whole) for items, left_out in parts)
    assert taken(None, whole) == (whole, [])


@pytest.mark.parametrize("part", ["0/8", "9/8", "3", "a/b", "1/2/3"])
def test_what_is_no_part_is_said(part):
    with pytest.raises(pytest.UsageError, match="should be K/N"):
        taken(part, ["one"])
