"""A session of 100 runs with two workers: four broken runs are reported as what they are, 96 pass."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

import pytest
from faulty_extensions import install, write_scenario
from lxml import etree

xunit2 = pytest.importorskip("junitparser.xunit2")

pytest_plugins = ["pytester"]
pytestmark = [pytest.mark.process, pytest.mark.timeout(900)]
"""Two workers load the engine several times, and one run lasts for the wall limit."""

LIMIT = 25
"""Wall limit of each run [s]; a valid run needs much less."""
BROKEN = ("endless", "fails", "invalid", "killed")
SCHEMA = os.environ.get("EIDRIVE_JUNIT_SCHEMA")
"""File junit-10.xsd of Jenkins's xunit-plugin, which is not part of the project."""


@pytest.fixture(scope="module")
def junit(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the JUnit file of the session."""
    root = tmp_path_factory.mktemp("suite")
    (root / "package").mkdir()
    code = install(root / "package")
    folder = root / "xosc"
    folder.mkdir()
    for number in range(96):
        write_scenario(folder / f"sound_{number:02}.xosc", end=0.2)
    write_scenario(folder / "endless.xosc", detector="hangs")
    write_scenario(folder / "killed.xosc", detector="kills_process")
    write_scenario(folder / "fails.xosc", criterion="max_speed: {of: Ego, at_most: 1}")
    write_scenario(folder / "invalid.xosc", end=0.2)
    text = (folder / "invalid.xosc").read_text(encoding="utf-8")
    (folder / "invalid.xosc").write_text(text.replace("</Storyboard>", "", 1), encoding="utf-8")
    (root / "pytest.ini").write_text(f"[pytest]\neidrive_wall_limit = {LIMIT}\n", encoding="utf-8")
    arguments = ("xosc", "-n", "2", "--junitxml", "junit.xml", "-p", "no:cacheprovider")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *arguments],
        cwd=root,
        env={**os.environ, "PYTHONPATH": f"{code}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == pytest.ExitCode.TESTS_FAILED, done.stdout + done.stderr
    assert "1 failed, 96 passed, 3 errors" in done.stdout.splitlines()[-1]
    return root / "junit.xml"


def test_broken_runs_are_reported_as_what_they_are(junit: Path) -> None:
    cases = {str(case.get("name")): case for case in ElementTree.parse(junit).iter("testcase")}
    assert len(cases) == 100
    results = {
        name: (entry.tag, entry.text or "")
        for name, case in cases.items()
        for entry in case
        if entry.tag in ("failure", "error", "skipped")
    }
    assert sorted(results) == [f"xosc/{name}[seed=1]" for name in BROKEN]
    endless, fails, invalid, killed = (results[f"xosc/{name}[seed=1]"] for name in BROKEN)
    assert (endless[0], fails[0], invalid[0], killed[0]) == ("error", "failure", "error", "error")
    assert "detector 'hangs' (faulty:Hangs) of station 'Ego'" in endless[1]
    assert f"after {LIMIT} s of wall time (the wall limit)" in endless[1]
    assert "max_speed 5 m/s, limit 1 m/s" in fails[1]
    assert "limit 1 m/s" in fails[1]
    assert "invalid.xosc:" in invalid[1]
    assert "the process of the run was ended by SIGKILL" in killed[1]
    assert "crashed while running 'xosc/killed.xosc::xosc/killed[seed=1]'" in killed[1]
    for _, text in (endless, fails, killed):
        assert "reproduce: eidrive run" in text


def test_junitparser_reads_all_properties(junit: Path) -> None:
    """Each run that ended has its settings, criteria and trace hash; equal runs have equal hashes."""
    (suite,) = xunit2.JUnitXml.fromfile(str(junit))
    assert (suite.tests, suite.failures, suite.errors, suite.skipped) == (100, 1, 3, 0)
    found = {case.name: {one.name: one.value for one in case.properties()} for case in suite}
    complete = {name: entries for name, entries in found.items() if entries}
    assert len(complete) == 97
    for name, entries in complete.items():
        assert json.loads(entries["settings.versions"])["eidrive-scenario"]
        assert entries["settings.scenario"] == name.removeprefix("xosc/").removesuffix("[seed=1]")
        assert (entries["seed"], entries["end_reason"]) == ("1", "stop trigger")
    sound = [entries for name, entries in complete.items() if "sound" in name]
    assert Counter(entries["collision.passed"] for entries in sound) == {"True": 96}
    assert len({entries["trace_hash"] for entries in sound}) == 1
    assert complete["xosc/fails[seed=1]"]["max_speed.passed"] == "False"


def test_elements_are_those_of_xunit2(junit: Path) -> None:
    """The family xunit2 has no further attributes; the counts of the suite are those of its cases."""
    (suite,) = ElementTree.parse(junit).getroot()
    assert set(suite.attrib) == {"name", "errors", "failures", "skipped", "tests", "time", "timestamp", "hostname"}
    children = Counter(child.tag for case in suite for child in case)
    assert children == {
        "properties": 97,
        "error": int(suite.attrib["errors"]),
        "failure": int(suite.attrib["failures"]),
    }
    for case in suite:
        assert set(case.attrib) == {"classname", "name", "time"}
        assert float(case.attrib["time"]) >= 0.0


@pytest.mark.skipif(SCHEMA is None, reason="EIDRIVE_JUNIT_SCHEMA is not set")
def test_file_is_valid_against_schema_of_jenkins(junit: Path) -> None:
    """Properties of a test case, which `record_property` of pytest writes too, are not part of early versions."""
    schema = etree.XMLSchema(etree.parse(str(SCHEMA)))
    document = etree.parse(str(junit))
    if not schema.validate(document):
        for case in document.iter("testcase"):
            for properties in case.findall("properties"):
                case.remove(properties)
    schema.assertValid(document)
