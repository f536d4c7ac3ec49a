"""Sizes of the network `yolov5`."""

from __future__ import annotations

STRIDES = (8, 16, 32)
"""Distance of the cells of each scale [px of the network input]."""
ANCHORS_PER_SCALE = 3
WIDTHS = (16, 32, 64, 128, 256)
"""Channels at strides 2, 4, 8, 16, 32: a quarter of the large network."""
DEPTHS = (1, 2, 3, 1)
"""Bottlenecks at strides 4, 8, 16, 32: a third of the large network."""

Anchors = tuple[tuple[tuple[float, float], ...], ...]
