"""Channel profiles: library profiles, custom profiles and invalid ones."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from eidrive_scenario.errors import SettingError
from eidrive_scenario.v2x.link_models.composed import ComposedChannel, ComposedProfile
from eidrive_scenario.v2x.link_models.delay import ConstantDelay
from eidrive_scenario.v2x.link_models.loss import BernoulliLoss, NoLoss
from eidrive_scenario.v2x.profile import build_channel, load_profile
from eidrive_scenario.v2x.radio.channel import RadioChannel

LIBRARY = Path(__file__).parents[3] / "xosc" / "channels"


def composed(source: str | Path | Mapping[str, object]) -> ComposedProfile:
    profile = load_profile(source)
    assert isinstance(profile, ComposedProfile)
    return profile


def test_build_channel_of_every_library_profile_has_its_model() -> None:
    names = {"none", *(path.stem for path in LIBRARY.glob("*.yaml"))}
    assert {"none", "ideal", "latency_300ms", "error_30pct", "paper_latency_300ms", "paper_error_30pct"} <= names
    assert {"80211p_urban", "cv2x_highway", "nr_v2x_highway", "5g_uu", "bursty", "congested"} <= names
    for name in names:
        profile = load_profile(name)
        channel = build_channel(profile, 0)
        if name == "none":
            assert profile is None
            assert channel is None
        else:
            assert profile is not None
            assert profile.name == name
            assert profile.description
            assert isinstance(channel, RadioChannel if profile.model == "radio" else ComposedChannel)
            assert channel.own_perception == name.startswith("paper")


def test_resolved_settings_of_every_library_profile_are_a_profile() -> None:
    """A sweep over settings of the channel changes the resolved settings."""
    for path in LIBRARY.glob("*.yaml"):
        profile = load_profile(path.stem)
        assert profile is not None
        resolved = profile.model_dump(mode="json", exclude={"name", "description"})
        again = load_profile(resolved)
        assert again is not None
        assert again.model_dump(mode="json", exclude={"name", "description"}) == resolved


@pytest.mark.parametrize("setting", ["mean: 1.0e-300, sd: 0.1", "mean: 0.1, sd: 1.0e+300"])
def test_lognormal_delay_with_overflowing_ratio_raises(setting: str) -> None:
    with pytest.raises(SettingError, match="delay"):
        composed(f"{{delay: {{kind: lognormal, {setting}}}}}")


def test_library_profiles_have_the_settings_of_the_paper() -> None:
    assert composed("latency_300ms").delay == ConstantDelay(seconds=0.3)
    assert composed("latency_300ms").loss == NoLoss()
    assert composed("error_30pct").loss == BernoulliLoss(kind="bernoulli", probability=0.3, scope="link")
    both, late, lossy = composed("paper"), composed("paper_latency_300ms"), composed("paper_error_30pct")
    assert (both.delay, both.loss) == (late.delay, lossy.loss)
    assert composed("paper_error_30pct").loss == BernoulliLoss(kind="bernoulli", probability=0.3, scope="frame")


def test_load_profile_accepts_mapping_yaml_text_and_file(tmp_path: Path) -> None:
    text = "{delay: {kind: constant, seconds: 0.1}, own_perception: true}"
    file = tmp_path / "mine.yaml"
    file.write_text("delay:\n  kind: constant\n  seconds: 0.1\nown_perception: true\n")
    mapping = {"delay": {"kind": "constant", "seconds": 0.1}, "own_perception": True}
    sources: list[tuple[str | Path | Mapping[str, object], str]] = [
        (text, "custom"),
        (mapping, "custom"),
        (file, "mine"),
        (str(file), "mine"),
    ]
    for source, name in sources:
        profile = composed(source)
        assert profile.delay == ConstantDelay(seconds=0.1)
        assert profile.own_perception
        assert profile.name == name


INVALID = [
    ("latency_300", "no channel profile 'latency_300'; did you mean 'latency_300ms'?"),
    ("{los: {kind: none}}", "unknown setting 'los'; did you mean 'loss'?"),
    ("{delay: {kind: constant, second: 0.3}}", "unknown setting 'delay.constant.second'; did you mean 'seconds'?"),
    ("{delay: {kind: constnt}}", "setting 'delay.kind' is 'constnt'; did you mean 'constant'?"),
    ("{delay: {kind: constant, seconds: -1}}", "'delay.constant.seconds' is -1"),
    ("{delay: {kind: uniform, minimum: 2, maximum: 1}}", "maximum must be at least minimum (got 1, below 2)"),
    ("{delay: {kind: shifted_gamma, minimum: 2, mean: 1}}", "mean must be at least minimum (got 1, below 2)"),
    (
        "{delay: {kind: truncated_normal, mean: 9, sd: 0.1, maximum: 1}}",
        "minimum and maximum must enclose part of the distribution",
    ),
    ("{loss: {kind: bernoulli, probability: 1.5}}", "'loss.bernoulli.probability' is 1.5"),
    ("{delay: {kind: trace, seconds: [0.1], unit: ms}}", "unit requires file and has no effect with seconds"),
    ("{model: radio, sidelink: {interval: 0.05}}", "sidelink has no effect with technology 80211p"),
    (
        "{model: radio, technology: cv2x_mode4, data_rate_mbps: 12}",
        "data_rate_mbps has no effect with technology cv2x_mode4",
    ),
    ("{model: radio, jammers: {x: 30, y: 0}}", "'jammers' is {'x': 30, 'y': 0}; a list is expected: [value, …]"),
    ("{model: compsed}", "unknown channel model 'compsed'; did you mean 'composed'?"),
    ("[1, {2: 3}]", "channel profile is not a mapping (got list)"),
    ("{a: [}", "not valid YAML"),
    ("{[a]: 1}", "not valid YAML: a key is a single word"),
    ("{name: 2001-13-45}", "not valid YAML: month must be in 1..12"),
    ("{a: " + "[" * 3000, "not valid YAML: nested too deeply"),
]


@pytest.mark.parametrize(("source", "message"), INVALID, ids=[row[0][:60] for row in INVALID])
def test_load_profile_invalid_text_raises_with_position_and_hint(source: str, message: str) -> None:
    with pytest.raises(SettingError) as caught:
        load_profile(source, origin="scenario.xosc", line=12)
    assert str(caught.value).startswith("scenario.xosc:12: ")
    assert message in str(caught.value)


def test_load_profile_of_other_file_or_long_text_raises(tmp_path: Path) -> None:
    file = tmp_path / "mine.txt"
    file.write_text("model: composed\n")
    with pytest.raises(SettingError, match=r"mine.txt' is not a channel profile; expected a file name in .yaml"):
        load_profile(str(file))
    with pytest.raises(SettingError, match="no channel profile 'xxx"):
        load_profile("x" * 300)


def test_load_profile_invalid_file_raises_with_path_and_line(tmp_path: Path) -> None:
    file = tmp_path / "wrong.yaml"
    file.write_text("model: composed\nloss:\n  kind: bernoulli\nspeed: 3\n")
    with pytest.raises(SettingError) as caught:
        load_profile(file)
    assert [str(diagnostic) for diagnostic in caught.value.diagnostics] == [
        f"{file}:2: setting 'loss.bernoulli.probability' is missing; add it",
        f"{file}:4: unknown setting 'speed'; known: delay, description, loss, model, name, own_perception, reordering",
    ]
    empty = tmp_path / "empty.yaml"
    empty.write_text("")
    with pytest.raises(SettingError, match="got an empty file"):
        load_profile(empty)


DEEP = """\
model: radio
path_loss:
  kind: tr37885
  enviroment: urban

