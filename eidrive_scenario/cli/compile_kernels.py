"""Compile all kernels ahead of the first run: `python -m eidrive_scenario.cli.compile_kernels`."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import eidrive_scenario
from eidrive_scenario.base.kernels import Kernel


def find_kernels() -> list[Kernel[..., object]]:
    """Return the kernels of all modules of the engine."""
    root = Path(eidrive_scenario.__file__).parent
    kernels: list[Kernel[..., object]] = []
    for path in sorted(root.rglob("*.py")):
        if "\n@kernel(" in path.read_text(encoding="utf-8"):
            module = import_module(".".join(("eidrive_scenario", *path.relative_to(root).with_suffix("").parts)))
            kernels += [each for each in vars(module).values() if isinstance(each, Kernel)]
    return kernels


if __name__ == "__main__":
    for each in find_kernels():
        _ = each.compiled
