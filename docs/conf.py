"""Settings of the documentation site: Sphinx with MyST and Furo. `make docs` builds it."""

from __future__ import annotations

import importlib
import inspect
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))
from api_docstrings import to_rest

import eidrive_scenario

project = "eidrive-scenario"
release = version = eidrive_scenario.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.viewcode"]
highlight_language = "text"
html_theme = "furo"
html_title = f"{project} {release}"
html_show_copyright = False
html_show_sphinx = False

myst_heading_anchors = 4

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_default_options = {"members": True, "imported-members": True}
python_use_unqualified_type_names = True
add_module_names = False

# An object of several modules of the interface is described once, in the first of these.
_MODULES = (
    "common",
    "perception",
    "fusion",
    "v2x",
    "driving",
    "criteria",
    "actions",
    "run",
    "live",
    "experiments",
    "report",
    "pages",
)
_API = "eidrive_scenario.api"
_OWNERS: dict[str, str] = {}


def public_names(module: Any) -> list[str]:
    """Return the names that a module of the public interface exports: constants, classes, then functions."""
    names = [name for name in vars(module) if name[0].isalpha()]
    return sorted(names, key=lambda name: (not name.isupper(), not name[0].isupper(), name))


for _module in _MODULES:
    for _name in public_names(importlib.import_module(f"{_API}.{_module}")):
        _OWNERS.setdefault(_name, _module)


def _is_documented(module: Any, name: str) -> bool:
    """Return whether autodoc describes an object of a module: classes and functions."""
    return inspect.isclass(getattr(module, name)) or inspect.isroutine(getattr(module, name))


def _convert(app: Any, kind: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Convert a docstring; that of a module lists the names that another module describes."""
    lines[:] = to_rest(lines)
    if kind == "module" and name.startswith(f"{_API}."):
        mine = name.removeprefix(f"{_API}.")
        others = [(owner, entry) for entry in public_names(thing) if (owner := _OWNERS[entry]) != mine]
        for owner in dict.fromkeys(owner for owner, _ in others):
            entries = ", ".join(f"``{entry}``" for other, entry in others if other == owner)
            lines += ["", f"Also here, described in :doc:`{owner} </api/{owner}>`: {entries}."]
        plain = [entry for entry in public_names(thing) if _OWNERS[entry] == mine and not _is_documented(thing, entry)]
        if plain:
            lines += ["", f"Constants, types and modules: {', '.join(f'``{entry}``' for entry in plain)}."]


def _skip(app: Any, kind: str, name: str, thing: Any, skip: bool, options: Any) -> bool | None:
    """Skip the members of a module that another module describes."""
    page = app.env.current_document.docname.partition("api/")[2]
    return True if kind == "module" and page and _OWNERS.get(name, page) != page else None


def setup(app: Any) -> None:
    """Connect the conversion of docstrings and the selection of members."""
    app.connect("autodoc-process-docstring", _convert)
    app.connect("autodoc-skip-member", _skip)
