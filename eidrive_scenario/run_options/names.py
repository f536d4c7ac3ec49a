"""Names of options in messages: the engine writes `RunSettings.NAME`, and other surfaces replace it by their option."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.run_options.table import OPTIONS

FLAGS: Mapping[str, str] = {option.name: option.flag for option in OPTIONS}
"""Options of the command line by the name of the setting."""
_SETTING = re.compile(r"(?<!\w)RunSettings\.(\w+)")


def with_option_names(text: str, names: Mapping[str, str] = FLAGS) -> str:
    """Return a message of the engine with the options of a surface in place of `RunSettings.NAME`.

    names  options by the name of the setting; a setting without one keeps the name that it has in Python
    """
    return _SETTING.sub(lambda match: names.get(match[1], match[0]), text)


def diagnostic_with_option_names(diagnostic: Diagnostic, names: Mapping[str, str] = FLAGS) -> Diagnostic:
    """Return a diagnostic with the options of a surface in its texts, as `with_option_names`."""
    return replace(
        diagnostic,
        message=with_option_names(diagnostic.message, names),
        hint=with_option_names(diagnostic.hint, names),
        source=with_option_names(diagnostic.source, names),
    )
