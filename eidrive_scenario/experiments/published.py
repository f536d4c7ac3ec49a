"""Numbers of the EI-Drive paper: Tables II and III, and the counts of detected objects.

The distances of single episodes and the counts are those of record files in the history of EI-Drive's repository.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Published:
    """Published mean, standard deviation and distances of the five episodes [m]."""

    mean: float
    sd: float
    episodes: tuple[float, ...]


TABLE_2 = {
    ("coop/scenario_1", "oracle", "none"): Published(3.26, 0.08, (3.2948, 3.2945, 3.2914, 3.1012, 3.2947)),
    ("coop/scenario_1", "oracle", "cooperation"): Published(3.98, 0.16, (3.8461, 3.8395, 3.8452, 4.1794, 4.1811)),
    ("coop/scenario_1", "oracle", "latency"): Published(2.50, 0.68, (1.9975, 1.9975, 3.3246, 3.3245, 1.8549)),
    ("coop/scenario_1", "oracle", "error"): Published(3.15, 1.07, (4.0286, 1.8226, 4.0330, 1.8549, 4.0292)),
    ("coop/scenario_1", "yolov5", "none"): Published(3.32, 0.00, (3.3174, 3.3218, 3.3179, 3.3186, 3.3192)),
    ("coop/scenario_1", "yolov5", "cooperation"): Published(5.09, 0.13, (4.9683, 5.2543, 5.2461, 4.9905, 4.9690)),
    ("coop/scenario_1", "yolov5", "latency"): Published(3.62, 0.08, (3.5766, 3.5755, 3.7794, 3.5766, 3.5766)),
    ("coop/scenario_1", "yolov5", "error"): Published(4.84, 0.55, (4.9683, 5.2563, 5.2470, 3.7794, 4.9684)),
    ("coop/scenario_2", "oracle", "none"): Published(3.90, 0.01, (3.9105, 3.9156, 3.8966, 3.8785, 3.9165)),
    ("coop/scenario_2", "oracle", "cooperation"): Published(4.42, 0.00, (4.4243, 4.4243, 4.4243, 4.4243, 4.4245)),
    ("coop/scenario_2", "oracle", "latency"): Published(3.50, 0.01, (3.5012, 3.4880, 3.5024, 3.5010, 3.5052)),
    ("coop/scenario_2", "oracle", "error"): Published(4.32, 0.21, (4.4409, 4.4243, 3.9156, 4.4243, 4.4243)),
    ("coop/scenario_2", "yolov5", "none"): Published(3.91, 0.00, (3.9183, 3.9182, 3.9191, 3.9201, 3.9183)),
    ("coop/scenario_2", "yolov5", "cooperation"): Published(4.58, 0.04, (4.5289, 4.5289, 4.6107, 4.6105, 4.6105)),
    ("coop/scenario_2", "yolov5", "latency"): Published(3.40, 0.00, (3.3985, 3.3985, 3.3991, 3.3985, 3.3996)),
    ("coop/scenario_2", "yolov5", "error"): Published(4.23, 0.49, (3.9201, 4.6104, 3.3985, 4.6105, 4.6105)),
}
"""Minimum distance between the centers by scenario, detector and arm (Table II)."""


@dataclass(frozen=True)
class PublishedSuccess:
    """Published share of runs without a collision, with its standard deviation, and minimum distance [m]."""

    rate: float
    rate_sd: float
    distance: float
    distance_sd: float


TABLE_3 = {
    ("coop/scenario_5", "both"): PublishedSuccess(1.0, 0.0, 3.51, 0.55),
    ("coop/scenario_5", "rsu"): PublishedSuccess(0.9333, 0.0471, 3.03, 0.03),
    ("coop/scenario_5", "vehicle"): PublishedSuccess(0.2051, 0.0363, 2.98, 0.48),
    ("coop/scenario_6", "both"): PublishedSuccess(0.8205, 0.0725, 4.05, 1.07),
    ("coop/scenario_6", "rsu"): PublishedSuccess(0.7846, 0.0166, 3.10, 0.08),
    ("coop/scenario_6", "vehicle"): PublishedSuccess(0.4872, 0.0363, 3.32, 0.63),
    ("coop/scenario_7", "both"): PublishedSuccess(1.0, 0.0, 3.83, 0.11),
    ("coop/scenario_7", "rsu"): PublishedSuccess(0.9833, 0.0236, 3.60, 0.00),
    ("coop/scenario_7", "vehicle"): PublishedSuccess(0.0, 0.0, 2.82, 0.03),
    ("coop/scenario_8", "both"): PublishedSuccess(1.0, 0.0, 3.60, 0.00),
    ("coop/scenario_8", "rsu"): PublishedSuccess(1.0, 0.0, 3.61, 0.01),
    ("coop/scenario_8", "vehicle"): PublishedSuccess(0.0, 0.0, 2.88, 0.04),
}
"""Success rates by scenario and senders (Table III)."""


@dataclass(frozen=True)
class PublishedCount:
    """Number of boxes of the ego in one run of 400 time steps: mean, minimum and maximum."""

    mean: float
    least: int
    most: int


COUNTS = {
    ("coop/scenario_3", "oracle", "none"): PublishedCount(9.1, 6, 11),
    ("coop/scenario_3", "oracle", "cooperation"): PublishedCount(14.4, 9, 18),
    ("coop/scenario_3", "yolov5", "none"): PublishedCount(2.7, 0, 9),
    ("coop/scenario_3", "yolov5", "cooperation"): PublishedCount(4.4, 0, 12),
    ("coop/scenario_4", "oracle", "none"): PublishedCount(8.5, 6, 10),
    ("coop/scenario_4", "oracle", "cooperation"): PublishedCount(14.7, 9, 18),
    ("coop/scenario_4", "yolov5", "none"): PublishedCount(2.8, 0, 6),
    ("coop/scenario_4", "yolov5", "cooperation"): PublishedCount(10.4, 1, 17),
}
"""Counts by scenario, detector and arm (figure of the number of detected objects)."""

RATIOS = {
    ("coop/scenario_3", "oracle"): 1.58,
    ("coop/scenario_3", "yolov5"): 1.63,
    ("coop/scenario_4", "oracle"): 1.73,
    ("coop/scenario_4", "yolov5"): 3.7,
}
"""Mean count with cooperation over that without, by scenario and detector."""
