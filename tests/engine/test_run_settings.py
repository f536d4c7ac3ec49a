"""Settings of runs in Python: seeds, stations, limits."""

from __future__ import annotations

import shlex
import warnings
from fractions import Fraction
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from eidrive_scenario.api.run import load_for_seed, load_scenario
from eidrive_scenario.errors import SettingError
from eidrive_scenario.experiments.single_run import run_and_save
from eidrive_scenario.run_options.table import option_of
from eidrive_scenario.simulation import RunSettings, Simulation, run_file

ONE = "coop/scenario_1"


def test_seed_of_an_array_is_the_same_seed(tmp_path: Path) -> None:
    """`numpy.arange` is the usual way to many seeds; folder, settings and trace are those of the plain integer."""
    settings = RunSettings(time_limit=0.2)
    plain = run_and_save(ONE, seed=3, settings=settings, out=tmp_path)
    (seed,) = np.arange(3, 4)
    again = run_and_save(ONE, seed=cast("int", seed), settings=settings, out=tmp_path)
    assert again.trace_hash == plain.trace_hash
    assert (again.settings, again.command) == (plain.settings, plain.command)
    assert type(again.seed) is int


def test_output_paths_may_be_texts(tmp_path: Path) -> None:
    settings = RunSettings(time_limit=0.2)
    result = run_and_save(ONE, settings=settings, below=str(tmp_path), csv=f"{tmp_path}/motion.csv")
    assert result.recording is not None
    assert result.recording.is_relative_to(tmp_path)
    assert (tmp_path / "motion.csv").read_text().startswith("time,name,")


def test_channel_as_a_mapping_equals_its_yaml_text(tmp_path: Path) -> None:
    mapping = {"delay": {"kind": "constant", "seconds": 0.1}, "loss": {"kind": "bernoulli", "probability": 0.3}}
    text = "{delay: {kind: constant, seconds: 0.1}, loss: {kind: bernoulli, probability: 0.3}}"
    results = [run_file(ONE, settings=RunSettings(channel=channel, time_limit=1.0)) for channel in (mapping, text)]
    assert results[0].trace_hash == results[1].trace_hash
    assert results[0].settings == results[1].settings
    assert results[0].links[("RSU", "Ego")].lost > 0


def test_command_of_a_channel_of_numpy_numbers_and_paths_repeats_it(tmp_path: Path) -> None:
    (tmp_path / "delays.csv").write_text("0.1\n")
    trace = {"kind": "trace", "file": tmp_path / "delays.csv"}
    for seconds, delay in ((np.float32(0.5), None), (np.int64(1), None), (None, trace)):
        channel = {"delay": delay or {"kind": "constant", "seconds": seconds}}
        result = run_and_save(ONE, settings=RunSettings(channel=channel, time_limit=0.2), below=tmp_path)
        text = shlex.split(result.command)[shlex.split(result.command).index("--channel") + 1]
        again = run_file(ONE, settings=RunSettings(channel=text, time_limit=0.2))
        assert again.settings == result.settings


@pytest.mark.parametrize("seed", ["1", 1.0, None])
def test_noninteger_seed_raises(tmp_path: Path, seed: Any) -> None:
    for run in (Simulation, load_for_seed, run_file, run_and_save):
        with pytest.raises(SettingError, match=r"the seed is .*; give an integer"):
            run(ONE, seed=seed)


@pytest.mark.parametrize(
    ("argument", "message"),
    [
        ({"observers": None}, "observers is None; give a list of observers"),
        ({"observers": 3}, "observers is 3; give a list of observers"),
        ({"settings": {"channel": "ideal"}}, "settings is {'channel': 'ideal'}; give RunSettings(…)"),
        ({"settings": {}}, "settings is {}; give RunSettings(…)"),
    ],
)
def test_argument_of_another_type_raises(argument: dict[str, Any], message: str) -> None:
    for run in (Simulation, run_file, run_and_save):
        with pytest.raises(SettingError) as caught:
            run(ONE, **argument)
        assert str(caught.value) == message


def test_unknown_argument_of_a_simulation_is_named() -> None:
    with pytest.raises(TypeError, match="unexpected keyword argument 'parameters'"):
        Simulation(ONE, parameters={})  # type: ignore[call-arg]


