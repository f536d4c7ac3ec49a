"""Adding an option of a run: one declaration in the table, which every surface shows."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.process

PROGRAM = '''
import json
import shlex
from importlib.machinery import SourceFileLoader
from pathlib import Path

DECLARATION = """
    fog: str | None = _option(Text((str,), "the name of a fog"), "Fog of the run.", in_row=True)
"""
get_code = SourceFileLoader.get_code


def code_with_declaration(loader, name):
    """Return the code of a module; the table has one more declaration, as if it were in the file."""
    if name != "eidrive_scenario.run_options.table":
        return get_code(loader, name)
    text = Path(loader.path).read_text(encoding="utf-8")
    before = "    def __post_init__(self)"
    assert text.count(before) == 1
    return compile(text.replace(before, DECLARATION + before), loader.path, "exec")


SourceFileLoader.get_code = code_with_declaration

import pytest
from typer.testing import CliRunner

from eidrive_scenario.cli import app
from eidrive_scenario.experiments.sweeps.axes import parse_axis, settings_at
from eidrive_scenario.reporting.run_report.report import write_run_report
from eidrive_scenario.experiments.reported_run import parse_run
from eidrive_scenario.reporting.run_report.settings_text import run_facts
from eidrive_scenario.simulation import RunSettings, run_file

SCENARIO = "coop/scenario_1"
SHORT = ("--time-limit", "0.2")


def eidrive(*words):
    done = CliRunner().invoke(app, list(words), env={"COLUMNS": "120", "TERMINAL_WIDTH": "120"})
    assert done.exit_code in (0, 1, 4), done.output  # 1, 4: a run that is too short for its criteria
    return done


# Help and parsing of the commands
for command in ("run", "check", "sweep"):
    assert "--fog" in eidrive(command, "--help").stdout
eidrive("check", SCENARIO, "--fog", "thick")
store = Path("store.db")
eidrive("sweep", SCENARIO, "--store", str(store), "--fog", "thin", "--vary", "fog=thin,thick", "--dry-run")

# JSON, text and the command that repeats the run
done = eidrive("run", SCENARIO, "--fog", "thick", *SHORT, "--json", "--out", "runs")
result = json.loads(done.stdout.splitlines()[0])
assert result["settings"]["fog"] == "thick"
assert "--fog thick" in result["command"]
assert "--fog thick" in eidrive("run", SCENARIO, "--fog", "thick", *SHORT).stdout
assert eidrive("run", *shlex.split(result["command"])[2:], "--json").stdout.splitlines()[0].count('"fog": "thick"') == 1

# Resolved settings, table of results, axis of a sweep
settings = RunSettings(fog="thick", time_limit=0.2)
resolved = run_file(SCENARIO, settings=settings)
assert resolved.settings.fog == "thick"
assert resolved.to_dict()["fog"] == "thick"
assert resolved.settings.digest != run_file(SCENARIO, settings=RunSettings(time_limit=0.2)).settings.digest
axis = parse_axis("fog=thin,thick")
assert [settings_at({axis.name: value}, settings, None).fog for value in axis.values] == ["thin", "thick"]

# Report
assert run_facts(parse_run(result).settings)["fog"] == "thick"
write_run_report([parse_run(result)], Path("report"))
assert "thick" in next(Path("report").rglob("*.html")).read_text(encoding="utf-8")

# pytest: option, ini option, header, settings of a run
Path("test_fog.py").write_text(
    "def test_fog(run_scenario):\\n"
    "    print('fog is', run_scenario('coop/scenario_1', time_limit=0.2).settings.fog)\\n"
)
Path("pytest.ini").write_text("[pytest]\\neidrive_fog = thin\\n")
class Output:
    def __init__(self):
        self.texts = []
    def pytest_runtest_logreport(self, report):
        self.texts.append(report.capstdout)
for words, fog in (([], "thin"), (["--eidrive-fog", "thick"], "thick")):
    output = Output()
    assert pytest.main(["-q", "-p", "no:cacheprovider", *words, "test_fog.py"], plugins=[output]) == 0
    assert f"fog is {fog}" in "".join(output.texts)
print("found on every surface")
'''


def test_added_option_is_found_on_every_surface(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-c", PROGRAM], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.splitlines()[-1] == "found on every surface"
