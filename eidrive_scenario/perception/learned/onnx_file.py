"""Writer of ONNX models: the messages of onnx.proto (IR version 8) that the networks need, as protocol buffers.

Sources: onnx.proto of the ONNX project, and the encoding of protocol buffers (varints, and fields with a length).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

IR_VERSION = 8
OPSET = 13
"""Version of the operators; OpenCV, ONNX Runtime and OpenVINO support it."""

_VARINT, _LENGTH, _FIXED32 = 0, 2, 5
_FLOAT = 1
"""TensorProto.FLOAT."""
_ELEMENT_TYPES = {"float32": _FLOAT, "uint8": 2, "int8": 3, "int32": 6}
"""TensorProto.DataType by type in numpy."""
_ATTRIBUTE_TYPES = {float: 1, int: 2, str: 3, tuple: 7}
"""AttributeProto.AttributeType by type in Python; tuples are of whole numbers."""

Attribute = float | int | str | tuple[int, ...]


@dataclass(frozen=True)
class Node:
    """Operation of a graph: its operator, names of its inputs and of its output, and attributes."""

    operator: str
    inputs: Sequence[str]
    output: str
    attributes: Mapping[str, Attribute] = field(default_factory=dict)


def onnx_model(
    nodes: Sequence[Node],
    tensors: Mapping[str, NDArray[Any]],
    inputs: Mapping[str, Sequence[int]],
    outputs: Mapping[str, Sequence[int]],
) -> bytes:
    """Return the content of an ONNX file.

    nodes            operations in the order of execution
    tensors          constants by name, in single precision or of integers with 8 or 32 bits
    inputs, outputs  shapes by name
    """
    graph = b"".join(
        [
            *(_block(1, _node(node)) for node in nodes),
            _text(2, "network"),
            *(_block(5, _tensor(name, value)) for name, value in tensors.items()),
            *(_block(11, _value_info(name, shape)) for name, shape in inputs.items()),
            *(_block(12, _value_info(name, shape)) for name, shape in outputs.items()),
        ]
    )
    operators = _block(8, _text(1, "") + _integer(2, OPSET))
    return _integer(1, IR_VERSION) + _text(2, "eidrive-scenario") + _block(7, graph) + operators


def _node(node: Node) -> bytes:
    return b"".join(
        [
            *(_text(1, name) for name in node.inputs),
            _text(2, node.output),
            _text(3, node.output),
            _text(4, node.operator),
            *(_block(5, _attribute(name, value)) for name, value in node.attributes.items()),
        ]
    )


def _attribute(name: str, value: Attribute) -> bytes:
    if isinstance(value, tuple):
        content = b"".join(_integer(8, item) for item in value)
    elif isinstance(value, str):
        content = _text(4, value)
    elif isinstance(value, int):
        content = _integer(3, value)
    else:
        content = _varint(2 << 3 | _FIXED32) + np.array(value, dtype="<f4").tobytes()
    return _text(1, name) + content + _integer(20, _ATTRIBUTE_TYPES[type(value)])


def _tensor(name: str, value: NDArray[Any]) -> bytes:
    shape = b"".join(_integer(1, side) for side in value.shape)
    content = value.astype(value.dtype.newbyteorder("<")).tobytes()
    return shape + _integer(2, _ELEMENT_TYPES[value.dtype.name]) + _text(8, name) + _block(9, content)


def _value_info(name: str, shape: Sequence[int]) -> bytes:
    sides = b"".join(_block(1, _integer(1, side)) for side in shape)
    tensor_type = _integer(1, _FLOAT) + _block(2, sides)
    return _text(1, name) + _block(2, _block(1, tensor_type))


def _text(number: int, text: str) -> bytes:
    return _block(number, text.encode())


def _block(number: int, content: bytes) -> bytes:
    """Return a field whose content follows its length: a text, bytes or another message."""
    return _varint(number << 3 | _LENGTH) + _varint(len(content)) + content


def _integer(number: int, value: int) -> bytes:
    return _varint(number << 3 | _VARINT) + _varint(value)


def _varint(value: int) -> bytes:
    """Return a number of at least 0, seven bits per byte, the lowest first."""
    encoded = bytearray()
    while value > 0x7F:
        encoded.append(value & 0x7F | 0x80)
        value >>= 7
    encoded.append(value)
    return bytes(encoded)
