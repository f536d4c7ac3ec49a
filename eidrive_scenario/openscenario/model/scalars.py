"""Scalar types of the standard that Python has no word for, and names that point to something."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated


@dataclass(frozen=True)
class Limits:
    """The smallest and the largest value of an integer type."""

    lowest: int
    highest: int


@dataclass(frozen=True)
class NameOf:
    """What a name points to: entity, parameter, variable, monitor, signal controller, controller, element, sensor."""

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
