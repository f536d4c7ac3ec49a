"""Lists of seeds, and parts of job arrays, as texts of options."""

from __future__ import annotations

import pytest

from eidrive_scenario.cli.options import MOST_SEEDS, parse_seeds, parse_shard
from eidrive_scenario.errors import SettingError


def test_seeds_are_numbers_and_inclusive_ranges() -> None:
    assert parse_seeds("1, 5-8,3") == [1, 5, 6, 7, 8, 3]
    assert parse_shard("2/8") == (2, 8)


@pytest.mark.parametrize("text", ["", "a", "3-1", "-2", "1-", "1,,2", "1.5", "9" * 5000])
def test_other_texts_are_no_seeds(text: str) -> None:
    """Python refuses to convert more than 4300 digits to an integer."""
    with pytest.raises(SettingError, match="--seeds: no seeds"):
        parse_seeds(text)


@pytest.mark.parametrize("text", [f"1-{MOST_SEEDS + 1}", f"1-{MOST_SEEDS},7", f"1-600000,1-{MOST_SEEDS - 599_999}"])
def test_number_of_seeds_is_limited_over_all_parts(text: str) -> None:
    with pytest.raises(SettingError, match=f"more than {MOST_SEEDS} seeds"):
        parse_seeds(text)


def test_all_permitted_seeds_are_accepted() -> None:
    assert len(parse_seeds(f"1,2-{MOST_SEEDS}")) == MOST_SEEDS


@pytest.mark.parametrize("text", ["0/2", "3/2", "1", "1/", "a/2", "1/" + "9" * 5000])
def test_other_texts_are_no_shard(text: str) -> None:
    with pytest.raises(SettingError, match="--shard: no part of a whole"):
        parse_shard(text)
