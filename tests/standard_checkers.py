"""Files of this project, checked by the checkers of others: `python tests/standard_checkers.py`.

- All scenarios and catalogs of the library and of `eidrive init`, by ASAM's checker of OpenSCENARIO XML.
- All road files, by ASAM's checker of OpenDRIVE.
- OSI traces of some runs, with their lanes, by omega-prime.

The checkers are installed into new environments, because they require other versions of libraries than this project and
than each other.
Prints a line per file; the exit status is 1 if a checker reports an issue.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import venv
from collections.abc import Iterator, Sequence
from pathlib import Path

from lxml import etree

ROOT = Path(__file__).parents[1]
ASAM = ("asam-qc-openscenarioxml==1.0.0", "asam-qc-opendrive==1.0.0")
OMEGA_PRIME = ("omega-prime==0.3.7",)
BUNDLES = {".xosc": ("qc_openscenario", "xoscBundle"), ".xodr": ("qc_opendrive", "xodrBundle")}
"""Command and name of ASAM's checker by the kind of a file."""
RUNS = (
    "coop/scenario_1",
    "coop/scenario_3",
    "coop/scenario_5",
    "ei/scenario_08",
    "corner_cases/pedestrian_parked_cars",
)
"""Scenarios whose traces are checked: with traffic lights, many vehicles and pedestrians, and headings beyond pi."""
TRACE_CHECK = """
import sys
from omega_prime import Recording
recording = Recording.from_file(sys.argv[1], validate=True, parse_map=True)
print(len(recording.moving_objects), "objects,", len(recording.map.lanes), "lanes")
"""
LIMIT = 600.0
"""Maximum duration of a command [s]."""


def environment(folder: Path, packages: Sequence[str]) -> Path:
    """Return the folder of the commands of a new environment with these packages."""
    venv.create(folder, with_pip=True)
    subprocess.run([folder / "bin" / "python", "-m", "pip", "install", "-q", *packages], check=True, timeout=LIMIT)
    return folder / "bin"


def written_files(folder: Path) -> Iterator[Path]:
    """Yield the files of the library and of a new project."""
    subprocess.run([sys.executable, "-m", "eidrive_scenario", "init", folder], check=True, stdout=subprocess.DEVNULL)
    for place in (ROOT / "xosc", folder):
        yield from sorted(path for path in place.rglob("*") if path.suffix in BUNDLES)


def file_issues(commands: Path, file: Path, folder: Path) -> tuple[int, list[str]]:
    """Return the number of completed checks of ASAM's checker, and the issues."""
    command, bundle = BUNDLES[file.suffix]
    result = folder / "result.xqar"
    result.unlink(missing_ok=True)
    settings = etree.Element("Config")
    etree.SubElement(settings, "Param", name="InputFile", value=str(file))
    checker = etree.SubElement(settings, "CheckerBundle", application=bundle)
    etree.SubElement(checker, "Param", name="resultFile", value=str(result))
    (folder / "settings.xml").write_bytes(etree.tostring(settings))
    run = subprocess.run(
        [commands / command, "-c", folder / "settings.xml"], capture_output=True, text=True, cwd=folder, timeout=LIMIT
    )
    if not result.exists():
        return 0, [f"no result: {run.stderr[-300:]}"]
    tree = etree.parse(result)
    states = [checker.get("status") for checker in tree.iter("Checker")]
    errors = ["a check ended with an error"] if "error" in states else []
    issues = [_issue(item) for item in tree.iter("Issue")]
    return states.count("completed"), errors + issues


def _issue(item: etree._Element) -> str:
    details = [place.get("description") or "" for place in item.iter("Locations")]
    return ": ".join([item.get("ruleUID") or "", item.get("description") or "", *details])


def traces(folder: Path) -> Iterator[Path]:
    """Yield OSI traces of runs: of several channels, of ground truth only, and within a recording."""
    eidrive = (sys.executable, "-m", "eidrive_scenario")
    for number, scenario in enumerate(RUNS):
        out = folder / f"run{number}"
        options = ("--record", "always", "--topics", "foxglove,osi", "--seed", "1", "--out", out)
        subprocess.run([*eidrive, "run", scenario, *options], stdout=subprocess.DEVNULL, timeout=LIMIT, check=False)
        recording = next(out.rglob("recording.mcap"))
        yield recording
        for name in ("trace.mcap", "trace.osi"):
            target = out / f"{Path(scenario).name}_{name}"
            subprocess.run(
                [*eidrive, "export", recording, "--osi", target], check=True, stdout=subprocess.DEVNULL, timeout=LIMIT
            )
            yield target


def trace_issues(commands: Path, trace: Path) -> tuple[str, list[str]]:
    """Return what omega-prime read, and the error."""
    check = subprocess.run(
        [commands / "python", "-c", TRACE_CHECK, trace], capture_output=True, text=True, timeout=LIMIT
    )
    return check.stdout.strip(), [check.stderr[-600:]] if check.returncode else []


def check(folder: Path) -> int:
    """Check all files, and return the number of issues."""
    total, commands = 0, environment(folder / "asam", ASAM)
    for file in written_files(folder / "project"):
        completed, issues = file_issues(commands, file, folder)
        name = file.relative_to(ROOT if file.is_relative_to(ROOT) else folder)
        total += _report(str(name), f"{completed} checks", issues)
    commands = environment(folder / "omega_prime", OMEGA_PRIME)
    for trace in traces(folder):
        read, issues = trace_issues(commands, trace)
        total += _report(str(trace.relative_to(folder)), read, issues)
    return total


def _report(name: str, read: str, issues: list[str]) -> int:
    print(f"{name}: {read}, {len(issues)} issues", *(f"  {issue}" for issue in issues), sep="\n", flush=True)
    return len(issues)


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        total = check(Path(folder))
    print(f"{total} issues")
    sys.exit(bool(total))


if __name__ == "__main__":
    main()
