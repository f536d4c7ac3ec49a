"""Visible content of the world: bodies, roadside objects and lamps as meshes."""

from typing import TYPE_CHECKING

from eidrive_scenario.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from eidrive_scenario.world.scene.roadside import FIRST_LABEL
    from eidrive_scenario.world.scene.visuals import DisplayState, UndrawnImage, Visuals
else:
    __getattr__ = lazy_exports(__name__, {"roadside": "FIRST_LABEL", "visuals": "DisplayState UndrawnImage Visuals"})

__all__ = ["FIRST_LABEL", "DisplayState", "UndrawnImage", "Visuals"]
