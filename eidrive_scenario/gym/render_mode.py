"""Selection of the renderer of an environment by its render mode."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from eidrive_scenario.errors import Diagnostic, SettingError, quoted
from eidrive_scenario.gym.render_settings import RENDER_MODES, RenderSettings
from eidrive_scenario.gym.station_interface import parse_mapping
from eidrive_scenario.simulation import RunSettings

if TYPE_CHECKING:
    from eidrive_scenario.gym.rendering import Renderer


def build_renderer(mode: str | None, settings: Any, station: str) -> Renderer | None:
    """Return the renderer of a mode with RenderSettings or a mapping of them; None without a mode.

    station  station that the pictures follow

    Raise SettingError for an unknown mode or an invalid setting.
    """
    parsed = parse_mapping(RenderSettings, settings, "render")
    if mode is None:
        return None
    if mode not in RENDER_MODES:
        raise SettingError(Diagnostic(f"render_mode is {quoted(mode)}", f"give {' or '.join(RENDER_MODES)}, or None"))
    from eidrive_scenario.gym.rendering import Renderer  # imports OpenCV

    return Renderer(station, parsed)


def frames_per_second(settings: RunSettings, ticks_per_step: int) -> float:
    """Return the number of steps per second of simulated time."""
    return 1.0 / (settings.dt * ticks_per_step)
