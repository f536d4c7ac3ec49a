"""Channel profiles: the library's, a person's, and wrong ones."""

from __future__ import annotations

from pathlib import Path

import pytest

from eidrive_scenario.errors import SettingError
from eidrive_scenario.v2x.link_models.composed import ComposedChannel, ComposedProfile
from eidrive_scenario.v2x.link_models.delay import ConstantDelay
from eidrive_scenario.v2x.link_models.loss import BernoulliLoss, NoLoss
from eidrive_scenario.v2x.profile import build_channel, load_profile, profile_names
from eidrive_scenario.v2x.radio.channel import RadioChannel

LIBRARY = Path(__file__).parents[3] / "xosc" / "channels"


def composed(source: object, folders: tuple[Path, ...] = (LIBRARY,)) -> ComposedProfile:
    profile = load_profile(source, folders)  # type: ignore[arg-type]
    assert isinstance(profile, ComposedProfile)
    return profile


def test_every_profile_of_the_library_makes_a_channel() -> None:
    names = profile_names(LIBRARY)
    assert {"none", "ideal", "latency_300ms", "error_30pct", "paper_latency_300ms", "paper_error_30pct"} <= set(names)
    assert {"80211p_urban", "cv2x_highway", "5g_uu", "bursty", "congested"} <= set(names)
    for name in names:
        profile = load_profile(name, [LIBRARY])
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


@pytest.mark.parametrize("setting", ["mean: 1.0e-300, sd: 0.1", "mean: 0.1, sd: 1.0e+300"])
def test_lognormal_delay_whose_ratio_overflows_is_refused(setting: str) -> None:
    with pytest.raises(SettingError, match="delay"):
        composed(f"{{delay: {{kind: lognormal, {setting}}}}}")


def test_the_paper_s_settings() -> None:
    assert composed("latency_300ms").delay == ConstantDelay(seconds=0.3)
    assert composed("latency_300ms").loss == NoLoss()
    assert composed("error_30pct").loss == BernoulliLoss(kind="bernoulli", probability=0.3, scope="link")
    both, late, lossy = composed("paper"), composed("paper_latency_300ms"), composed("paper_error_30pct")
    assert (both.delay, both.loss) == (late.delay, lossy.loss)
    assert composed("paper_error_30pct").loss == BernoulliLoss(kind="bernoulli", probability=0.3, scope="frame")


def test_a_profile_may_be_a_mapping_a_yaml_text_or_a_file(tmp_path: Path) -> None:
    text = "{delay: {kind: constant, seconds: 0.1}, own_perception: true}"
    file = tmp_path / "mine.yaml"
    file.write_text("delay:\n  kind: constant\n  seconds: 0.1\nown_perception: true\n")
    mapping = {"delay": {"kind": "constant", "seconds": 0.1}, "own_perception": True}
    for source, name in ((text, "custom"), (mapping, "custom"), (file, "mine"), (str(file), "mine"), ("mine", "mine")):
        profile = composed(source, (tmp_path,))
        assert profile.delay == ConstantDelay(seconds=0.1)
        assert profile.own_perception
        assert profile.name == name


WRONG = [
    ("latency_300", "no channel profile 'latency_300'; did you mean 'latency_300ms'?"),
    ("{los: {kind: none}}", "unknown setting 'los'; did you mean 'loss'?"),
    ("{delay: {kind: constant, second: 0.3}}", "unknown setting 'delay.constant.second'; did you mean 'seconds'?"),
    ("{delay: {kind: constnt}}", "setting 'delay.kind' is 'constnt'; did you mean 'constant'?"),
    ("{delay: {kind: constant, seconds: -1}}", "'delay.constant.seconds' is -1"),
    ("{delay: {kind: uniform, minimum: 2, maximum: 1}}", "maximum 1 lies below minimum 2"),
    ("{delay: {kind: shifted_gamma, minimum: 2, mean: 1}}", "mean 1 lies below minimum 2"),
    ("{delay: {kind: truncated_normal, mean: 9, sd: 0.1, maximum: 1}}", "falls between minimum and maximum"),
    ("{loss: {kind: bernoulli, probability: 1.5}}", "'loss.bernoulli.probability' is 1.5"),
    ("{delay: {kind: trace, seconds: [0.1], unit: ms}}", "unit belongs to a file; the list of seconds has none"),
    ("{model: radio, sidelink: {interval: 0.05}}", "sidelink means nothing to 80211p"),
    ("{model: radio, technology: cv2x_mode4, data_rate_mbps: 12}", "data_rate_mbps means nothing to cv2x_mode4"),
    ("{model: compsed}", "unknown channel model 'compsed'; did you mean 'composed'?"),
    ("[1, {2: 3}]", "a channel profile is a mapping"),
    ("{a: [}", "not valid YAML"),
    ("{[a]: 1}", "not valid YAML: a key is a single word"),
    ("{name: 2001-13-45}", "not valid YAML: month must be in 1..12"),
    ("{a: " + "[" * 3000, "not valid YAML: nested too deeply"),
]


