"""Options of a run: their table, and the forms of their values."""

from eidrive_scenario.run_options.forms import (
    NO_COOPERATION,
    Criteria,
    Form,
    Seconds,
    Stacks,
    YamlSource,
    as_setting_text,
    check_seconds,
)
from eidrive_scenario.run_options.table import (
    DEFAULT_SEED,
    OPTIONS,
    PytestForm,
    RunOption,
    RunSettings,
    checked_seed,
    option_of,
    options_of,
)

__all__ = [
    "DEFAULT_SEED",
    "NO_COOPERATION",
    "OPTIONS",
    "Criteria",
    "Form",
    "PytestForm",
    "RunOption",
    "RunSettings",
    "Seconds",
    "Stacks",
    "YamlSource",
    "as_setting_text",
    "check_seconds",
    "checked_seed",
    "option_of",
    "options_of",
]
