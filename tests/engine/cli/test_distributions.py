"""`eidrive run` and `eidrive check` on parameter value distributions."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import Result

Eidrive = Callable[..., Result]

DISTRIBUTION = """<OpenSCENARIO>
<FileHeader revMajor="1" revMinor="3" date="2026-01-31T12:00:00" description="a test" author="nobody"/>
<ParameterValueDistribution>
<ScenarioFile filepath="passing_by.xosc"/>
{}
</ParameterValueDistribution>
</OpenSCENARIO>"""
SINGLE = '<DeterministicSingleParameterDistribution parameterName="{}">{}</DeterministicSingleParameterDistribution>'


def values(name: str, *texts: str) -> str:
    elements = "".join(f'<Element value="{text}"/>' for text in texts)
    return SINGLE.format(name, f"<DistributionSet>{elements}</DistributionSet>")


@pytest.fixture
def vary(tmp_path: Path, passing_by: Path) -> Callable[..., Path]:
    """A distribution of passing_by, whose OtherY has to be below 9; its first distribution stands in line 6."""

    def write(*distributions: str) -> Path:
        text = passing_by.read_text(encoding="utf-8").replace(
            'parameterType="double" value="5.0"/>',
            'parameterType="double" value="5.0"><ConstraintGroup><ValueConstraint rule="lessThan" value="9"/>'
            "</ConstraintGroup></ParameterDeclaration>",
        )
        (tmp_path / "passing_by.xosc").write_text(text, encoding="utf-8")
        body = distributions[0]
        if not body.startswith("<Stochastic"):
            body = "<Deterministic>\n" + "\n".join(distributions) + "\n</Deterministic>"
        path = tmp_path / "distribution.xosc"
        path.write_text(DISTRIBUTION.format(body), encoding="utf-8")
        return path

    return write


@pytest.fixture
def six(vary: Callable[..., Path]) -> Path:
    """Six runs: at 0 m they collide, at 9 m the scenario does not allow them."""
    return vary(values("OtherY", "5", "0", "9"), values("End", "2", "3"))


def test_every_run_is_played(eidrive: Eidrive, six: Path) -> None:
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
    assert f"6 runs in {six}: 2 passed, 2 not passed, 2 ruled out by constraints" in result.stderr
    assert (
        f"run 4 (OtherY=9,End=2) is left out: {six}:6: the parameter 'OtherY' is '9', outside its constraints; "
        "it has to be lessThan 9"
    ) in result.stderr


def test_for_human_eyes(eidrive: Eidrive, six: Path) -> None:
    result = eidrive("run", six, "--param", "OtherY=5")
    assert result.exit_code == 2
    assert f"{six}:6: --param 'OtherY' would undo what the distribution varies; leave it out" in result.stderr
    result = eidrive("run", six, "--max-runs", "1")
    assert result.exit_code == 0
    assert "passing_by  run 0 (OtherY=5,End=2)  seed 1" in result.stdout
    assert f"6 runs in {six}: 1 passed, 5 not asked for" in result.stderr


def test_some_runs(eidrive: Eidrive, vary: Callable[..., Path]) -> None:
    one_to_thousand = '<DistributionRange stepWidth="1"><Range lowerLimit="1" upperLimit="1000"/></DistributionRange>'
    path = vary(SINGLE.format("End", one_to_thousand), values("OtherY", "5", "4"))
    result = eidrive("run", path, "--max-runs", "3", "--time-limit", "0.2", "--json")
    lines = [json.loads(line) for line in result.stdout.splitlines()]
    assert len(lines) == 3
    assert len({line["parameters"]["End"] for line in lines}) == 3
    assert "3 not passed, 1997 not asked for" in result.stderr


def test_every_run_has_its_own_files(eidrive: Eidrive, vary: Callable[..., Path], tmp_path: Path) -> None:
    out, path = tmp_path / "out", vary(values("OtherY", "5", "4"))
    eidrive("run", path, "--out", out, "--no-record", "--csv", out / "motion.csv", "--repeat", "2")
    files = sorted(path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file())
    short = [re.sub(r"-[0-9a-f]{10}/", "/", file) for file in files]
    expected = [f"passing_by-none-run{run}-seed{seed}/result.json" for run in (0, 1) for seed in (1, 2)]
    expected += [f"motion-run-{run}-seed-{seed}.csv" for run in (0, 1) for seed in (1, 2)]
    assert short == sorted(expected)
    kept = json.loads((out / files[-1]).read_text(encoding="utf-8"))
    assert (kept["run"], kept["seed"], kept["parameters"]["OtherY"]) == (1, 2, "4")


def test_draws_follow_the_files_seed_or_else_the_callers(eidrive: Eidrive, vary: Callable[..., Path]) -> None:
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


def test_nothing_is_left_to_run(eidrive: Eidrive, vary: Callable[..., Path]) -> None:
    result = eidrive("run", vary(values("OtherY", "9", "10")))
    assert result.exit_code == 2
    assert result.stdout == ""
    assert "outside its constraints" in result.stderr.splitlines()[-1]


@pytest.mark.parametrize(
    ("texts", "played", "code"), [(("fast", "5"), 0, 2), (("5", "fast", "4"), 2, 2)], ids=["the first", "a later one"]
)
def test_a_wrong_value(eidrive: Eidrive, vary: Callable[..., Path], texts: tuple[str], played: int, code: int) -> None:
    path = vary(values("OtherY", *texts))
    result = eidrive("run", path, "--json")
    assert result.exit_code == code
    assert len(result.stdout.splitlines()) == played
    assert f"{path}:6: the parameter 'OtherY' is 'fast', which is not a number" in result.stderr


def test_a_bound_on_one_run_means_nothing(eidrive: Eidrive, passing_by: Path) -> None:
    result = eidrive("run", passing_by, "--max-runs", "2")
    assert result.exit_code == 2
    assert "--max-runs 2 means nothing here; it is for distributions" in result.stderr


class TestCheck:
    def test_nothing_wrong(self, eidrive: Eidrive, vary: Callable[..., Path]) -> None:
        path = vary(values("OtherY", "5", "4"), values("End", "1", "2", "3"))
        result = eidrive("check", path)
        assert result.exit_code == 0
        assert result.stdout.splitlines() == [f"{path}: 6 runs", "1 file, 0 problems, 0 warnings"]

    def test_a_parameter_that_the_scenario_does_not_have(self, eidrive: Eidrive, vary: Callable[..., Path]) -> None:
        path = vary(values("OtherY", "5"), values("Edn", "1", "2"))
        result = eidrive("check", path)
        assert result.exit_code == 2
        assert f"{path}:7: unknown parameter 'Edn'; did you mean 'End'?" in result.stdout.splitlines()
        assert result.stdout.splitlines()[-1] == "1 file, 1 problem, 0 warnings"

    def test_every_listed_value_is_tried(self, eidrive: Eidrive, vary: Callable[..., Path]) -> None:
        path = vary(values("OtherY", "5", "4", "3", "far", "9"), values("End", "1", "late"))
        result = eidrive("check", path)
        assert result.exit_code == 2
        lines = result.stdout.splitlines()
        assert f"{path}:6: the parameter 'OtherY' is 'far', which is not a number; write it as 12.5 or 1e-3" in lines
        assert f"{path}:7: the parameter 'End' is 'late', which is not a number; write it as 12.5 or 1e-3" in lines
        assert (
            f"{path}:6: the parameter 'OtherY' is '9', outside its constraints; it has to be lessThan 9; "
            "such runs are skipped (warning)"
        ) in lines
        assert lines[-1] == "1 file, 2 problems, 1 warning"

    def test_what_the_rules_say_of_single_runs_alone(self, eidrive: Eidrive, vary: Callable[..., Path]) -> None:
        """The time is never below 0; with an End of 1 s it is at first."""
        path = vary(values("OtherY", "5", "4"), values("End", "1", "0"))
        scenario = path.with_name("passing_by.xosc")
        text = scenario.read_text(encoding="utf-8")
        late = text.replace('value="$End" rule="greaterOrEqual"', 'value="$End" rule="lessThan"')
        assert late != text
        scenario.write_text(late, encoding="utf-8")
        result = eidrive("check", path)
        told = [line for line in result.stdout.splitlines() if "impossible-condition" in line]
        assert len(told) == 1
        assert "in run 1: simulation time < 0 s never counts as true" in told[0]
        assert result.exit_code == 0
        assert "impossible-condition" not in eidrive("check", path, "--ignore", "impossible-condition").stdout

    def test_a_mistake_in_the_scenario_is_told_once(self, eidrive: Eidrive, vary: Callable[..., Path]) -> None:
        path = vary(values("OtherY", "5"))
        scenario = path.with_name("passing_by.xosc")
        text = scenario.read_text(encoding="utf-8").replace('dynamicsShape="step"', 'dynamicsShape="stp"')
        scenario.write_text(text, encoding="utf-8")
        result = eidrive("check", path.parent)
        assert result.exit_code == 2
        assert result.stdout.count("did you mean 'step'?") == 1
        assert result.stdout.splitlines()[-1] == "2 files, 1 problem, 0 warnings"

    def test_draws_are_tried(self, eidrive: Eidrive, vary: Callable[..., Path]) -> None:
        path = vary(
            '<Stochastic numberOfTestRuns="9"><StochasticDistribution parameterName="OtherY"><NormalDistribution '
            'expectedValue="20" variance="1"/></StochasticDistribution></Stochastic>'
        )
        result = eidrive("check", path)
        assert result.exit_code == 0
        assert result.stdout.count("such runs are skipped (warning)") == 9
