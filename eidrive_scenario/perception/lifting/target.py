"""The object of an image box, and the agreement of lidar points with it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.perception.lidar.box_fit import Fit

GATE = 3.0
"""Maximum deviation of the distance of a cluster from the expected one, in standard deviations."""
UNLIKELY_HEADING = 9.0
"""Cost of a heading that image and map exclude, as squared standard deviations."""


class Target(NamedTuple):
    """Object of an image box that is searched in the points.

    box      in the image [px];  classes  possible classes
    distance expected from the camera [m], and the standard deviation of its logarithm
    depth    from the visible points of the object to its center, approximately [m]
    heading  in the level frame, used if there are too few points to determine one [rad]
    first    first of the tested headings, evenly over half a turn [rad];  costs  of each, the minimum is 0
    center   expected center (2,) [m];  covariance  of it (2, 2) [m²]; both in the level frame
    edges_in_image  whether left, top, right and bottom edge are those of the object, not of the image
    """

    box: list[float]
    classes: tuple[str, ...]
    distance: float
    deviation: float
    depth: float
    heading: float
    first: float
    costs: list[float]
    center: Array
    covariance: Array
    edges_in_image: list[bool]

    @property
    def cut(self) -> bool:
        """Whether the border of the image cuts its left or right side."""
        return not (self.edges_in_image[0] and self.edges_in_image[2])

    def agreement(self, fit: Fit) -> float:
        """Return the agreement of a box with the expected center, at most 1.

        It is Cauchy's density of the squared distance in units of both covariances, as either may belong to another
        object.
        """
        off = np.array(fit.box[:2]) - self.center
        return 1.0 / (1.0 + 0.5 * float(off @ np.linalg.solve(self.covariance + fit.covariance, off)))

    def heading_cost(self, heading: float) -> float:
        """Return the cost of a heading by image and map, interpolated between tested headings.

        The maximum is UNLIKELY_HEADING, because shapes differ and vehicles turn.
        """
        count = len(self.costs)
        place = (heading - self.first) % math.pi / math.pi * count
        row, part = int(place), place - int(place)
        cost = (1.0 - part) * self.costs[row % count] + part * self.costs[(row + 1) % count]
        return min(cost, UNLIKELY_HEADING)

    def likelihood(self, distance: float) -> float:
        """Return the agreement of a distance [m] with the expected one, at most 1.

        It is 0 outside the gate, except for objects that the border cuts, whose distance is not certain.
        """
        off = math.log(max(distance + self.depth, 0.5) / self.distance) / self.deviation
        if abs(off) <= GATE:
            return math.exp(-0.5 * off * off)
        return math.exp(-0.5 * GATE * GATE) if self.cut else 0.0
