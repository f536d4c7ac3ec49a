"""Where a command writes: never over what it reads, and never twice into one file."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from eidrive_scenario.errors import Diagnostic, SettingError


def check_output_paths(written: Mapping[str, str | Path | None], read: Iterable[str | Path | None]) -> None:
    """Refuse to write over a file that is read, or two things into one file.

    written  files by the option that names them; None where the option is not given
    read     files, or anything else that an option may be, such as the name of a profile

    Raise SettingError.
    """
    inputs = {os.path.realpath(place) for place in read if place is not None and os.path.isfile(place)}
    taken: dict[str, str] = {}
    for option, place in written.items():
        if place is None or (os.path.exists(place) and not os.path.isfile(place)):
            continue
        real = os.path.realpath(place)
        if real in inputs:
            raise SettingError(Diagnostic(f"{option} would overwrite what is read", "choose another place", str(place)))
        if real in taken:
            raise SettingError(Diagnostic(f"{taken[real]} and {option} name one file", "give each its own", str(place)))
        taken[real] = option
