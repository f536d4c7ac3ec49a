"""Marker `scenario` and fixture `run_scenario`."""

from __future__ import annotations

import shutil
from pathlib import Path
from xml.etree import ElementTree

import pytest
from openscenario_xml import catalog_xml

pytest_plugins = ["pytester"]

PASSING_BY = Path(__file__).parents[2] / "data" / "passing_by.xosc"


@pytest.fixture
def project(pytester: pytest.Pytester) -> pytest.Pytester:
    folder = pytester.mkdir("drives")
    for name in ("first", "second"):
        shutil.copy(PASSING_BY, folder / f"{name}.xosc")
    (folder / "cars.xosc").write_bytes(catalog_xml("cars", ""))
    return pytester


def run(pytester: pytest.Pytester, text: str, *arguments: str) -> pytest.RunResult:
    pytester.makepyfile(test_own="import pytest\n" + text)
    return pytester.runpytest_inprocess("test_own.py", "-v", "--strict-markers", "-p", "no:cacheprovider", *arguments)


def test_marker_runs_every_scenario_channel_and_seed(project: pytest.Pytester) -> None:
    text = """
@pytest.mark.scenario("drives/*.xosc", channel=["ideal", "none"], seeds=2)
def test_far(run_scenario):
    result = run_scenario()
    assert result.passed
    assert result.metrics["min_distance.Ego.Parked.center"] == pytest.approx(5.0)
"""
    result = run(project, text, "--junitxml", "junit.xml")
    result.assert_outcomes(passed=8)
    result.stdout.fnmatch_lines(
        ["*test_far?drives/first-channel=ideal-seed=1? PASSED*", "*test_far?drives/second-channel=none-seed=2? PASSED*"]
    )
    case = next(iter(ElementTree.parse(project.path / "junit.xml").iter("testcase")))
    assert "min_distance.value" in {entry.get("name") for entry in case.iter("property")}


def test_command_line_overrides_marker(project: pytest.Pytester) -> None:
    text = """
@pytest.mark.scenario("drives/first", channel="ideal", seeds=5)
def test_far(run_scenario):
    assert run_scenario().channel == "none"
"""
    run(project, text, "--eidrive-channel", "none", "--eidrive-seeds", "1").assert_outcomes(passed=1)


def test_run_scenario_arguments_select_run(project: pytest.Pytester) -> None:
    text = """
def test_any(run_scenario):
    near = run_scenario("drives/first.xosc", seed=3, parameters={"OtherY": "0"})
    assert not near.passed
    assert near.seed == 3
    assert run_scenario("drives/second.xosc").passed
"""
    run(project, text).assert_outcomes(passed=1)


def test_options_apply_to_tests_without_marker(project: pytest.Pytester) -> None:
    """Channels and seeds repeat the test, arguments of the call replace them, and criteria are added."""
    text = """
def test_any(run_scenario, request):
    result = run_scenario("drives/first.xosc", criteria={"max_speed": {"of": "Ego"}})
    assert f"[channel={result.channel}-seed={result.seed}]" in request.node.name
    assert {"max_speed", "own"} < {verdict.name for verdict in result.criteria}
    assert run_scenario("drives/first.xosc", channel="none", seed=7).channel == "none"
"""
    criterion = ("--eidrive-criterion", "{min_speed: {of: Ego, name: own}}")
    result = run(project, text, "--eidrive-channel", "ideal,latency_300ms", "--eidrive-seeds", "2", *criterion)
    result.assert_outcomes(passed=4)
    run(
        project, text, "-k", "seed:2", "--eidrive-seeds", "2", "--eidrive-channel", "ideal", *criterion
    ).assert_outcomes(passed=1, deselected=1)


def test_run_scenario_of_invalid_input_fails_without_traceback(project: pytest.Pytester) -> None:
    text = """
def test_wrong(run_scenario):
    run_scenario("drives/first.xosc", parameters={"OthreY": "0"})
def test_missing(run_scenario):
    run_scenario("drives/thrid.xosc")
"""
    result = run(project, text)
    result.assert_outcomes(failed=2)
    result.stdout.fnmatch_lines(["*did you mean 'OtherY'?*", "*no scenario 'drives/thrid.xosc'*"])
    result.stdout.no_fnmatch_line("*Traceback*")


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("marker", "message"),
    [('"none/*.xosc"', "no scenario matches 'none/*.xosc'"), ("", "marker scenario: no pattern")],
)
def test_marker_without_match_is_an_error(project: pytest.Pytester, marker: str, message: str) -> None:
    result = run(project, f"@pytest.mark.scenario({marker})\ndef test_none(run_scenario):\n    pass")
    assert result.ret != 0
    assert message in str(result.stdout) + str(result.stderr)


