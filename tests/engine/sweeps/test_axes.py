"""Axes of sweeps: parsing, values, and the settings of a run at a point."""

from __future__ import annotations

import pytest

from eidrive_scenario.errors import SettingError
from eidrive_scenario.experiments.sweeps.axes import Axis, Point, changed_profile, parse_axes, parse_axis, settings_at
from eidrive_scenario.simulation import RunSettings


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("Speed=6,8.5,10", (6, 8.5, 10)),
        ("Speed=6:8:0.5", (6.0, 6.5, 7.0, 7.5, 8.0)),
        ("Delay=0:0.3:0.1", (0.0, 0.1, 0.2, 0.3)),
        ("Count=1:7:3", (1, 4, 7)),
        ("Gap=3:1:-1", (3, 2, 1)),
        ("Offset=-1e-1:0.1:0.1", (-0.1, 0.0, 0.1)),
        ("detector=oracle, yolov5", ("oracle", "yolov5")),
        ("Model=007,8,-01,0.50", ("007", 8, "-01", 0.5)),
        ("Id=12345678901234567,0", ("12345678901234567", 0)),
        ("Name=a=b,c", ("a=b", "c")),
        ("Time=12:30", None),
    ],
)
def test_parse_axis_returns_values(text: str, values: tuple[object, ...] | None) -> None:
    axis = parse_axis(text)
    if values is None:
        assert axis.is_interval
        assert (axis.low, axis.high) == (12.0, 30.0)
    else:
        assert axis.values == values
        assert [type(value) for value in axis.values] == [type(value) for value in values]


@pytest.mark.parametrize(
    "text",
    ["", "Speed", "=1,2", "Speed=", "Speed=1,,2", "Speed=1,1", "S=2:1", "S=1:1", "S=0:1:0", "S=0:1:-1", "S=0:1e9:1e-9"],
)
def test_parse_axis_with_invalid_text_raises(text: str) -> None:
    with pytest.raises(SettingError, match="--vary"):
        parse_axis(text)


@pytest.mark.parametrize("values", ["0:1e999999:1e-999999", "1e400:2e400", "0:1e-400:1e-401"])
def test_parse_axis_with_numbers_that_no_float_holds_raises(values: str) -> None:
    with pytest.raises(SettingError, match="a number is beyond the range of floats"):
        parse_axis(f"Speed={values}")


@pytest.mark.parametrize("values", ["0..1", "0...1", "0.1..0.5", "0 … 1", "0 to 1", "0:1:0.1:2", "0:", ":1", "0:1,3"])
def test_values_that_resemble_a_range_name_its_form(values: str) -> None:
    with pytest.raises(SettingError, match="write a range as Latency=LOW:HIGH:STEP, an interval as Latency=LOW:HIGH"):
        parse_axis(f"Latency={values}")


@pytest.mark.parametrize("values", ["..", "a..b", "1.0.2", "2026-01-01T12:30:00", "../1", "to", "1-2", "v1..2"])
def test_texts_that_do_not_resemble_a_range_are_values(values: str) -> None:
    assert parse_axis(f"Name={values}").values == (values,)


def test_parse_axes_with_one_name_twice_raises() -> None:
    with pytest.raises(SettingError, match="twice"):
        parse_axes(["Speed=1,2", "param.Speed=3,4"])
    assert len(parse_axes(["weather=a,b", "param.weather=c,d"])) == 2


def test_at_returns_share_of_interval_or_list() -> None:
    assert Axis("a", low=2.0, high=6.0).at(0.25) == 3.0
    assert [Axis("a", ("x", "y")).at(share) for share in (0.0, 0.49, 0.5, 0.999)] == ["x", "x", "y", "y"]


def test_settings_at_sets_parameters_settings_and_channel() -> None:
    base = RunSettings(parameters={"Speed": "5", "Gap": "2"})
    point: Point = {"Speed": 8.5, "param.weather": "dry", "weather": "rain", "cooperate": "A+B", "time_limit": 9}
    settings = settings_at(point, base, None)
    assert settings.parameters == {"Speed": "8.5", "Gap": "2", "weather": "dry"}
    assert (settings.weather, settings.cooperate, settings.time_limit) == ("rain", ("A", "B"), 9.0)
    assert settings_at({"cooperate": "none"}, base, None).cooperate == ()


def test_settings_at_changes_selected_channel_or_that_of_runs() -> None:
    profile = {"model": "composed", "name": "own", "delay": {"kind": "constant", "seconds": 0.1}, "reordering": False}
    changed = settings_at({"channel.delay.seconds": 0.3}, RunSettings(), profile).channel
    assert changed == {"model": "composed", "delay": {"kind": "constant", "seconds": 0.3}, "reordering": False}
    selected = settings_at({"channel": "latency_300ms", "channel.loss.probability": 0.2}, RunSettings(), profile)
    assert isinstance(selected.channel, dict)
    assert selected.channel["delay"] == {"kind": "constant", "seconds": 0.3}
    assert selected.channel["loss"] == {"kind": "bernoulli", "probability": 0.2}


@pytest.mark.parametrize("point", [{"channel.delay.seconds": 0.1}, {"channel": "none", "channel.delay.seconds": 0.1}])
def test_settings_at_without_channel_raises(point: dict[str, str | float]) -> None:
    with pytest.raises(SettingError, match=r"channel.delay.seconds: the runs have no channel"):
        settings_at(point, RunSettings(), None)


def test_changed_profile_keeps_kind_that_has_the_setting() -> None:
    """Bursty losses have a probability, too; other kinds are replaced by the one that has it alone."""
    bursty = {"loss": {"kind": "gilbert_elliott", "probability": 0.1, "burst": 4.0}}
    assert changed_profile(bursty, {"loss.probability": 0.3})["loss"] == {**bursty["loss"], "probability": 0.3}
    fixed = changed_profile({"delay": {"kind": "lognormal", "mean": 0.1, "sd": 0.1}}, {"delay.seconds": 0.2})
    assert fixed["delay"] == {"kind": "constant", "seconds": 0.2}
    for changes in ({"delay.mean": 0.3, "delay.seconds": 0.2}, {"delay.seconds": 0.2, "delay.mean": 0.3}):
        both = changed_profile({"delay": {"kind": "lognormal", "mean": 0.1, "sd": 0.1}}, changes)
        assert both["delay"] == {"kind": "constant", "seconds": 0.2, "mean": 0.3}, "an error of the profile"
    assert changed_profile({"model": "radio"}, {"power": 20, "antenna.gain": 3}) == {
        "model": "radio",
        "power": 20,
        "antenna": {"gain": 3},
    }