@pytest.mark.parametrize(("source", "message"), WRONG, ids=[row[0][:60] for row in WRONG])
def test_a_wrong_profile_says_where_and_what_would_be_right(source: str, message: str) -> None:
    with pytest.raises(SettingError) as caught:
        load_profile(source, [LIBRARY], origin="scenario.xosc", line=12)
    assert str(caught.value).startswith("scenario.xosc:12: ")
    assert message in str(caught.value)


def test_a_file_that_is_no_profile_and_a_text_that_is_no_path(tmp_path: Path) -> None:
    file = tmp_path / "mine.txt"
    file.write_text("model: composed\n")
    with pytest.raises(SettingError, match=r"mine.txt' is no channel profile; give one that ends in .yaml"):
        load_profile(str(file), [LIBRARY])
    with pytest.raises(SettingError, match="no channel profile 'xxx"):
        load_profile("x" * 300, [LIBRARY])


def test_a_wrong_file_is_named_with_the_line(tmp_path: Path) -> None:
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
    with pytest.raises(SettingError, match="it is empty"):
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


def test_each_wrong_key_is_told_with_its_own_line_however_deep_it_stands(tmp_path: Path) -> None:
    file = tmp_path / "deep.yaml"
    file.write_text(DEEP)
    told = {
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
        f"{file}:{line}: {told[line]}" for line in told
    }
    with pytest.raises(SettingError) as caught:
        load_profile("\n  " + DEEP.replace("\n", "\n  "), origin="scenario.xosc", line=40)
    assert {diagnostic.line for diagnostic in caught.value.diagnostics} == {40 + line for line in told}


@pytest.mark.parametrize(
    ("rows", "more", "words"),
    [
        (None, "", "cannot read .*measured.csv: No such file"),
        ("", "", "measured.csv is empty"),
        ("delay\n", "", "measured.csv has no delays"),
        ("delay\n0.1\n\n-0.2\n", "", r"measured.csv:4: a delay is negative"),
        ("delay\n0.1\nsoon\n", "", r"measured.csv:3: column 0 holds no delay"),
        ("delay\n0.1\n", "column: late", "has no column 'late' in its first row"),
        ("delay\n0.1\n", "column: 1", "has no column 1; it has 1, from 0 on"),
        ("delay\n0.1\n", "column: -1", "has no column -1; it has 1, from 0 on"),
        ("delay\n0.1\n", "unit: min", "'delay.trace.unit' is 'min'; input should be 's' or 'ms'"),
        ("delay\n0.1\n", "unit: [ms]", r"'delay.trace.unit' is \['ms'\]; input should be 's' or 'ms'"),
        ("delay\n0.1\n", "column: [1]", r"the column is \[1\]; give its name, or its number from 0 on"),
        ("delay\n0.1\n", "column: 0.5", "the column is 0.5; give its name"),
        ("delay\n" + 200_000 * "1" + "\n", "", "cannot read .*measured.csv: field larger than field limit"),
    ],
)
def test_a_measured_trace_that_is_none(tmp_path: Path, rows: str | None, more: str, words: str) -> None:
    if rows is not None:
        (tmp_path / "measured.csv").write_text(rows)
    file = tmp_path / "mine.yaml"
    file.write_text(f"delay:\n  kind: trace\n  file: measured.csv\n  {more}\n")
    with pytest.raises(SettingError, match=words):
        load_profile(file)


def test_a_file_that_is_not_there() -> None:
    with pytest.raises(SettingError, match=r"--channel: no file 'latency_300mss.yaml'; did you mean 'latency_300ms'\?"):
        load_profile("latency_300mss.yaml", [LIBRARY], origin="--channel")
    with pytest.raises(SettingError, match="--channel: the channel has no name"):
        load_profile(" ", [LIBRARY], origin="--channel")
