"""Check of the output paths of a command."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from eidrive_scenario.errors import Diagnostic, SettingError


def check_output_paths(written: Mapping[str, str | Path | None], read: Iterable[str | Path | None]) -> None:
    """Raise SettingError if an output path is an input file, or if two options name the same file.

    written  output paths by option; None for an omitted option
    read     input files; other values of options, such as the name of a profile, are ignored
    """
    inputs = {os.path.realpath(path) for path in read if path is not None and os.path.isfile(path)}
    taken: dict[str, str] = {}
    for option, path in written.items():
        if path is None or (os.path.exists(path) and not os.path.isfile(path)):
            continue
        real = os.path.realpath(path)
        if real in inputs:
            raise SettingError(Diagnostic(f"{option} would overwrite an input file", "choose another path", str(path)))
        if real in taken:
            message = f"{taken[real]} and {option} name the same file"
            raise SettingError(Diagnostic(message, "give two different files", str(path)))
        taken[real] = option
