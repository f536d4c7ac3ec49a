"""Gymnasium, which is an optional dependency of this project."""

from __future__ import annotations

from eidrive_scenario.errors import Diagnostic, SettingError

INSTALL = "install it: pip install 'eidrive-scenario[gym]'"
"""Hint of the error for a missing library."""

try:
    import gymnasium
    from gymnasium import spaces
except ImportError as error:
    raise SettingError(Diagnostic("Gymnasium is not installed", INSTALL)) from error

__all__ = ["INSTALL", "gymnasium", "spaces"]
