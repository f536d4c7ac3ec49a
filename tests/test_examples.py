"""The scripts in `examples/`."""

from __future__ import annotations

import ast
import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"


def run(script: str, *arguments: str, folder: Path) -> list[str]:
    command = [sys.executable, str(EXAMPLES / script), *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def test_every_script_has_a_row_in_the_readme() -> None:
    text = (EXAMPLES / "README.md").read_text(encoding="utf-8")
    assert sorted(path.name for path in EXAMPLES.glob("*.py")) == sorted(
        line.split("`")[1] for line in text.splitlines() if line.startswith("| `")
    )


@pytest.mark.statistical
def test_latency_sweep_high_latency_causes_collisions(tmp_path: Path) -> None:
    _, ideal, late = run("latency_sweep.py", "--seeds", "2", "--latency", "0", "0.3", folder=tmp_path)
    assert (ideal.split()[1], late.split()[1]) == ("2/2", "0/2")
    assert float(ideal.split()[-1]) > float(late.split()[-1])


RECORDER = """
import json
from pathlib import Path

calls = []

def __getattr__(name):
    def call(*arguments, **named):
        calls.append([name, *arguments, named])
        Path("calls.json").write_text(json.dumps(calls), encoding="utf-8")
    return call
"""


@pytest.mark.process
def test_mlflow_runs_logs_each_run_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A module that records calls takes the place of MLflow."""
    (tmp_path / "mlflow.py").write_text(RECORDER, encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")]))
    words = ("--channel", "ideal", "latency_300ms", "--seeds", "1")
    assert run("mlflow_runs.py", *words, folder=tmp_path) == ["ideal 1 passed", "latency_300ms 1 failed"]
    calls = json.loads((tmp_path / "calls.json").read_text(encoding="utf-8"))
    names = [name for name, *_ in calls if name != "log_metric"]
    one = ["start_run", "log_params", "log_metrics", "set_tags", "end_run", "end_run"]
    assert names == 2 * one
    ends = [arguments[0] for name, *arguments in calls if name == "end_run"]
    assert ends == ["FINISHED", "KILLED", "FAILED", "KILLED"]
    assert [arguments[0]["channel"] for name, *arguments in calls if name == "log_params"] == ["ideal", "latency_300ms"]
    speeds = [arguments for name, *arguments in calls if name == "log_metric"]
    assert (speeds[0][0], speeds[1][2]["step"] - speeds[0][2]["step"]) == ("speed", 50)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of SQLAlchemy, in mlflow
def test_mlflow_runs_writes_a_local_store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mlflow = pytest.importorskip("mlflow")
    store = f"sqlite:///{tmp_path / 'mlflow.db'}"
    monkeypatch.setenv("MLFLOW_TRACKING_URI", store)
    run("mlflow_runs.py", "--channel", "ideal", "latency_300ms", "--seeds", "1", folder=tmp_path)
    mlflow.set_tracking_uri(store)
    rows = mlflow.search_runs()
    assert sorted(rows["status"]) == ["FAILED", "FINISHED"]
    assert set(rows["params.channel"]) == {"ideal", "latency_300ms"}


@pytest.mark.statistical
def test_channel_load_increases_busy_ratio_and_age(tmp_path: Path) -> None:
    _, low, high = run("channel_load.py", "--density", "0.01", "0.12", folder=tmp_path)
    (_, busy, delivered, age, _), (_, busy_high, delivered_high, age_high, _) = low.split(), high.split()
    assert float(busy) < float(busy_high)
    assert float(delivered) > float(delivered_high)
    assert float(age) < float(age_high)


@pytest.mark.exhaustive
@pytest.mark.parametrize(("channel", "braked"), [("none", False), ("ideal", True)])
def test_step_by_hand_shows_why_the_ego_brakes(tmp_path: Path, channel: str, braked: bool) -> None:
    run("step_by_hand.py", "coop/scenario_1", "--channel", channel, "--out", "ego.csv", folder=tmp_path)
    with (tmp_path / "ego.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert any(int(row["messages"]) for row in rows) is braked
    before = [row for row in rows if float(row["time"]) < 4.0]
    assert any("conflict area" in row["reason"] and float(row["brake"]) > 0.0 for row in before) is braked


@pytest.mark.process
def test_step_by_hand_with_unknown_station_lists_the_stations(tmp_path: Path) -> None:
    command = [sys.executable, str(EXAMPLES / "step_by_hand.py"), "--station", "Nope", "--out", str(tmp_path / "a.csv")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "no station 'Nope'; stations: Ego, RSU" in done.stderr
    assert not (tmp_path / "a.csv").exists()


@pytest.mark.statistical
def test_policy_is_better_than_the_rule_under_latency(tmp_path: Path) -> None:
    pytest.importorskip("gymnasium")
    _, late, none = run("evaluate_policy.py", "--seeds", "8", "--latency", "0.45", folder=tmp_path)
    assert late.split()[0] == "0.45"
    rule, policy = (part for part in late.split() if "/" in part)
    assert int(policy.split("/")[0]) > int(rule.split("/")[0])
    *_, blind = (part for part in none.split() if "/" in part)
    assert int(blind.split("/")[0]) < int(policy.split("/")[0])


@pytest.mark.statistical
def test_training_writes_a_policy_that_can_be_evaluated(tmp_path: Path) -> None:
    pytest.importorskip("gymnasium")
    small = ("--generations", "1", "--population", "2", "--episodes", "1", "--workers", "1")
    files = ("--out", "policy.npz", "--curve", "curve.csv", "--plot", "curve.png")
    *_, last = run("train_policy.py", *small, *files, folder=tmp_path)
    assert last.startswith("wrote policy.npz")
    header, *rows = (tmp_path / "curve.csv").read_text(encoding="utf-8").splitlines()
    assert header == "generation,reward,passed"
    assert len(rows) == 2
    assert (tmp_path / "curve.png").read_bytes().startswith(b"\x89PNG")
    _, row, _ = run("evaluate_policy.py", "--policy", "policy.npz", "--seeds", "1", "--latency", "0.3", folder=tmp_path)
    assert row.split()[0] == "0.30"


@pytest.mark.statistical
def test_stable_baselines_trains_a_policy(tmp_path: Path) -> None:
    """`make check-docs` installs the library."""
    pytest.importorskip("stable_baselines3")
    head, *rows = run("train_sb3.py", "--steps", "1280", "--episodes", "1", "--out", "ppo.zip", folder=tmp_path)
    assert head.split() == ["latency", "[s]", "passed"]
    assert [row.split()[0] for row in rows] == ["0", "0.15", "0.3", "0.45", "0.6"]
    assert (tmp_path / "ppo.zip").is_file()


def test_notebook_cells_show_the_stated_results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Texts of the outputs of all cells, executed in their order and in one namespace."""
    pytest.importorskip("pandas")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    cells = json.loads((EXAMPLES / "quickstart.ipynb").read_text(encoding="utf-8"))["cells"]
    shown = 0
    for cell in cells:
        if cell["cell_type"] != "code":
            continue
        *statements, last = ast.parse("".join(cell["source"])).body
        exec(compile(ast.Module(statements, []), "cell", "exec"), names)
        assert isinstance(last, ast.Expr)
        value = eval(compile(ast.Expression(last.value), "cell", "eval"), names)
        (output,) = cell["outputs"]
        assert repr(value) == "".join(output["data"]["text/plain"])
        shown += 1
    assert shown == 5
    assert (tmp_path / "report" / "report.html").is_file()
