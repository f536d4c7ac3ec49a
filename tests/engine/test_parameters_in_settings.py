"""Parameters of a scenario in channels, criteria, variations and controller properties."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from openscenario_xml import catalog_xml, deterministic_xml, distribution_xml, parameters_xml, single_xml
from typer.testing import CliRunner

from eidrive_scenario.cli import app
from eidrive_scenario.errors import InputError
from eidrive_scenario.extensions.library import resolve_scenario
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.simulation import RunResult, RunSettings, Simulation, load_for_seed, run_file

LINK = ("RSU", "Ego")
Make = Callable[..., Path]
DECLARED = {
    "Latency": ("double", "0.1"),
    "Loss": ("double", "0"),
    "Gap": ("double", "1"),
    "Profile": ("string", "ideal"),
    "Own": ("boolean", "false"),
}


@pytest.fixture
def make(tmp_path: Path) -> Make:
    """Scenario 1 with parameters for its channel, and any texts replaced."""

    def write(channel: str, *edits: tuple[str, str]) -> Path:
        source = resolve_scenario("coop/scenario_1")
        text = source.read_text().replace('"../', f'"{source.parent.parent}/')
        declared = "".join(
            f'<ParameterDeclaration name="{name}" parameterType="{kind}" value="{value}"/>'
            for name, (kind, value) in DECLARED.items()
        )
        for old, new in (
            ("<ParameterDeclarations>", f"<ParameterDeclarations>{declared}"),
            ('"eidrive.channel">ideal<', f'"eidrive.channel">{channel}<'),
            *edits,
        ):
            assert old in text
            text = text.replace(old, new, 1)
        path = tmp_path / "varied.xosc"
        path.write_text(text)
        return path

    return write


def delays(path: Path, **parameters: str) -> RunResult:
    return run_file(path, settings=RunSettings(parameters=parameters, time_limit=3.0))


DELAY = "{delay: {kind: constant, seconds: $Latency}, loss: {kind: bernoulli, probability: ${$Loss / 100}}}"


@pytest.mark.parametrize("latency", ["0.1", "0.25"])
def test_parameter_sets_the_delay_of_every_message(make: Make, latency: str) -> None:
    result = delays(make(DELAY), Latency=latency)
    assert result.links[LINK].mean_delay == pytest.approx(float(latency))
    assert result.parameters["Latency"] == latency


def test_delay_with_seconds_alone_is_constant(make: Make) -> None:
    result = delays(make("{delay: {seconds: $Latency}}"), Latency="0.2")
    assert result.links[LINK].mean_delay == pytest.approx(0.2)


def test_expression_sets_the_loss(make: Make) -> None:
    path = make(DELAY)
    assert delays(path, Loss="100").links[LINK].received == 0
    assert delays(path, Loss="0").links[LINK].lost == 0


def test_distribution_varies_delay_and_results_tell_runs_apart(make: Make, tmp_path: Path) -> None:
    distribution = tmp_path / "latencies.xosc"
    make(DELAY)
    steps = '<DistributionRange stepWidth="0.2"><Range lowerLimit="0.0" upperLimit="0.4"/></DistributionRange>'
    distribution.write_bytes(distribution_xml(deterministic_xml(single_xml("Latency", steps)), scenario="varied.xosc"))
    printed = CliRunner().invoke(app, ["run", str(distribution), "--json", "--time-limit", "3"]).stdout
    runs = [json.loads(line) for line in printed.splitlines()]
    assert [float(run["parameters"]["Latency"]) for run in runs] == pytest.approx([0.0, 0.2, 0.4])
    links = [next(link for link in run["links"] if (link["sender"], link["receiver"]) == LINK) for run in runs]
    # Nothing arrives in the tick in which it was sent, but the statistics state the delay of the channel itself.
    assert [link["mean_delay"] for link in links] == pytest.approx([0.0, 0.2, 0.4])


def test_boolean_parameter_sets_whether_the_channel_carries_own_perception(make: Make) -> None:
    path = make("{own_perception: $Own}")
    assert ("Ego", "Ego") not in delays(path).links
    assert ("Ego", "Ego") in delays(path, Own="true").links


def test_text_parameter_names_a_criterion(make: Make) -> None:
    path = make("none", ("collision: {of: Ego}", "collision: {of: Ego, name: $Profile}"))
    assert "crash {of: x}" in [verdict.name for verdict in delays(path, Profile="crash {of: x}").criteria]


def test_controller_of_a_catalog_uses_its_own_parameters(make: Make, tmp_path: Path) -> None:
    controller = (
        f'<Controller name="stack">{parameters_xml(West=("double", "1"))}<Properties>'
        '<Property name="module" value="eidrive"/><Property name="planner" value="conflict_area"/>'
        '<Property name="conflict_area" value="[$West, 32.0, ${$West / 10}, 10.5]"/></Properties></Controller>'
    )
    (tmp_path / "stacks.xosc").write_bytes(catalog_xml("stacks", controller))
    text = make("ideal").read_text()
    start, end = text.index("<ObjectController>"), text.index("</ObjectController>")
    path = make(
        "ideal",
        (
            text[start:end],
            '<ObjectController><CatalogReference catalogName="stacks" entryName="stack"><ParameterAssignments>'
            '<ParameterAssignment parameterRef="West" value="$Gap"/></ParameterAssignments></CatalogReference>',
        ),
        ("<MiscObjectCatalog>", '<ControllerCatalog><Directory path="."/></ControllerCatalog><MiscObjectCatalog>'),
    )
    with Simulation(path, settings=RunSettings(parameters={"Gap": "28"})) as simulation:
        area = simulation.resolved.stations["Ego"]["planner_settings"]["conflict_area"]
    assert area[0][0] == [28.0, 2.8]
    (tmp_path / "stacks.xosc").write_bytes(catalog_xml("stacks", controller.replace("${$West", "${$Wst")))
    with pytest.raises(InputError) as caught:
        run_file(path)
    (diagnostic,) = caught.value.diagnostics
    assert str(diagnostic).endswith(
        "stacks.xosc:3: setting 'conflict_area.2': unknown parameter $Wst; did you mean 'West'?"
    )


def test_whole_channel_is_a_parameter(make: Make) -> None:
    path = make("$Profile")
    assert delays(path).channel == "ideal"
    assert delays(path, Profile="latency_300ms").channel == "latency_300ms"
    assert delays(path, Profile="none").channel == "none"
    with pytest.raises(InputError, match=r"varied.xosc:\d+: no channel profile '\{delay"):
        delays(path, Profile="{delay: {kind: constant, seconds: 0.3}}")


def test_channel_file_refers_to_parameters_of_the_scenario(make: Make, tmp_path: Path) -> None:
    profile = tmp_path / "mine.yaml"
    profile.write_text("model: composed\ndelay:\n  kind: constant\n  seconds: ${$Latency + 0.05}\n")
    settings = RunSettings(channel=profile, time_limit=2.0, parameters={"Latency": "0.15"})
    assert run_file(make("ideal"), settings=settings).links[LINK].mean_delay == pytest.approx(0.2)
    profile.write_text("model: composed\ndelay:\n  kind: constant\n  seconds: $Latncy\n")
    with pytest.raises(InputError, match=r"mine.yaml:4: setting 'delay.seconds': unknown parameter \$Latncy; did you"):
        run_file(make("ideal"), settings=settings)


def test_channel_file_that_the_scenario_names_refers_to_its_parameters(
    make: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file is beside the scenario, the run starts elsewhere, where a file of that name is another one."""
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "mine.yaml").write_text("model: composed\n")
    monkeypatch.chdir(elsewhere)
    profile = tmp_path / "mine.yaml"
    profile.write_text("model: composed\ndelay:\n  kind: constant\n  seconds: ${$Latency + 0.05}\n")
    path = make("mine.yaml")
    assert delays(path).links[LINK].mean_delay == pytest.approx(0.15)
    varied = delays(path, Latency="0.25")
    assert varied.links[LINK].mean_delay == pytest.approx(0.3)
    assert varied.settings.channel_profile is not None
    assert varied.settings.channel_profile["delay"]["seconds"] == pytest.approx(0.3)
    assert CliRunner().invoke(app, ["check", str(path)]).exit_code == 0
    profile.write_text("model: composed\ndelay:\n  kind: constant\n  seconds: $Latncy\n")
    with pytest.raises(InputError, match=r"mine.yaml:4: setting 'delay.seconds': unknown parameter \$Latncy; did you"):
        delays(path)


