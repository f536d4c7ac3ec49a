"""World of a run: bodies, motion, contacts, rays and images. The only package that imports pybullet.

`World` is imported on first access, so that the types of this package are available without loading pybullet.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from eidrive_scenario.world.world import World

__all__ = ["World"]


def __getattr__(name: str) -> Any:
    if name == "World":
        from eidrive_scenario.world.world import World

        return World
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
