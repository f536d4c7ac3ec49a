"""Origin of a report: version, commit, date, machine and command."""

from __future__ import annotations

import os
import platform
import shlex
import subprocess
import sys
from collections.abc import Sequence
from datetime import datetime
from importlib.metadata import version
from pathlib import Path

from eidrive_scenario.base.installation import ENGINE
from eidrive_scenario.reporting.run_report.reported_runs import ReportedRun


def report_origin(runs: Sequence[ReportedRun]) -> dict[str, str]:
    """Return what the header of a report states, by title; without the commit outside of a Git repository."""
    given = [run.settings.get("versions") for run in runs]
    versions = {str(names[ENGINE]) for names in given if isinstance(names, dict) and ENGINE in names}
    machine = f"{platform.node()}, {platform.system()} {platform.machine()}, {os.cpu_count()} cores"
    entries = {
        "version": f"{ENGINE} {', '.join(sorted(versions)) or version(ENGINE)}",
        "commit": _commit(),
        "date": datetime.now().astimezone().isoformat(sep=" ", timespec="minutes"),
        "machine": f"{machine}, Python {platform.python_version()}",
        "command": _command(),
    }
    return {title: text for title, text in entries.items() if text}


def _commit() -> str:
    """Return the commit of the working folder; empty without one."""
    # Whether files differ from it is not asked: Git would execute filters that the settings of the folder name.
    command = ["git", "rev-parse", "--short=10", "HEAD"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True, timeout=10).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return ""


def _command() -> str:
    """Return the command line of this process; empty in a session of Python."""
    program = Path(sys.argv[0])
    if not program.name or program.name == "-c":
        return ""
    name = f"python -m {program.parent.name}" if program.name == "__main__.py" else program.name
    return " ".join([name, *map(shlex.quote, sys.argv[1:])])