def test_text_parameter_cannot_add_settings(make: Make) -> None:
    path = make("{delay: {kind: constant, seconds: $Profile}}")
    forged = "0.1}, loss: {kind: bernoulli, probability: 1.0"
    with pytest.raises(InputError, match=r"setting 'delay.constant.seconds' is '0.1}, loss"):
        delays(path, Profile=forged)


def test_criterion_takes_parameters(make: Make) -> None:
    path = make("none", ("at_least: 3.5, measure: center", "at_least: ${$Gap * 10}, measure: center"))
    limits = [
        verdict.limit
        for gap in ("1", "2")
        for verdict in delays(path, Gap=gap).criteria
        if verdict.name == "min_distance"
    ]
    assert limits == [10.0, 20.0]


def test_undeclared_parameter_is_reported_by_check_with_its_line(make: Make) -> None:
    path = make("{delay: {kind: constant,\n seconds: $Latncy}}", ("at_least: 3.5", "at_least: $Gab"))
    lines = path.read_text().splitlines()
    delay = next(number for number, line in enumerate(lines, 1) if "$Latncy" in line)
    gap = next(number for number, line in enumerate(lines, 1) if "$Gab" in line)
    printed = CliRunner().invoke(app, ["check", str(path)]).stdout
    assert f"{path}:{delay}: setting 'delay.seconds': unknown parameter $Latncy; did you mean 'Latency'?" in printed
    assert (
        f"{path}:{gap}: criterion 'min_distance': setting 'at_least': unknown parameter $Gab; did you mean 'Gap'?"
        in printed
    )


