"""Digests of values: equal content gives equal digests, and every difference another one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from itertools import combinations
from typing import NamedTuple

import numpy as np
import pytest

from eidrive_scenario.base.content_digest import content_digest
from eidrive_scenario.world.weather import Weather


class Side(Enum):
    LEFT = 1
    RIGHT = 2


class Pair(NamedTuple):
    first: object
    second: object


@dataclass(frozen=True)
class Part:
    name: str
    sizes: Mapping[str, float]


@dataclass(frozen=True)
class OtherPart:
    name: str
    sizes: Mapping[str, float]


DIFFERENT = [
    None,
    True,
    False,
    0,
    1,
    -1,
    0.0,
    -0.0,
    1.0,
    np.nextafter(1.0, 2.0),
    float("nan"),
    float("inf"),
    "",
    "1",
    "None",
    b"",
    b"1",
    Side.LEFT,
    Side.RIGHT,
    (),
    ((),),
    (1, 2),
    (12,),
    ("a", "b"),
    ("ab",),
    ("a", ("b",)),
    {},
    {"a": 1},
    {"a": 1, "b": 2},
    {"b": 2, "a": 1},
    {"a": {"b": 2}},
    np.zeros(2),
    np.zeros((2, 1)),
    np.zeros((1, 2)),
    np.zeros(2, np.float32),
    np.zeros(2, np.int32),
    np.zeros(2, np.uint32),
    np.array([0.0, -0.0]),
    np.zeros(0),
    Part("a", {}),
    Part("a", {"b": 1.0}),
    OtherPart("a", {}),
    Weather(),
    Weather(wetness=0.5),
    Pair(1, (2, 3)),
    Pair((1, 2), 3),
]


def test_values_of_different_content_have_different_digests() -> None:
    for one, other in combinations(DIFFERENT, 2):
        assert content_digest(one) != content_digest(other), (one, other)
    assert content_digest(1, 2) != content_digest((1, 2))
    assert content_digest("ab", "c") != content_digest("a", "bc")


@pytest.mark.parametrize("value", DIFFERENT, ids=repr)
def test_equal_content_of_other_objects_has_the_same_digest(value: object) -> None:
    copies = {np.ndarray: np.copy, Weather: Weather.model_copy, dict: dict, Part: replace}
    again = copies.get(type(value), lambda one: one)(value)  # type: ignore[operator]
    assert content_digest(again) == content_digest(value)
    assert len(content_digest(value)) == 32


def test_memory_layout_does_not_change_the_digest() -> None:
    table = np.arange(12.0).reshape(3, 4)
    assert content_digest(np.asfortranarray(table)) == content_digest(table)
    assert content_digest(np.arange(24.0).reshape(3, 8)[:, ::2]) == content_digest(
        np.arange(0.0, 24.0, 2.0).reshape(3, 4)
    )


@pytest.mark.parametrize(
    "value",
    [object(), {1, 2}, np.array([object()]), print, [object()]],
    ids=["object", "set", "array", "function", "list"],
)
def test_values_without_content_raise_type_errors(value: object) -> None:
    with pytest.raises(TypeError, match="no digest"):
        content_digest(value)
