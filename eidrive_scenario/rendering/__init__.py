"""Pictures of a world: meshes, rasterization and illumination in numpy only, with identical results on all machines."""

from __future__ import annotations

from eidrive_scenario.world.camera import PictureMaker
from eidrive_scenario.world.physics.scenery import Scenery


def picture_maker(scenery: Scenery) -> PictureMaker:
    """Return the maker of images of a world with this scenery, the argument `picture_maker` of `World`.

    The renderer is imported now, as most runs draw no image.
    """
    from eidrive_scenario.rendering.scene import Visuals

    return Visuals(scenery)