def test_marker_with_distribution_names_its_kind(project: pytest.Pytester) -> None:
    """Its runs are tests as those of a file; a marker names scenarios."""
    (project.path / "d.xosc").write_text("<OpenSCENARIO><FileHeader/><ParameterValueDistribution/></OpenSCENARIO>")
    result = run(project, '@pytest.mark.scenario("d")\ndef test_none(run_scenario):\n    pass')
    assert result.ret != 0
    text = str(result.stdout)
    assert "'d' matches" in text
    assert "got a parameter value distribution, whose runs are tests by `pytest FILE`; expected a scenario" in text


def test_marker_with_unknown_argument_shows_no_traceback(project: pytest.Pytester) -> None:
    text = """
@pytest.mark.scenario("drives/first", chanel="ideal")
def test_far(run_scenario):
    run_scenario()
"""
    result = run(project, text)
    result.assert_outcomes(errors=1)
    result.stdout.no_fnmatch_line("*fixture.py*")
    result.stdout.no_fnmatch_line("*During handling*")


def test_run_scenario_with_unknown_setting_fails(project: pytest.Pytester) -> None:
    text = """
def test_far(run_scenario):
    run_scenario("drives/first.xosc", time_limmit=3.0)
def test_channel(run_scenario):
    run_scenario("drives/first.xosc", channel="idael")
"""
    result = run(project, text)
    result.assert_outcomes(failed=2)
    result.stdout.fnmatch_lines(["run_scenario: unknown setting 'time_limmit'; did you mean 'time_limit'?"])
    result.stdout.fnmatch_lines(["*no channel profile 'idael'; did you mean 'ideal'?"])
    result.stdout.no_fnmatch_line("*Error*")
    result.stdout.no_fnmatch_line("*During handling*")


def test_run_scenario_without_scenario_fails(project: pytest.Pytester) -> None:
    result = run(project, "def test_none(run_scenario):\n    run_scenario()")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*run_scenario: no scenario*"])


def test_run_scenario_accepts_scenario_objects(project: pytest.Pytester) -> None:
    text = """
from xml.etree import ElementTree

class Written:
    def get_element(self):
        return ElementTree.parse("drives/first.xosc").getroot()

def test_object(run_scenario):
    assert run_scenario(Written()).trace_hash == run_scenario("drives/first.xosc").trace_hash

def test_wrong(run_scenario):
    run_scenario(ElementTree.Element("OpenSCENARIO"))
"""
    result = run(project, text, "--eidrive-out", "kept")
    result.assert_outcomes(passed=1, failed=1)
    result.stdout.fnmatch_lines(["<Element>:2: OpenSCENARIO lacks the element FileHeader*"])
    result.stdout.no_fnmatch_line("Traceback*")
    kept = {path.parents[1].relative_to(project.path).as_posix() for path in project.path.glob("kept/**/result.json")}
    assert kept == {"kept/test_own/test_object", "kept/drives/first"}


@pytest.mark.exhaustive
def test_marked_test_without_fixture_is_an_error(project: pytest.Pytester) -> None:
    alone = "@pytest.mark.scenario('drives/first.xosc')\ndef test_alone(): pass"
    result = run(project, alone)
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["*::test_alone: a test with the marker scenario requires the fixture *"])
    whole = "pytestmark = pytest.mark.scenario('drives/first.xosc')\ndef test_beside_others(): pass"
    run(project, whole).assert_outcomes(passed=1)


@pytest.mark.exhaustive
def test_second_marker_of_test_is_an_error(project: pytest.Pytester) -> None:
    """pytest would use the closest marker only, so the scenarios of the other one would be ignored silently."""
    text = """
@pytest.mark.scenario("drives/first.xosc")
@pytest.mark.scenario("drives/second.xosc")
def test_both(run_scenario):
    run_scenario()
"""
    result = run(project, text)
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["*several markers scenario*"])


def test_message_names_option_ini_option_or_keyword_of_the_setting(project: pytest.Pytester) -> None:
    project.makeini("[pytest]\neidrive_planner = route\n")
    text = """
@pytest.mark.scenario("drives/first", drive="Egon")
def test_marker(run_scenario):
    run_scenario()
@pytest.mark.scenario("drives/first", channel="idael")
def test_channel_of_marker(run_scenario):
    run_scenario()
def test_ini(run_scenario):
    run_scenario("drives/first.xosc", drive={"Ego": "{planner: none}"})
def test_keyword(run_scenario):
    run_scenario("coop/scenario_1", weather="sunni", channel="latency")
def test_warning(run_scenario):
    channel = "{delay: {kind: constant, seconds: 0.01}}"
    warnings = run_scenario("coop/scenario_1", channel=channel, time_limit=0.1).warnings
    assert any(text.startswith("channel: most") and "(RunSettings.dt)" in text for text in warnings), warnings
"""
    result = run(project, text)
    result.assert_outcomes(failed=4, passed=1)
    result.stdout.fnmatch_lines(
        [
            "drive: the scenario has no entity 'Egon'*",
            "channel: no channel profile 'idael'*",
            "ini option eidrive_planner: planner 'route' has no effect*give a vehicle a stack by drive",
            "channel: no channel profile 'latency'*",
            "weather: no weather preset 'sunni'*",
        ]
    )