def test_parameters_of_another_type_raise() -> None:
    with pytest.raises(SettingError, match="parameters is 3; give a mapping of names to values"):
        load_scenario(ONE, cast("Any", 3))


@pytest.mark.parametrize("senders", [["RSU"], {"RSU"}, ("RSU",), ["RSU", "RSU"]])
def test_senders_as_any_collection_give_equal_settings(senders: Any) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result = run_file(ONE, settings=RunSettings(cooperate=senders, time_limit=0.2))
    assert result.settings == run_file(ONE, settings=RunSettings(cooperate=("RSU",), time_limit=0.2)).settings


def test_senders_as_single_text_raise() -> None:
    """A text is a collection too, of its letters."""
    with pytest.raises(SettingError, match="cooperate is the text 'RSU'; give a tuple of station names"):
        RunSettings(cooperate="RSU")  # type: ignore[arg-type]


@pytest.mark.parametrize("step", [np.float32(0.05), Fraction(1, 20)])
def test_time_step_is_the_number_of_its_command(step: Any) -> None:
    """The float nearest to the given number. An equal number of another type would be left out of the command."""
    settings = RunSettings(dt=step)
    assert type(settings.dt) is float
    words = option_of("dt").words(settings.dt)
    assert settings.dt == (float(words[1]) if words else 0.05) == float(step)


@pytest.mark.parametrize("limit", [0.0, -1.0, float("nan"), float("inf"), 10**400])
def test_nonpositive_or_infinite_time_limit_raises(limit: float) -> None:
    """A run up to a time that is not a number would never end, and no command line has an infinite one."""
    with pytest.raises(SettingError, match=r"time_limit is .*; give a positive number of seconds"):
        RunSettings(time_limit=limit)


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        ("channel", 5),
        ("channel", b"ideal"),
        ("weather", {"cloud_cover": 0.5}),
        ("detector", 5),
        ("cooperate", 5),
        ("cooperate", [5]),
        ("cooperate", b"RSU"),
        ("dt", "0.05"),
        ("dt", True),
        ("time_limit", "60"),
        ("time_limit", None),
        ("parameters", ["EgoSpeed"]),
        ("parameters", {5: "9"}),
        ("parameters", {"EgoSpeed": None}),
        ("user_values", "alarm"),
        ("user_values", {"alarm": [1]}),
        ("user_values", {"alarm=on": "1"}),
        ("user_values", {"": "1"}),
        ("controllers", {"EgoStack": 5.0j, 1: "external"}),
        ("controllers", "external"),
        ("controllers", {"EgoStack=1": "external"}),
        ("allow_torchscript", "no"),
        ("allow_torchscript", 1),
    ],
)
def test_settings_of_wrong_type_raise_with_name(setting: str, value: Any) -> None:
    """`allow_torchscript="no"` is a true value to Python, and would allow weights to execute any code."""
    with pytest.raises(SettingError, match=setting):
        RunSettings(**{setting: value})


@pytest.mark.parametrize(("value", "text"), [(True, "true"), (np.False_, "false"), (1.5, "1.5"), (np.int64(3), "3")])
def test_values_of_python_are_the_texts_of_the_command_line(tmp_path: Path, value: Any, text: str) -> None:
    """Settings and the command that repeats the run are those of `--user-value flag=TEXT`."""
    typed = RunSettings(user_values={"flag": value}, parameters={"flag": value})
    assert typed == RunSettings(user_values={"flag": text}, parameters={"flag": text})
    result = run_and_save(ONE, settings=RunSettings(user_values={"flag": value}, time_limit=0.2), below=tmp_path)
    assert result.settings.user_values == {"flag": text}
    assert f"--user-value flag={text} " in result.command


def test_user_value_set_during_a_run_is_a_text() -> None:
    with Simulation(ONE) as simulation:
        simulation.set_user_value("flag", True)  # type: ignore[arg-type]
        simulation.tick()
        assert simulation.storyboard.context.user_values["flag"] == "true"
        with pytest.raises(SettingError, match="the user-defined value 'flag' is None"):
            simulation.set_user_value("flag", None)  # type: ignore[arg-type]
