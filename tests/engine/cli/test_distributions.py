"""`eidrive run` and `eidrive check` on parameter value distributions."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from command_fixtures import Eidrive
from openscenario_xml import deterministic_xml, distribution_xml, single_xml, values_xml


@pytest.fixture
def vary(tmp_path: Path, passing_by: Path) -> Callable[..., Path]:
    """Return a function that writes a distribution of passing_by with OtherY < 9; line 6 has the first distribution."""

    def write(*distributions: str) -> Path:
        text = passing_by.read_text(encoding="utf-8").replace(
            'parameterType="double" value="5.0"/>',
            'parameterType="double" value="5.0"><ConstraintGroup><ValueConstraint rule="lessThan" value="9"/>'
            "</ConstraintGroup></ParameterDeclaration>",
        )
        (tmp_path / "passing_by.xosc").write_text(text, encoding="utf-8")
        body = distributions[0]
        if not body.startswith("<Stochastic"):
            body = deterministic_xml(*distributions)
        path = tmp_path / "distribution.xosc"
        path.write_bytes(distribution_xml(body, scenario="passing_by.xosc"))
        return path

    return write


@pytest.fixture
def six(vary: Callable[..., Path]) -> Path:
    """Write a distribution of six runs: a collision at 0 m, and a constraint violation at 9 m."""
    return vary(values_xml("OtherY", "5", "0", "9"), values_xml("End", "2", "3"))


def test_run_of_distribution_executes_every_run(eidrive: Eidrive, six: Path) -> None:
    result = eidrive("run", six, "--json")
    assert result.exit_code == 1, result.output
    lines = [json.loads(line) for line in result.stdout.splitlines()]
    assert [(line["run"], line["parameters"], line["passed"]) for line in lines] == [
        (0, {"OtherY": "5", "End": "2"}, True),
        (1, {"OtherY": "5", "End": "3"}, True),
        (2, {"OtherY": "0", "End": "2"}, False),
        (3, {"OtherY": "0", "End": "3"}, False),
    ]
    assert {line["scenario"] for line in lines} == {"passing_by"}
    assert f"6 runs in {six}: 2 passed, 2 not passed, 2 excluded by constraints" in result.stderr
    assert (
        f"run 4 (OtherY=9,End=2) is skipped: {six}:6: parameter 'OtherY' is '9', outside its constraints; "
        "expected lessThan 9"
    ) in result.stderr


def test_run_of_distribution_reports_varied_parameters_and_counts(eidrive: Eidrive, six: Path) -> None:
    result = eidrive("run", six, "--param", "OtherY=5")
    assert result.exit_code == 2
    assert f"{six}:6: --param: the distribution varies parameter 'OtherY'; remove the option" in result.stderr
    result = eidrive("run", six, "--max-runs", "1")
    assert result.exit_code == 0
    assert "passing_by  run 0 (OtherY=5,End=2)  seed 1" in result.stdout
    assert f"6 runs in {six}: 1 passed, 5 not selected" in result.stderr
    result = eidrive("run", six, "--max-runs", "1", "--repeat", "2")
    assert f"12 runs in {six}: 2 passed, 10 not selected" in result.stderr


def test_max_runs_selects_runs_over_all_values(eidrive: Eidrive, vary: Callable[..., Path]) -> None:
    one_to_thousand = '<DistributionRange stepWidth="1"><Range lowerLimit="1" upperLimit="1000"/></DistributionRange>'
    path = vary(single_xml("End", one_to_thousand), values_xml("OtherY", "5", "4"))
    result = eidrive("run", path, "--max-runs", "3", "--time-limit", "0.2", "--json")
    lines = [json.loads(line) for line in result.stdout.splitlines()]
    assert len(lines) == 3
    assert len({line["parameters"]["End"] for line in lines}) == 3
    assert "3 not passed, 1997 not selected" in result.stderr


def test_run_of_distribution_writes_files_per_run_and_seed(
    eidrive: Eidrive, vary: Callable[..., Path], tmp_path: Path
) -> None:
    out, path = tmp_path / "out", vary(values_xml("OtherY", "5", "4"))
    eidrive("run", path, "--out", out, "--no-record", "--csv", out / "motion.csv", "--repeat", "2")
    files = sorted(path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file())
    short = [re.sub(r"-[0-9a-f]{10}/", "/", file) for file in files]
    expected = [f"passing_by-none-run{run}-seed{seed}/result.json" for run in (0, 1) for seed in (1, 2)]
    expected += [f"motion-run-{run}-seed-{seed}.csv" for run in (0, 1) for seed in (1, 2)]
    assert short == sorted(expected)
    kept = json.loads((out / files[-1]).read_text(encoding="utf-8"))
    assert (kept["run"], kept["seed"], kept["parameters"]["OtherY"]) == (1, 2, "4")


def test_stochastic_draws_depend_on_random_seed_or_seed_option(eidrive: Eidrive, vary: Callable[..., Path]) -> None:
    drawn = """<Stochastic numberOfTestRuns="2" {}><StochasticDistribution parameterName="OtherY">
    <UniformDistribution><Range lowerLimit="4" upperLimit="6"/></UniformDistribution></StochasticDistribution>
    </Stochastic>"""

    def values_of(path: Path, seed: int) -> list[str]:
        lines = eidrive("run", path, "--json", "--seed", str(seed), "--time-limit", "0.1").stdout.splitlines()
        return [json.loads(line)["parameters"]["OtherY"] for line in lines]

    own = vary(drawn.format('randomSeed="5"'))
    assert values_of(own, 1) == values_of(own, 2)
    without = vary(drawn.format(""))
    assert values_of(without, 1) != values_of(without, 2)


def test_distribution_without_allowed_run_is_invalid_input(eidrive: Eidrive, vary: Callable[..., Path]) -> None:
    result = eidrive("run", vary(values_xml("OtherY", "9", "10")))
    assert result.exit_code == 2
    assert result.stdout == ""
    assert "outside its constraints" in result.stderr.splitlines()[-1]


def test_check_of_distribution_uses_no_default_that_it_varies(
    eidrive: Eidrive, vary: Callable[..., Path], tmp_path: Path
) -> None:
    """The default of OtherY, 10, violates its constraint, as the first value does; no run uses it."""
    path = vary(values_xml("OtherY", "9", "5"))
    scenario = tmp_path / "passing_by.xosc"
    scenario.write_text(scenario.read_text(encoding="utf-8").replace('value="5.0"', 'value="10.0"'), encoding="utf-8")
    result = eidrive("check", path)
    assert result.exit_code == 0, result.output
    assert "'OtherY' is '9', outside its constraints; expected lessThan 9; such runs are skipped" in result.output
    assert "'OtherY' is '10.0'" not in result.output
    vary(values_xml("End", "2"))
    scenario.write_text(scenario.read_text(encoding="utf-8").replace('value="5.0"', 'value="10.0"'), encoding="utf-8")
    assert "'OtherY' is '10.0', outside its constraints" in eidrive("check", path).output


@pytest.mark.parametrize(
    ("texts", "completed", "code"), [(("fast", "5"), 0, 2), (("5", "fast", "4"), 2, 2)], ids=["first", "later"]
)
def test_invalid_value_of_first_run_ends_distribution(
    eidrive: Eidrive, vary: Callable[..., Path], texts: tuple[str], completed: int, code: int
) -> None:
    path = vary(values_xml("OtherY", *texts))
    result = eidrive("run", path, "--json")
    assert result.exit_code == code
    assert len(result.stdout.splitlines()) == completed
    assert f"{path}:6: parameter 'OtherY' is 'fast', which is not a number" in result.stderr


def test_max_runs_of_scenario_is_invalid_input(eidrive: Eidrive, passing_by: Path) -> None:
    result = eidrive("run", passing_by, "--max-runs", "2")
    assert result.exit_code == 2
    assert "--max-runs has no effect for a scenario (got 2); remove the option" in result.stderr


class TestCheck:
    def test_check_of_valid_distribution_reports_number_of_runs(
        self, eidrive: Eidrive, vary: Callable[..., Path]
    ) -> None:
        path = vary(values_xml("OtherY", "5", "4"), values_xml("End", "1", "2", "3"))
        result = eidrive("check", path)
        assert result.exit_code == 0
        assert result.stdout.splitlines() == [f"{path}: 6 runs", "1 file, 0 errors, 0 warnings"]

    def test_check_of_unknown_parameter_reports_error(self, eidrive: Eidrive, vary: Callable[..., Path]) -> None:
        path = vary(values_xml("OtherY", "5"), values_xml("Edn", "1", "2"))
        result = eidrive("check", path)
        assert result.exit_code == 2
        assert f"{path}:7: unknown parameter 'Edn'; did you mean 'End'?" in result.stdout.splitlines()
        assert result.stdout.splitlines()[-1] == "1 file, 1 error, 0 warnings"

    def test_check_validates_every_listed_value(self, eidrive: Eidrive, vary: Callable[..., Path]) -> None:
        path = vary(values_xml("OtherY", "5", "4", "3", "far", "9"), values_xml("End", "1", "late"))
        result = eidrive("check", path)
        assert result.exit_code == 2
        lines = result.stdout.splitlines()
        assert f"{path}:6: parameter 'OtherY' is 'far', which is not a number; write it as 12.5 or 1e-3" in lines
        assert f"{path}:7: parameter 'End' is 'late', which is not a number; write it as 12.5 or 1e-3" in lines
        assert (
            f"{path}:6: parameter 'OtherY' is '9', outside its constraints; expected lessThan 9; "
            "such runs are skipped (warning)"
        ) in lines
        assert lines[-1] == "1 file, 2 errors, 1 warning"

    def test_check_reports_diagnostics_of_single_runs(self, eidrive: Eidrive, vary: Callable[..., Path]) -> None:
        """The time is never below 0 s, and at first below an End of 1 s."""
        path = vary(values_xml("OtherY", "5", "4"), values_xml("End", "1", "0"))
        scenario = path.with_name("passing_by.xosc")
        text = scenario.read_text(encoding="utf-8")
        late = text.replace('value="$End" rule="greaterOrEqual"', 'value="$End" rule="lessThan"')
        assert late != text
        scenario.write_text(late, encoding="utf-8")
        result = eidrive("check", path)
        lines = [line for line in result.stdout.splitlines() if "impossible-condition" in line]
        assert len(lines) == 1
        assert "in run 1: simulation time < 0 s is never true" in lines[0]
        assert result.exit_code == 0
        assert "impossible-condition" not in eidrive("check", path, "--ignore", "impossible-condition").stdout

    def test_check_reports_error_of_scenario_once(self, eidrive: Eidrive, vary: Callable[..., Path]) -> None:
        path = vary(values_xml("OtherY", "5"))
        scenario = path.with_name("passing_by.xosc")
        text = scenario.read_text(encoding="utf-8").replace('dynamicsShape="step"', 'dynamicsShape="stp"')
        scenario.write_text(text, encoding="utf-8")
        result = eidrive("check", path.parent)
        assert result.exit_code == 2
        assert result.stdout.count("did you mean 'step'?") == 1
        assert result.stdout.splitlines()[-1] == "2 files, 1 error, 0 warnings"

    def test_check_validates_stochastic_draws(self, eidrive: Eidrive, vary: Callable[..., Path]) -> None:
        path = vary(
            '<Stochastic numberOfTestRuns="9"><StochasticDistribution parameterName="OtherY"><NormalDistribution '
            'expectedValue="20" variance="1"/></StochasticDistribution></Stochastic>'
        )
        result = eidrive("check", path)
        assert result.exit_code == 0
        assert result.stdout.count("such runs are skipped (warning)") == 9
