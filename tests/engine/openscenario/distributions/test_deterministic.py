"""Deterministic distributions: sets, ranges, value sets and their combinations."""

import tracemalloc
from collections.abc import Callable
from itertools import islice
from pathlib import Path

import pytest
from lxml import etree
from openscenario_xml import deterministic_xml, scenario_xml, single_xml, values_xml

from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.openscenario import load_distribution, load_scenario

Write = Callable[..., Path]


def steps(name: str, lower: str, upper: str, step: str) -> str:
    limits = f'<Range lowerLimit="{lower}" upperLimit="{upper}"/>'
    return single_xml(name, f'<DistributionRange stepWidth="{step}">{limits}</DistributionRange>')


def sets(*choices: dict[str, str]) -> str:
    one = '<ParameterAssignment parameterRef="{}" value="{}"/>'
    inside = "".join(
        "<ParameterValueSet>" + "".join(one.format(*pair) for pair in choice.items()) + "</ParameterValueSet>"
        for choice in choices
    )
    return (
        "<DeterministicMultiParameterDistribution><ValueSetDistribution>"
        f"{inside}</ValueSetDistribution></DeterministicMultiParameterDistribution>"
    )


def texts(path: Path) -> list[str]:
    return [run.parameters["P"] for run in load_distribution(path)]


@pytest.mark.element("DistributionSet", "ValueSetDistribution")
def test_combinations_have_the_order_of_the_file(distribution_file: Write, tmp_path: Path) -> None:
    body = deterministic_xml(
        values_xml("A", "1", "2"), sets({"B": "x", "C": "u"}, {"B": "y", "C": "v"}), values_xml("D", "on")
    )
    runs = load_distribution(distribution_file(body))
    assert len(runs) == 4
    assert [list(run.parameters.items()) for run in runs] == [
        [("A", "1"), ("B", "x"), ("C", "u"), ("D", "on")],
        [("A", "1"), ("B", "y"), ("C", "v"), ("D", "on")],
        [("A", "2"), ("B", "x"), ("C", "u"), ("D", "on")],
        [("A", "2"), ("B", "y"), ("C", "v"), ("D", "on")],
    ]
    assert {run.scenario for run in runs} == {tmp_path / "scenario.xosc"}
    assert [run.number for run in runs] == [0, 1, 2, 3]
    assert runs[-1] == runs[3]
    assert runs[1:3] == (runs[1], runs[2])
    assert str(runs[2]) == "A=2,B=x,C=u,D=on"
    with pytest.raises(IndexError):
        runs[4]


def test_combinations_in_a_file_of_one_line_have_its_order(distribution_file: Write) -> None:
    """Tools write files without line breaks, so that all elements have the same line."""
    path = distribution_file(deterministic_xml(values_xml("A", "1", "2"), sets({"B": "x"}, {"B": "y"})))
    path.write_text(path.read_text().replace("\n", ""))
    assert [str(run) for run in load_distribution(path)] == ["A=1,B=x", "A=1,B=y", "A=2,B=x", "A=2,B=y"]


def test_parameter_name_may_begin_with_a_dollar_sign(distribution_file: Write) -> None:
    """Files of scenariogeneration declare and vary `$P`, as a parameter was named in version 0.9."""
    assert texts(distribution_file(deterministic_xml(values_xml("$P", "1", "2")))) == ["1", "2"]


def test_values_have_lines(distribution_file: Write) -> None:
    path = distribution_file(deterministic_xml(values_xml("A", "1"), steps("B", "0", "1", "1"), sets({"C": "x"})))
    origins = {name: given.origin for name, given in load_distribution(path)[0].assignments.items()}
    assert origins == {"A": (str(path), 6), "B": (str(path), 7), "C": (str(path), 8)}


def test_tree_without_lines_is_expanded_in_its_order(distribution_file: Write) -> None:
    """Elements that a program creates have no lines."""
    body = deterministic_xml(values_xml("A", "1", "2"), sets({"C": "x"}, {"C": "y"}))
    tree = etree.parse(distribution_file(body))
    for node in tree.iter("*"):
        node.sourceline = 0
    found = [tuple(run.parameters.items()) for run in load_distribution(tree)]
    assert found == [(("A", a), ("C", c)) for a in "12" for c in "xy"]


@pytest.mark.element("DistributionRange")
@pytest.mark.parametrize(
    ("lower", "upper", "step", "expected"),
    [
        ("5.0", "20.0", "5.0", ["5", "10", "15", "20"]),
        # The standard: a value is added until it is greater than the upper limit.
        ("-1.75", "1.75", "1.5", ["-1.75", "-0.25", "1.25"]),
        # As binary fractions, 0.1 + 0.1 + 0.1 is above 0.3, and 1.1 + 0.2 + 0.2 above 1.5.
        ("0", "0.3", "0.1", ["0", "0.1", "0.2", "0.3"]),
        ("1.1", "1.5", "0.2", ["1.1", "1.3", "1.5"]),
        ("2", "2", "1", ["2"]),
        ("0", "1", "1e3", ["0"]),
        ("1e-7", "3e-7", "1e-7", ["1e-07", "2e-07", "3e-07"]),
    ],
)
def test_range_has_exact_decimal_steps(
    distribution_file: Write, lower: str, upper: str, step: str, expected: list[str]
) -> None:
    assert texts(distribution_file(deterministic_xml(steps("P", lower, upper, step)))) == expected


