"""Tests of the pybullet import, which suppresses only the build message of pybullet."""

from __future__ import annotations

import subprocess
import sys


def run(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)


def test_import_prints_nothing() -> None:
    done = run("import eidrive_scenario.world.world")
    assert (done.stdout, done.stderr) == ("", "")


def test_import_passes_other_output() -> None:
    done = run(
        "import os, sys\n"
        "sys.stderr.write('before ')\n"
        "class Finder:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'pybullet':\n"
        "            os.write(2, b'within\\n')\n"
        "sys.meta_path.insert(0, Finder())\n"
        "import eidrive_scenario.world.physics.bullet\n"
        "os.write(2, b'after')\n"
    )
    assert done.stderr == "before within\nafter"


def test_types_do_not_load_pybullet() -> None:
    done = run(
        "import sys, eidrive_scenario.world.view, eidrive_scenario.world.specs; print('pybullet' in sys.modules)"
    )
    assert done.stdout == "False\n"
