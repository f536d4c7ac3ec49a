"""What a caller gives to a run in Python: seeds, stations, limits."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eidrive_scenario.errors import SettingError
from eidrive_scenario.experiments.single_run import run_and_save
from eidrive_scenario.simulation import RunSettings, Simulation, run_file

ONE = "coop/scenario_1"


def test_seed_of_an_array_is_the_same_seed(tmp_path: Path) -> None:
    """`numpy.arange` is the usual way to many seeds; folder, settings and trace are those of the plain integer."""
    settings = RunSettings(time_limit=0.2)
    plain = run_and_save(ONE, seed=3, settings=settings, out=tmp_path)
    (seed,) = np.arange(3, 4)
    again = run_and_save(ONE, seed=seed, settings=settings, out=tmp_path)
    assert again.trace_hash == plain.trace_hash
    assert (again.settings, again.command) == (plain.settings, plain.command)
    assert type(again.seed) is int


def test_places_to_write_may_be_texts(tmp_path: Path) -> None:
    settings = RunSettings(time_limit=0.2)
    result = run_and_save(ONE, settings=settings, below=str(tmp_path), csv=f"{tmp_path}/motion.csv")
    assert result.recording is not None
    assert result.recording.is_relative_to(tmp_path)
    assert (tmp_path / "motion.csv").read_text().startswith("time,name,")


@pytest.mark.parametrize("seed", ["1", 1.0, None])
def test_seed_that_is_no_integer_is_refused(tmp_path: Path, seed: Any) -> None:
    for run in (Simulation, run_file, run_and_save):
        with pytest.raises(SettingError, match=r"the seed is .*; give an integer"):
            run(ONE, seed=seed)


@pytest.mark.parametrize("senders", [["RSU"], {"RSU"}, ("RSU",)])
def test_senders_as_any_collection_give_equal_settings(senders: Any) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result = run_file(ONE, settings=RunSettings(cooperate=senders, time_limit=0.2))
    assert result.settings == run_file(ONE, settings=RunSettings(cooperate=("RSU",), time_limit=0.2)).settings


def test_senders_as_one_text_are_refused() -> None:
    """A text is a collection too, of its letters."""
    with pytest.raises(SettingError, match="cooperate is the text 'RSU'; give a tuple of station names"):
        RunSettings(cooperate="RSU")  # type: ignore[arg-type]


@pytest.mark.parametrize("limit", [0.0, -1.0, float("nan")])
def test_time_limit_that_ends_no_run_is_refused(limit: float) -> None:
    """A run up to a time that is not a number would never end."""
    with pytest.raises(SettingError, match=r"time_limit is .*; give a positive number of seconds"):
        RunSettings(time_limit=limit)
