"""JSON from an untrusted file: bounded in size, number of values and depth."""

from __future__ import annotations

import json
from typing import Any

MAX_VALUES = 10_000_000
"""Maximum number of values in a document. Each takes less than 100 bytes of memory beside its text."""


def load_json(data: bytes, max_values: int = MAX_VALUES) -> Any:
    """Return the values of a JSON document.

    Raises ValueError if it is not valid JSON, has more than `max_values` values, or is nested too deeply.
    """
    values = data.count(b",") + data.count(b"[") + data.count(b"{")
    if values > max_values:
        raise ValueError(f"it has more than {max_values} values")
    try:
        return json.loads(data)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
