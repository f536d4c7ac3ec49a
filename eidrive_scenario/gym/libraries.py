"""Gymnasium, which is an optional dependency of this project."""

from __future__ import annotations

from eidrive_scenario.base.installation import install_command
from eidrive_scenario.errors import Diagnostic, SettingError

INSTALL = f"install it: {install_command('gym')}"
"""Hint of the error for a missing library."""

try:
    import gymnasium as gymnasium
    from gymnasium import spaces as spaces
except ImportError as error:
    raise SettingError(Diagnostic("Gymnasium is not installed", INSTALL)) from error
