"""Renderer: rasterization and illumination in numpy only, with identical results on all machines."""

from typing import TYPE_CHECKING

from eidrive_scenario.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from eidrive_scenario.world.render.tone_mapping import tone_map, white_level
else:
    __getattr__ = lazy_exports(__name__, {"tone_mapping": "tone_map white_level"})

__all__ = ["tone_map", "white_level"]
