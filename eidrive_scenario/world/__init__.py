"""World of a run: bodies, motion, contacts, rays and images. The only package that imports pybullet.

`World` is imported on first access, so that the types of this package are available without loading pybullet.
"""

from typing import TYPE_CHECKING

from eidrive_scenario.base.imports import lazy_exports

if TYPE_CHECKING:
    from eidrive_scenario.world.world import World
else:
    __getattr__ = lazy_exports(__name__, {"world": "World"})

__all__ = ["World"]
