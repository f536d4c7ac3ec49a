"""Linear layer on the channels of each cell."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Floats
from eidrive_scenario.perception.learned.graphs import Graph


class CellLayer(NamedTuple):
    """Linear layer from I to O channels, a 1x1 convolution: weight (O, I) and bias (O,).

    It is computed by numpy with every runtime, so that equal features have equal outputs, wherever they come from.
    """

    weight: Floats
    bias: Floats

    @classmethod
    def of(cls, arrays: Mapping[str, NDArray[Any]], name: str, inputs: int, outputs: int) -> CellLayer:
        """Return the layer with these weights of a network. Raise ValueError if they are missing or do not fit."""
        graph = Graph(arrays)
        weight = graph.array(f"{name}.weight", (outputs, inputs, 1, 1)).reshape(outputs, inputs)
        return cls(weight, graph.array(f"{name}.bias", (outputs,)))

    def __call__(self, values: Floats) -> Floats:
        """Return the outputs (O, ...) for the channels (I, ...) of cells."""
        outputs: Floats = self.weight @ values.reshape(len(values), -1)
        outputs += self.bias[:, None]
        return outputs.reshape(len(outputs), *values.shape[1:])
