"""The scripts in `examples/`."""

from __future__ import annotations

import csv
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


def test_latency_sweep_high_latency_causes_collisions(tmp_path: Path) -> None:
    _, ideal, late = run("latency_sweep.py", "--seeds", "2", "--latency", "0", "0.3", folder=tmp_path)
    assert (ideal.split()[1], late.split()[1]) == ("2/2", "0/2")
    assert float(ideal.split()[-1]) > float(late.split()[-1])


def test_channel_load_increases_busy_ratio_and_age(tmp_path: Path) -> None:
    _, low, high = run("channel_load.py", "--density", "0.01", "0.12", folder=tmp_path)
    (_, busy, delivered, age, _), (_, busy_high, delivered_high, age_high, _) = low.split(), high.split()
    assert float(busy) < float(busy_high)
    assert float(delivered) > float(delivered_high)
    assert float(age) < float(age_high)


@pytest.mark.parametrize(("channel", "braked"), [("none", False), ("ideal", True)])
def test_step_by_hand_shows_why_the_ego_brakes(tmp_path: Path, channel: str, braked: bool) -> None:
    run("step_by_hand.py", "coop/scenario_1", "--channel", channel, "--out", "ego.csv", folder=tmp_path)
    with (tmp_path / "ego.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert any(int(row["messages"]) for row in rows) is braked
    before = [row for row in rows if float(row["time"]) < 4.0]
    assert any("conflict area" in row["reason"] and float(row["brake"]) > 0.0 for row in before) is braked
