"""Kernels: compiled once, cached, and compiled in memory without a cache."""

from __future__ import annotations

import ast
import inspect
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from eidrive_scenario.base.kernels import kernel
from eidrive_scenario.cli.compile_kernels import find_kernels

PROGRAM = """
import numpy as np
from eidrive_scenario.rendering.rasterization import rasterize
from eidrive_scenario.rendering.projection import _find_places
corners = np.array([[0.0, 8.0, 0.0], [0.0, 0.0, 8.0], [1.0, 1.0, 1.0]])[:, :, None]
print((rasterize(*corners, 8, 8).triangle == 0).sum())
_find_places.compiled
"""
NOTICE = "compiling kernels, once after installation\n"


@kernel("f8(f8)")
def half(value: float) -> float:
    return value / 2.0


@kernel("f8(f8[::1], i8)")
def sum_of_halves(values: np.ndarray, divisor: int) -> float:
    """Return a sum."""
    total = 0.0
    for value in values:
        total += half(value) / divisor
    return total


def run_kernels(**variables: str) -> tuple[str, str]:
    """Return what a process with two kernels prints on stdout and stderr."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True, env={**os.environ, **variables}
    )
    return done.stdout, done.stderr


def test_kernel_calls_kernels_of_its_module() -> None:
    assert sum_of_halves(np.array([1.0, 2.0, 5.0]), 2) == 2.0
    assert sum_of_halves.__doc__ == "Return a sum."


def test_kernel_divides_by_zero_as_arrays_do() -> None:
    assert sum_of_halves(np.array([2.0]), 0) == np.inf


def test_kernel_rejects_arguments_of_another_type() -> None:
    with pytest.raises(TypeError, match="No matching definition"):
        sum_of_halves(np.array([1, 2]), 2)


def test_kernels_of_all_modules_are_found() -> None:
    modules = {each.__module__ for each in find_kernels()}
    assert {"eidrive_scenario.rendering.rasterization", "eidrive_scenario.rendering.shadows"} <= modules


def test_kernels_use_nothing_of_other_modules() -> None:
    """numba compiles a kernel again if its own file changes: other modules are passed as arguments."""
    for each in find_kernels():
        function = each.__wrapped__
        tree = ast.parse(Path(inspect.getfile(function)).read_text(encoding="utf-8"))
        statements = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
        imported = {name.asname or name.name for node in statements for name in node.names}
        assert not imported & set(function.__code__.co_names), function


@pytest.mark.process
def test_compilation_is_announced_once_and_cached(tmp_path: Path) -> None:
    """Triangle of 8 x 8 / 2 pixels: a center on its diagonal edge belongs to the triangle below."""
    cache = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    assert run_kernels(**cache) == ("28\n", NOTICE)
    assert run_kernels(**cache) == ("28\n", "")


@pytest.mark.process
def test_kernels_without_a_writable_cache_are_compiled_with_one_warning(tmp_path: Path) -> None:
    """A path below a file is not writable, by root either."""
    (tmp_path / "file").touch()
    output, errors = run_kernels(
        NUMBA_CACHE_DIR=str(tmp_path / "file" / "cache"), NUMBA_CACHE_LOCATOR_CLASSES="UserProvidedCacheLocator"
    )
    assert output == "28\n"
    assert errors.count("RuntimeWarning: kernels are compiled in each process") == 1
    assert NOTICE not in errors
