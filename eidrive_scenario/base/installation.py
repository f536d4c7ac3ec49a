"""Origin of the installed distribution (PEP 610), and the commands that install it again or add optional dependencies.

The distribution is on no package index, so a command names the repository, the wheel or the folder that it came from.
"""

from __future__ import annotations

import json
import shlex
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

ENGINE = "eidrive-scenario"
"""Name of the distribution."""


def install_command(extra: str) -> str:
    """Return the command that adds an extra to this installation."""
    origin = _origin()
    folder = unquote(urlsplit(origin.get("url", "")).path)
    if "dir_info" in origin and Path(folder).is_dir():
        editable = "-e " if origin["dir_info"].get("editable") else ""
        return f"pip install {editable}{shlex.quote(f'{folder}[{extra}]')}"
    return f"pip install {shlex.quote(f'{ENGINE}[{extra}]{requirement_source()}')}"


def requirement_source() -> str:
    """Return what follows the name in a requirement (PEP 508) of this installation: ` @ ADDRESS`, or nothing.

    The address is that of the repository with its commit, or of the archive. Nothing: a folder, or an installation of
    another kind.
    """
    origin = _origin()
    if "vcs_info" in origin:
        version_control = origin["vcs_info"]
        part = f"#subdirectory={origin['subdirectory']}" if "subdirectory" in origin else ""
        return f" @ {version_control['vcs']}+{origin['url']}@{version_control['commit_id']}{part}"
    return f" @ {origin['url']}" if "archive_info" in origin else ""


@cache
def _origin() -> dict[str, Any]:
    """Return the content of direct_url.json; nothing if there is none."""
    try:
        text = distribution(ENGINE).read_text("direct_url.json")
    except PackageNotFoundError:
        return {}
    origin: dict[str, Any] = json.loads(text) if text else {}
    return origin
