"""Modules that short commands do not import, since an import takes longer than the command."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

from eidrive_scenario import __version__

HEAVY = (
    "asn1tools", "cv2", "dask", "jinja2", "matplotlib", "mcap", "networkx", "numba", "onnxruntime", "openvino",
    "optuna", "pandas", "pyarrow", "pyproj", "scipy", "sqlite3", "torch",
)  # fmt: skip
SHORT = (*HEAVY, "msgspec", "numpy", "py_trees", "pybullet", "rich", "simpleeval", "yaml")
UNUSED = (
    "eidrive_scenario.experiments.judgement", "eidrive_scenario.openscenario.distributions.expansion",
    "eidrive_scenario.recording.recording", "eidrive_scenario.traffic.spawning.generators",
    "eidrive_scenario.rendering.renderer", "eidrive_scenario.rendering.scene",
)  # fmt: skip
"""Modules for other runs: of distributions, with recording, background traffic or cameras."""
OTHER_COMMANDS = tuple(f"eidrive_scenario.cli.{name}" for name in ("check", "init", "results", "sweep"))

PROGRAM = """
import sys
from eidrive_scenario.cli import main
try:
    main()
except SystemExit as end:
    assert not end.code, end.code
print("imported:", *sys.modules)
"""


@pytest.mark.process
@pytest.mark.parametrize(
    ("arguments", "excluded"),
    [
        (["--version"], (*SHORT, *OTHER_COMMANDS, "ctypes", "email", "lxml", "pydantic")),
        (["list"], (*SHORT, *OTHER_COMMANDS)),
        (["list", "detectors"], (*SHORT, *OTHER_COMMANDS)),
        (["list", "criteria"], (*HEAVY, *OTHER_COMMANDS)),
        (["run", "coop/scenario_1"], (*HEAVY, *OTHER_COMMANDS, *UNUSED)),
        (
            ["sweep", "coop/scenario_1", "--vary", "EgoSpeed=6:8:1", "--store", "unused.db", "--dry-run"],
            ("cv2", "dask", "jinja2", "matplotlib", "optuna", "pandas", "scipy", "torch"),
        ),
        (["run", "coop/scenario_1", "--seed", "2", "--json"], (*HEAVY, *OTHER_COMMANDS, *UNUSED, "rich")),
    ],
    ids=" ".join,
)
def test_command_imports_no_module_without_need(arguments: list[str], excluded: tuple[str, ...]) -> None:
    done = subprocess.run([sys.executable, "-c", PROGRAM, *arguments], capture_output=True, text=True, check=True)
    imported = done.stdout.splitlines()[-1].removeprefix("imported: ").split()
    assert "typer" in imported
    assert not set(imported) & set(excluded)


@pytest.mark.process
def test_plugin_of_pytest_imports_no_engine_before_the_first_run() -> None:
    """pytest loads the plugin in every project of its environment."""
    program = "import sys, eidrive_scenario.pytest_plugin; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert not set(done.stdout.split()) & {*SHORT, "pydantic", "typer", "eidrive_scenario.simulation"}


def test_version_of_the_engine_is_that_of_its_distribution() -> None:
    assert __version__ == version("eidrive-scenario")


@pytest.mark.parametrize("selected", [None, "SkylakeX"])
def test_blas_kernel_is_equal_on_all_processors_unless_it_is_selected(selected: str | None) -> None:
    processor = Path("/proc/cpuinfo")
    if not (processor.exists() and " avx2" in processor.read_text(encoding="utf-8")):
        pytest.skip("the processor has no AVX2")
    environment = {name: value for name, value in os.environ.items() if name != "OPENBLAS_CORETYPE"}
    program = "import eidrive_scenario, os; print(os.environ['OPENBLAS_CORETYPE'])"
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=environment if selected is None else {**environment, "OPENBLAS_CORETYPE": selected},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout.strip() == (selected or "Haswell")
