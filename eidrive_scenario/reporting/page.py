"""HTML pages from templates: self-contained files without external resources."""

from __future__ import annotations

import base64
import os
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from eidrive_scenario.files.atomic import write_atomically
from eidrive_scenario.files.bounded import path_argument


@cache
def _environment() -> Environment:
    return Environment(
        loader=PackageLoader("eidrive_scenario.reporting"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def render_page(template: str | Path, **values: Any) -> str:
    """Return the HTML of a template of this package, or of a file, which may extend one of them.

    Text is escaped, except `markupsafe.Markup`.
    """
    environment = _environment()
    if isinstance(template, str):
        return environment.get_template(template).render(**values)
    return environment.from_string(template.read_text(encoding="utf-8")).render(**values)


def write_page(out: str | os.PathLike[str], template: str | Path, **values: Any) -> Path:
    """Render a template to the file `out`, create its folder if necessary, and return its path.

    Raise SettingError if the file cannot be written.
    """
    page = path_argument(out, "out")
    with write_atomically(page) as stream:
        stream.write(render_page(template, **values).encode(errors="replace"))
    return page


def png_address(png: bytes) -> str:
    """Return a PNG image as a data URI."""
    return "data:image/png;base64," + base64.b64encode(png).decode("ascii")
