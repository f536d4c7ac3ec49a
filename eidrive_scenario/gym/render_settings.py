"""Settings of pictures, and render modes."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from eidrive_scenario.settings import Settings

RENDER_MODES = ("rgb_array",)
"""Render modes. `gymnasium.make` derives `rgb_array_list` and `human` from it by wrappers."""
METADATA: dict[str, Any] = {"render_modes": [*RENDER_MODES], "render_fps": 20.0}
"""Metadata of an environment with the default time step, one tick per step."""


class RenderSettings(Settings):
    """Size of pictures.

    width, height  [pixels]
    extent         width of the section that is shown [m]
    """

    width: Annotated[int, Field(ge=64, le=4096)] = 640
    height: Annotated[int, Field(ge=64, le=4096)] = 360
    extent: Annotated[float, Field(ge=1.0, le=1e4)] = 90.0
