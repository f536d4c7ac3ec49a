"""Commands of the CI examples in `docs/ci.md`, in a project of `eidrive init`.

The lines `pip install …` need a network. The test writes the metadata of that installation instead and runs the other
commands as they are. They are the same in both examples, so they run once.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml

pytestmark = pytest.mark.timeout(600)

PAGE = Path(__file__).parents[3] / "docs" / "ci.md"
INSTALL = "pip install "
ENVIRONMENT = {"GITHUB_ACTIONS": "true", "CI": "true"}


def example(title: str) -> Mapping[str, Any]:
    """Return the YAML block of a section."""
    section = PAGE.read_text(encoding="utf-8").partition(f"## {title}\n")[2]
    found = re.search(r"^```yaml\n(.*?)^```$", section, re.MULTILINE | re.DOTALL)
    assert found is not None
    data: Mapping[str, Any] = yaml.safe_load(found[1])
    return data


def commands(title: str) -> list[str]:
    job = example(title)["jobs"]["scenarios"] if title == "GitHub Actions" else example(title)["scenarios"]
    if title == "GitHub Actions":
        return [step["run"] for step in job["steps"] if "run" in step]
    return [*job["script"], *job["after_script"]]


def installed(project: Path, folder: Path) -> Path:
    """Write the metadata of an installation of the project, with its entry points, and return their folder."""
    declared = tomllib.loads((project / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    metadata = folder / f"{declared['name']}-{declared['version']}.dist-info"
    metadata.mkdir(parents=True)
    text = f"Metadata-Version: 2.1\nName: {declared['name']}\nVersion: {declared['version']}\n"
    (metadata / "METADATA").write_text(text, encoding="utf-8")
    for group, points in declared["entry-points"].items():
        listed = "".join(f"{name} = {value}\n" for name, value in points.items())
        with (metadata / "entry_points.txt").open("a", encoding="utf-8") as file:
            file.write(f"[{group}]\n{listed}")
    return folder


def test_examples_run_the_same_commands() -> None:
    assert commands("GitHub Actions") == commands("GitLab CI")


@pytest.mark.process
def test_commands_of_example_pass_in_new_project(tmp_path: Path) -> None:
    project = tmp_path / "demo"
    environment = {name: text for name, text in os.environ.items() if not name.startswith(("GITHUB", "CI", "PYTEST"))}
    environment |= ENVIRONMENT
    environment["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment["GITHUB_STEP_SUMMARY"] = str(tmp_path / "step.md")

    def run(command: str, folder: Path) -> None:
        done = subprocess.run(
            ["bash", "-eo", "pipefail", "-c", command],
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"

    run(f"eidrive init {project}", tmp_path)
    environment["PYTHONPATH"] = os.pathsep.join([str(project), str(installed(project, tmp_path / "installed"))])
    listed = commands("GitHub Actions")
    assert [line for line in listed if line.startswith(INSTALL)] == ["pip install -e . pytest-xdist"]
    executed = [line for line in listed if not line.startswith(INSTALL)]
    assert [line.split()[0] for line in executed] == ["eidrive", "pytest", "eidrive"]
    for command in executed:
        run(command, project)
    (suite,) = ElementTree.parse(project / "reports" / "junit.xml").getroot()
    assert suite.get("tests") == "5", "the scenario as a test item, three gaps, and a success rate"
    assert (project / "reports" / "report.html").is_file()
    assert list((project / "reports" / "runs").rglob("recording.mcap"))
    assert (tmp_path / "step.md").is_file()


def test_artifacts_of_examples_contain_reports() -> None:
    """A report that no artifact contains would be lost with the machine."""
    assert example("GitLab CI")["scenarios"]["artifacts"] == {
        "when": "always",
        "paths": ["reports"],
        "reports": {"junit": "reports/junit.xml"},
    }
    upload = example("GitHub Actions")["jobs"]["scenarios"]["steps"][-1]
    assert (upload["if"], upload["with"]["path"]) == ("always()", "reports")
