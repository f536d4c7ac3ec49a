"""Imports on first access, and imports of optional dependencies."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

from eidrive_scenario.base.installation import install_command
from eidrive_scenario.errors import Diagnostic, SettingError


def lazy_exports(package: str, names: Mapping[str, str]) -> Callable[[str], Any]:
    """Return the `__getattr__` of a package (PEP 562), which imports a name when it is first accessed.

    package  name of the package
    names    exported names, separated by spaces, by the module of the package that defines them

    The package imports the names under `TYPE_CHECKING` as well, for type checkers and import contracts.
    """
    modules = {name: f"{package}.{module}" for module, exported in names.items() for name in exported.split()}

    def get(name: str) -> Any:
        if name not in modules:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(import_module(modules[name]), name)
        setattr(sys.modules[package], name, value)
        return value

    return get


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
        hint = f"install it: {install_command(extra)}"
        raise SettingError(Diagnostic(f"{_PACKAGES.get(top, top)} is not installed", hint)) from error
