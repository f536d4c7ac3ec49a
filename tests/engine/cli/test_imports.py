"""Packages that short commands do not import, since an import takes longer than the command."""

from __future__ import annotations

import subprocess
import sys

import pytest

HEAVY = (
    "asn1tools", "cv2", "dask", "jinja2", "matplotlib", "mcap", "networkx", "onnxruntime", "optuna", "pandas",
    "pyarrow", "pyproj", "scipy", "sqlite3", "torch",
)  # fmt: skip
SHORT = (*HEAVY, "msgspec", "numpy", "py_trees", "pybullet", "rich", "simpleeval", "yaml")

PROGRAM = """
import sys
from eidrive_scenario.cli import main
try:
    main()
except SystemExit as end:
    assert not end.code, end.code
print("imported:", *sorted({name.split(".")[0] for name in sys.modules}))
"""


@pytest.mark.parametrize(
    ("arguments", "excluded"),
    [
        (["--version"], (*SHORT, "lxml", "pydantic")),
        (["list"], SHORT),
        (["list", "detectors"], SHORT),
        (["run", "coop/scenario_1"], HEAVY),
        (["run", "coop/scenario_1", "--seed", "2", "--json"], HEAVY),
    ],
    ids=" ".join,
)
def test_command_imports_no_package_without_need(arguments: list[str], excluded: tuple[str, ...]) -> None:
    done = subprocess.run([sys.executable, "-c", PROGRAM, *arguments], capture_output=True, text=True, check=True)
    imported = done.stdout.splitlines()[-1].removeprefix("imported: ").split()
    assert "typer" in imported
    assert not set(imported) & set(excluded)
