"""Orientations of positions: absolute, or relative to a base pose."""

from __future__ import annotations

from eidrive_scenario.geometry import wrap_angle
from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import Pose


def oriented(orientation: model.Orientation | None, base: Pose) -> Pose:
    """Return `base` with an orientation; missing pitch and roll follow the surface at the base."""
    h, p, r = angles(orientation, base)
    level = base.turned(wrap_angle(h - base.h))
    if orientation is None:
        p, r = level.p, level.r
    elif orientation.type is model.ReferenceContext.RELATIVE:
        p, r = level.p + (orientation.p or 0.0), level.r + (orientation.r or 0.0)
    else:
        p, r = level.p if orientation.p is None else p, level.r if orientation.r is None else r
    return Pose(base.x, base.y, base.z, h, p, r)


def angles(orientation: model.Orientation | None, base: Pose) -> tuple[float, float, float]:
    """Return heading, pitch and roll [rad]; relative ones are added to those of the base, missing ones are 0."""
    if orientation is None:
        return base.h, base.p, base.r
    h, p, r = orientation.h or 0.0, orientation.p or 0.0, orientation.r or 0.0
    if orientation.type is model.ReferenceContext.RELATIVE:
        return wrap_angle(base.h + h), base.p + p, base.r + r
    return h, p, r
