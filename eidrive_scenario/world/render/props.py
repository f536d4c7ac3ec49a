"""Parts that stand around: added once, moved and lit when needed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eidrive_scenario.world.meshes.palette import Colour
from eidrive_scenario.world.render.model import Array, Instance, Light, gridded, merged, model, placed


@dataclass
class _Prop:
    instance: Instance
    lit: bool = False


class Props:
    """Parts by their handles. Those that never glow are drawn as one, cut along a grid."""

    def __init__(self) -> None:
        self._props: list[_Prop] = []
        self._still: list[Instance] | None = None

    def add(self, triangles: Array, colour: Colour, material: str = "matt", label: int = -1) -> int:
        """Put up triangles (K, 3, 3), counter-clockwise from outside, of one material; returns a handle."""
        part = model({material: triangles}, {material: colour})
        self._props.append(_Prop(Instance(part, np.eye(3), np.zeros(3), label)))
        self._still = None
        return len(self._props) - 1

    def move(self, handle: int, rotation: Array, position: Array) -> None:
        """Put a part elsewhere: rotation (3, 3) and position (3,) of its frame in the world."""
        prop = self._props[handle]
        prop.instance = replace(prop.instance, rotation=rotation, position=position)
        if not prop.lit:
            self._still = None

    def glow(self, handle: int, light: Light) -> None:
        """Let a part emit this luminance [cd/m²]; (0, 0, 0) is off."""
        prop = self._props[handle]
        if not prop.lit:
            prop.lit = True
            self._still = None
        names = prop.instance.model.materials
        prop.instance = replace(prop.instance, glow=dict.fromkeys(names, light) if any(light) else {})

    def instances(self) -> Sequence[Instance]:
        """All of them, as they stand now."""
        if self._still is None:
            self._still = []
            by_label: dict[int, list[Instance]] = {}
            for prop in self._props:
                if not prop.lit:
                    by_label.setdefault(prop.instance.label, []).append(prop.instance)
            for label, group in by_label.items():
                whole = merged(placed(each.model, each.rotation, each.position) for each in group)
                self._still.append(Instance(gridded(whole), np.eye(3), np.zeros(3), label))
        return [*self._still, *(prop.instance for prop in self._props if prop.lit)]