congestion: {kind: reactive,
             limits: [0.3, 0.6, 1.4],
             intervals: [0.1, 0.2, 0.5]}
delay:
  minimum: 0.1
loss: 0.3
background:
  kind: 80211q
"""


def test_load_profile_reports_each_invalid_key_with_its_line(tmp_path: Path) -> None:
    file = tmp_path / "deep.yaml"
    file.write_text(DEEP)
    expected = {
        4: "unknown setting 'path_loss.tr37885.enviroment'; did you mean 'environment'?",
        7: "setting 'congestion.reactive.limits.2' is 1.4; input should be less than or equal to 1",
        9: "setting 'delay.kind' is missing; "
        "known: constant, lognormal, shifted_gamma, trace, truncated_normal, uniform",
        11: "setting 'loss' is 0.3; a mapping is expected: {key: value, …}",
        13: "setting 'background.kind' is '80211q'; did you mean '80211p'?",
    }
    with pytest.raises(SettingError) as caught:
        load_profile(file)
    assert {str(diagnostic) for diagnostic in caught.value.diagnostics} == {
        f"{file}:{line}: {expected[line]}" for line in expected
    }
    with pytest.raises(SettingError) as caught:
        load_profile("\n  " + DEEP.replace("\n", "\n  "), origin="scenario.xosc", line=40)
    assert {diagnostic.line for diagnostic in caught.value.diagnostics} == {40 + line for line in expected}


@pytest.mark.parametrize(
    ("rows", "more", "message"),
    [
        (None, "", "cannot read .*measured.csv: No such file"),
        ("", "", "measured.csv is empty"),
        ("delay\n", "", "measured.csv has no delays"),
        ("delay\n0.1\n\n-0.2\n", "", r"measured.csv:4: delay is negative"),
        ("delay\n0.1\nsoon\n", "", r"measured.csv:3: column 0 is not a delay"),
        ("delay\n0.1\n", "column: late", "has no column 'late' in its first row"),
        ("delay\n0.1\n", "column: 1", r"has no column 1 \(expected 0 to 0\)"),
        ("delay\n0.1\n", "column: -1", r"has no column -1 \(expected 0 to 0\)"),
        ("delay\n0.1\n", "unit: min", "'delay.trace.unit' is 'min'; input should be 's' or 'ms'"),
        ("delay\n0.1\n", "unit: [ms]", r"'delay.trace.unit' is \['ms'\]; input should be 's' or 'ms'"),
        ("delay\n0.1\n", "column: [1]", r"column is invalid \(got \[1\]; expected a name or an index from 0\)"),
        ("delay\n0.1\n", "column: 0.5", r"column is invalid \(got 0.5; expected a name"),
        ("delay\n" + 200_000 * "1" + "\n", "", "cannot read .*measured.csv: field larger than field limit"),
    ],
)
def test_load_profile_with_invalid_delay_trace_raises(
    tmp_path: Path, rows: str | None, more: str, message: str
) -> None:
    if rows is not None:
        (tmp_path / "measured.csv").write_text(rows)
    file = tmp_path / "mine.yaml"
    file.write_text(f"delay:\n  kind: trace\n  file: measured.csv\n  {more}\n")
    with pytest.raises(SettingError, match=message):
        load_profile(file)


def test_load_profile_missing_file_raises_with_suggestion() -> None:
    with pytest.raises(SettingError, match=r"--channel: no file 'latency_300mss.yaml'; did you mean 'latency_300ms'\?"):
        load_profile("latency_300mss.yaml", origin="--channel")
    with pytest.raises(SettingError, match="--channel: channel name is empty"):
        load_profile(" ", origin="--channel")
