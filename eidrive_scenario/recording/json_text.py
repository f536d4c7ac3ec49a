"""JSON text of records in the encoding of `codec`, written and read by msgspec where it agrees with that encoding.

msgspec writes non-finite numbers as null, and does not read spelled ones. Such numbers in arrays are spelled and read
by hooks. A record with a non-finite number outside of arrays is encoded and decoded by the codec.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import msgspec
import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.recording.codec import codec, encode_array


class JsonText:
    """Encoder and decoder of records of one type as JSON text in UTF-8.

    Raise TypeError for a type without an encoding.
    """

    def __init__(self, kind: type) -> None:
        self._codec = codec(kind)
        self._arrays: dict[int, tuple[Array, msgspec.Raw]] = {}
        """Text of each array of the record by its `id`, with the array, so that no other one gets this `id`."""
        self._encoder = msgspec.json.Encoder(enc_hook=self._plain)
        # The hook gets arrays: other types that msgspec does not support have no encoding
        self._decoder: msgspec.json.Decoder[Any] = msgspec.json.Decoder(
            kind, dec_hook=lambda array_kind, data: codec(array_kind).decode(data)
        )

    def decode(self, data: bytes) -> Any:
        """Return the record of a text. Sequences are lists or tuples, and unknown fields are ignored where possible.

        Raise ValueError, TypeError or LookupError for a text that is not of this type, and RecursionError for one that
        is nested too deeply.
        """
        try:
            return self._decoder.decode(data)
        except msgspec.ValidationError:
            return self._codec.decode(msgspec.json.decode(data))

    def encode(self, record: Any) -> bytes:
        """Return the text, which `codec(kind).decode` reads after parsing."""
        if self._codec.is_plain is None or self._codec.is_plain(record):
            self._arrays.clear()
            return self._encoder.encode(record)
        return msgspec.json.encode(self._codec.encode(record))

    def _plain(self, value: Any) -> Any:
        """Return a value of a type that msgspec does not support as one that it supports.

        Of arrays, most occur several times in a record: each is encoded once.
        """
        if type(value) is np.ndarray:
            stored = self._arrays.get(id(value))
            if stored is None:
                text = msgspec.Raw(msgspec.json.encode(encode_array(value)))
                stored = self._arrays[id(value)] = value, text
            return stored[1]
        if isinstance(value, np.generic):
            return value.item()
        if isinstance(value, Mapping):
            return dict(value)
        if isinstance(value, Sequence):
            return list(value)
        raise TypeError(f"{type(value).__name__}: no JSON encoding is defined for this type")