def test_variation_takes_bounds_from_parameters_that_are_not_drawn(make: Make) -> None:
    fixed = make("ideal", ("EgoOffset: {uniform: [-0.15, 0.15]}", "EgoOffset: {uniform: [$Gap, ${$Gap + 1}]}"))
    drawn = float(load_for_seed(fixed, 3, {"Gap": "5"}).parameters["EgoOffset"])
    assert 5.0 <= drawn <= 6.0
    drawn_from_drawn = make("ideal", ("uniform: [-0.15, 0.15]", "uniform: [-1, $IncomingOffset]"))
    with pytest.raises(InputError, match=r"unknown parameter \$IncomingOffset"):
        load_for_seed(drawn_from_drawn, 3)


def test_controller_property_refers_inside_its_yaml(make: Make) -> None:
    area = ('value="[29.0, 32.0, 4.5, 10.5]"', 'value="[$Gap, 32.0, ${$Gap * 4.5}, 10.5]"')
    latency = (
        '<Property name="conflict_area"',
        '<Property name="detector_latency" value="$Latency"/><Property name="conflict_area"',
    )
    path = make("ideal", area, latency)
    for gap in (1.0, 2.0):
        scenario = load_scenario(path, {"Gap": str(gap)})
        with Simulation(scenario, settings=RunSettings(parameters={"Latency": "0.3"})) as simulation:
            settings = simulation.resolved.stations["Ego"]
        assert settings["planner_settings"]["conflict_area"][0][0] == [gap, 4.5 * gap]
        assert settings["detector_latency"] == 0.3
    wrong = make("ideal", (area[0], 'value="[$Gab, 32.0, 4.5, 10.5]"'))
    with pytest.raises(InputError, match=r"setting 'conflict_area.0': unknown parameter \$Gab; did you mean 'Gap'"):
        run_file(wrong)


def test_command_of_a_later_event_takes_parameters(make: Make) -> None:
    path = make(
        "ideal",
        (
            "</ManeuverGroup>",
            '<Maneuver name="Jam"><Event name="Jam" priority="parallel"><Action name="Jam"><UserDefinedAction>'
            f'<CustomCommandAction type="eidrive.channel">{DELAY}</CustomCommandAction></UserDefinedAction></Action>'
            '<StartTrigger><ConditionGroup><Condition name="c" delay="0" conditionEdge="none"><ByValueCondition>'
            '<SimulationTimeCondition value="1.0" rule="greaterThan"/></ByValueCondition></Condition></ConditionGroup>'
            "</StartTrigger></Event></Maneuver></ManeuverGroup>",
        ),
    )
    result = delays(path, Latency="0.5")
    mean = result.links[LINK].mean_delay
    assert mean is not None
    assert 0.1 < mean < 0.5


@pytest.mark.parametrize(
    ("parameters", "message", "hint"),
    [
        (
            {"Loss": "3000"},
            "'loss.bernoulli.probability' is 30",
            "parameter 'Loss' is '3000' instead of its declared 0",
        ),
        (
            {"Latency": "-1"},
            "'delay.constant.seconds' is -1",
            "parameter 'Latency' is '-1' instead of its declared 0.1",
        ),
        ({"Gap": "-2"}, "'at_least' is -2", "parameter 'Gap' is '-2' instead of its declared 1"),
        ({"Own": "maybe"}, "parameter 'Own' is 'maybe'", "assigned by an option, the file declares 'false'"),
    ],
)
def test_error_of_a_value_names_its_parameter(
    make: Make, tmp_path: Path, parameters: dict[str, str], message: str, hint: str
) -> None:
    """The file of the channel and the criterion are right: the value of the option is not."""
    (tmp_path / "late.yaml").write_text("delay: {kind: constant, seconds: $Latency}\n" + DELAY.split(", ", 2)[2][:-1])
    criterion = "min_distance: {of: Ego, to: Incoming, at_least: $Gap}"
    path = make("late.yaml", ("collision: {of: Ego}", f"{criterion}\ncollision: {{of: Ego}}"))
    with pytest.raises(InputError) as caught:
        delays(path, **parameters)
    (diagnostic,) = caught.value.diagnostics
    assert message in diagnostic.message
    assert hint in diagnostic.hint


def test_error_of_a_key_names_no_parameter(make: Make) -> None:
    with pytest.raises(InputError) as caught:
        delays(make("{delay: {kind: constant, secnds: $Latency}}"))
    assert not any("Latency" in diagnostic.hint for diagnostic in caught.value.diagnostics)
