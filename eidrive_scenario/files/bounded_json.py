"""JSON from untrusted files, bounded in size, number of values and depth."""

from __future__ import annotations

import json
from typing import Any

MAX_VALUES = 10_000_000
"""Maximum number of values in a document. Each takes less than 100 bytes of memory in addition to its text."""


def load_json(data: bytes, max_values: int = MAX_VALUES, *, max_depth: int | None = None) -> Any:
    """Return the values of a JSON document.

    Raise ValueError if the document is not valid JSON, has more than `max_values` values, or is nested deeper than
    `max_depth` or than Python can read.
    """
    check_values(data, max_values)
    try:
        document = json.loads(data.decode())
    except UnicodeDecodeError as error:
        raise ValueError(f"the document is not UTF-8 (byte {error.start})") from None
    except RecursionError:
        raise ValueError("the document is nested too deeply") from None
    if max_depth is not None and _is_deeper(document, max_depth):
        raise ValueError(f"the document is nested deeper than {max_depth} levels")
    return document


def check_values(data: bytes, max_values: int) -> None:
    """Raise ValueError if a JSON document may have more than `max_values` values."""
    if data.count(b",") + data.count(b"[") + data.count(b"{") > max_values:
        raise ValueError(f"the document has more than {max_values} values")


def _is_deeper(document: Any, levels: int) -> bool:
    layer = [document] if isinstance(document, dict | list) else []
    for _ in range(levels):
        items = (item.values() if isinstance(item, dict) else item for item in layer)
        layer = [item for inside in items for item in inside if isinstance(item, dict | list)]
        if not layer:
            return False
    return True
