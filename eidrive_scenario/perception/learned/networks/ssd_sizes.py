"""Sizes of the network `ssd`, and its default boxes."""

from __future__ import annotations

STRIDES = (8, 16, 32, 64, 128)
"""Distance of the cells of each scale [px of the network input]."""
SIDES = (14.0, 34.0, 76.0, 150.0, 270.0, 420.0)
"""Side of the square default box at each stride, and of one beyond the last [px of the network input]."""
ASPECTS = (1.0, 2.0, 3.0, 0.5, 1.0 / 3.0)
BOXES_PER_CELL = len(ASPECTS) + 1
"""One box of each aspect ratio, and a square one between the sides of this and the next stride."""
VARIANCES = (0.1, 0.2)
"""Scale of encoded centers and sizes, as in the code of the paper."""
MAX_LOG_SIZE = 8.0
"""Maximum logarithm of a size over that of its default box, so that its exponential is finite."""
FINE = ((32, 1), (64, 2), (64, 1), (128, 2), (128, 1), (128, 1), (128, 1))
"""Channels and stride of the separable units up to stride 8; MIDDLE up to 16, COARSE up to 32."""
MIDDLE = ((256, 2), (256, 1), (256, 1), (256, 1))
COARSE = ((384, 2), (384, 1), (384, 1))
