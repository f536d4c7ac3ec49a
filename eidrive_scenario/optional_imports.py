"""Import of the libraries of optional dependencies when they are needed."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from eidrive_scenario.errors import Diagnostic, SettingError

_PACKAGES = {
    "osi3": "osi-python",
    "foxglove_schemas_protobuf": "foxglove-schemas-protobuf",
    "mcap_protobuf": "mcap-protobuf-support",
}
"""Package on PyPI by module, if the names differ."""


def optional_import(module: str, extra: str) -> Any:
    """Return a module. Raise SettingError with the command that installs it if it is missing.

    extra  optional dependencies of this project that contain it
    """
    try:
        return import_module(module)
    except ImportError as error:
        top = module.partition(".")[0]
        hint = f"install it: pip install 'eidrive-scenario[{extra}]'"
        raise SettingError(Diagnostic(f"{_PACKAGES.get(top, top)} is not installed", hint)) from error