def test_empty_deterministic_is_one_run_without_assignments(distribution_file: Write) -> None:
    runs = load_distribution(distribution_file("<Deterministic/>"))
    assert [run.parameters for run in runs] == [{}]


def test_expansion_creates_runs_on_access(distribution_file: Write) -> None:
    """For 10⁹ runs the count and any run are available immediately, and an iteration needs constant memory."""
    body = deterministic_xml(*(steps(name, "1", "1000", "1") for name in "ABC"))
    runs = load_distribution(distribution_file(body))
    assert len(runs) == 10**9
    assert runs[123_456_789].parameters == {"A": "124", "B": "457", "C": "790"}
    tracemalloc.start()
    walked = sum(1 for _ in islice(runs, 1000))
    early = tracemalloc.get_traced_memory()[1]
    tracemalloc.reset_peak()
    walked += sum(1 for _ in islice(runs, 10_000))
    late = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert walked == 11_000
    assert late < early + 20_000


def test_spread_covers_all_values(distribution_file: Write) -> None:
    sizes = {"A": 5, "B": 4, "C": 7, "D": 6}
    runs = load_distribution(
        distribution_file(deterministic_xml(*(steps(n, "1", str(m), "1") for n, m in sizes.items())))
    )
    assert len(runs) == 840
    for name, size in sizes.items():
        taken = [runs[number].parameters[name] for number in runs.spread(2 * size)]
        assert len(taken) == 2 * size
        often = {value: taken.count(value) for value in taken}
        assert max(often.values()) <= 4, "twice each on average"
        assert len(often) >= size - 1
    assert set(runs.spread(10)) < set(runs.spread(50))
    assert runs.spread(50) == sorted(runs.spread(50))
    assert list(runs.spread(839)) != list(range(839))
    assert list(runs.spread(840)) == list(runs.spread(10**6)) == list(range(840))
    assert sorted(islice(runs.draws(), 50)) == runs.spread(50)
    assert runs.spread(0) == runs.spread(-1) == []
    assert sorted(runs.draws()) == list(range(840)), "each run once"


@pytest.mark.element("UserDefinedDistribution")
@pytest.mark.parametrize(
    ("distributions", "line", "message"),
    [
        ([steps("P", "2", "1", "1")], 6, "the range from 2 to 1 is empty; lowerLimit must be at most upperLimit"),
        ([steps("P", "NaN", "1", "1")], 6, "the range from nan to 1 is empty"),
        ([steps("P", "0", "INF", "1")], 6, "the range from 0 to inf is infinite; specify finite limits"),
        ([steps("P", "0", "1", "0")], 6, "stepWidth is 0; specify a number above zero"),
        ([steps("P", "0", "1", "-1")], 6, "stepWidth is -1; specify a number above zero"),
        (
            [values_xml("P", "1"), sets({"P": "2"})],
            7,
            "parameter 'P' is also varied by another distribution; see line 6",
        ),
        ([sets({"P": "$Other"})], 6, "value of ParameterAssignment: unknown parameter $Other"),
        ([steps("A", "0", "1", "1e-9"), steps("B", "0", "1", "1e-9"), steps("C", "0", "1", "1e-9")], 5, "1.0e+27 runs"),
        (
            [single_xml("P", '<UserDefinedDistribution type="mine">x</UserDefinedDistribution>')],
            6,
            "UserDefinedDistribution of 'P' is specific to another tool; write DistributionSet or DistributionRange",
        ),
    ],
)
def test_invalid_distribution_error_has_line(
    distribution_file: Write, distributions: list[str], line: int, message: str
) -> None:
    path = distribution_file(deterministic_xml(*distributions))
    with pytest.raises(ScenarioError) as caught:
        load_distribution(path)
    assert [(diagnostic.source, diagnostic.line) for diagnostic in caught.value.diagnostics] == [(str(path), line)]
    assert message in str(caught.value)


def test_duplicate_assignment_in_set_is_an_error(distribution_file: Write) -> None:
    body = deterministic_xml(sets({"P": "1"})).replace(
        "</ParameterValueSet>", '<ParameterAssignment parameterRef="P" value="2"/></ParameterValueSet>'
    )
    with pytest.raises(ScenarioError, match=r":6: ParameterValueSet assigns 'P' twice; remove one"):
        load_distribution(distribution_file(body))


def test_missing_scenario_file_is_an_error(distribution_file: Write) -> None:
    path = distribution_file(deterministic_xml())
    path.write_text(path.read_text(encoding="utf-8").replace("scenario.xosc", "scenaro.xosc"), encoding="utf-8")
    with pytest.raises(
        ScenarioError, match=r":4: ScenarioFile: scenario 'scenaro\.xosc' does not exist; did you mean 'scenario'\?"
    ):
        load_distribution(path)


def test_scenario_and_distribution_are_distinguished(distribution_file: Write) -> None:
    with pytest.raises(ScenarioError, match="the file is a scenario, not a parameter value distribution"):
        load_distribution(bytes(scenario_xml()))
    with pytest.raises(ScenarioError, match="the file is a parameter value distribution, not a scenario"):
        load_scenario(distribution_file(deterministic_xml()))


def test_distributions_require_version_1_1(distribution_file: Write) -> None:
    with pytest.raises(ScenarioError, match=r"part of OpenSCENARIO since 1\.1; the version of the file is 1\.0"):
        load_distribution(distribution_file(deterministic_xml(), minor=0))
    assert len(load_distribution(distribution_file(deterministic_xml(), minor=1))) == 1
