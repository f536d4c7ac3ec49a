"""Scalar types of the standard that Python does not have, and types of references by name."""

from __future__ import annotations

from typing import Annotated

import msgspec


class Limits(msgspec.Struct, frozen=True):
    """Minimum and maximum value of an integer type."""

    lowest: int
    highest: int


class NameOf(msgspec.Struct, frozen=True):
    """Kind of the referenced element: entity, parameter, variable, monitor, controller, sensor and others."""

    kind: str


INT = Limits(-(2**31), 2**31 - 1)

UnsignedInt = Annotated[int, Limits(0, 2**32 - 1)]
UnsignedShort = Annotated[int, Limits(0, 2**16 - 1)]

EntityName = Annotated[str, NameOf("entity")]
ParameterName = Annotated[str, NameOf("parameter")]
VariableName = Annotated[str, NameOf("variable")]
MonitorName = Annotated[str, NameOf("monitor")]
ControllerName = Annotated[str, NameOf("controller")]
SensorName = Annotated[str, NameOf("sensor")]
SignalControllerName = Annotated[str, NameOf("signal controller")]
StoryboardElementName = Annotated[str, NameOf("storyboard element")]
