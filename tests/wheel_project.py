"""A new project with an installed wheel, without network: `python tests/wheel_project.py WHEEL [--packages FOLDER]`.

Installs the wheel into an empty environment, writes a project with `eidrive init` into an empty folder, and executes
its tests and commands where no connection can be made. The dependencies come from the package folder (by default, that
of this Python). Prints the commands; the exit status is 1 if one of them fails.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import venv
from collections.abc import Sequence
from pathlib import Path

PACKAGES = ("eidrive_scenario", "eidrive_behaviors", "eidrive_criteria", "eidrive_reports")
CONTENT = f"""
import importlib, sys
from pathlib import Path
for name in {PACKAGES!r}:
    place = Path(importlib.import_module(name).__file__)
    assert place.is_relative_to(sys.prefix), f"{{name}} is imported from {{place}}, not from the wheel"
from eidrive_scenario.extensions.library import LIBRARY_FOLDER, library_path, resolve_scenario, scenarios
assert library_path().is_relative_to(sys.prefix), library_path()
assert len(scenarios()) > 50, scenarios()
assert list((Path(importlib.import_module("eidrive_scenario").__file__).parent / "perception" / "weights").iterdir())
try:
    import socket
    socket.create_connection(("192.0.2.1", 9), timeout=1)
except OSError:
    pass
else:
    raise SystemExit("the network can be reached")
"""


def install(wheel: Path, packages: Path, folder: Path) -> Path:
    """Install the wheel without network into a new environment, and return its Python."""
    venv.create(folder, with_pip=True)
    python = folder / "bin" / "python"
    subprocess.run([python, "-m", "pip", "install", "-q", "--no-index", "--no-deps", wheel], check=True)
    site = next((folder / "lib").glob("python*/site-packages"))
    (site / "zz_dependencies.pth").write_text(f"{packages}\n", encoding="utf-8")
    return python


def isolation() -> list[str]:
    """Return the start of a command that has no network; empty if the system has no command for it."""
    found = shutil.which("unshare")
    start = [found, "--user", "--map-root-user", "--net"] if found else []
    return start if start and subprocess.run([*start, "true"], check=False).returncode == 0 else []


def commands(python: Path) -> list[tuple[str, Sequence[str | Path]]]:
    """Return the commands and the folders in which they are executed, below the empty folder."""
    eidrive = python.with_name("eidrive")
    return [
        (".", [python, "-c", CONTENT]),
        (".", [eidrive, "init", "demo"]),
        ("demo", [python, "-m", "pytest", "-q"]),
        ("demo", [eidrive, "check", "scenarios"]),
        ("demo", [eidrive, "run", "scenarios/cut_in.xosc"]),
        (".", [eidrive, "run", "coop/scenario_1"]),
    ]


def main() -> int:
    """Execute all commands until one fails."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("wheel", type=Path)
    parser.add_argument("--packages", type=Path, default=Path(sysconfig.get_path("purelib")))
    options = parser.parse_args()
    start = isolation()
    print("network: none" if start else "network: not restricted, as unshare is not permitted", flush=True)
    environment = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "EIDRIVE_PROJECT")}
    with tempfile.TemporaryDirectory() as temporary:
        python = install(options.wheel.resolve(), options.packages.resolve(), Path(temporary, "environment"))
        empty = Path(temporary, "empty")
        empty.mkdir()
        for place, command in commands(python):
            shown = ["..." if word == CONTENT else str(word) for word in command[1:]]
            print("$", Path(command[0]).name, *shown, flush=True)
            if subprocess.run([*start, *command], cwd=empty / place, env=environment, check=False).returncode:
                return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
