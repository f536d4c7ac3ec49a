"""Colors of the replay: distinct for all kinds of color vision, and visible on the road."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.reporting.replay.colors import COLORS

LINES = ("plan", "braking", "link", "lost")
VISION = {
    "normal": np.eye(3),
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
"""Linear RGB as seen with severity 1.0: Machado, Oliveira and Fernandes, IEEE TVCG 15(6), 2009, table 1."""
TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
"""Linear sRGB to CIE XYZ: IEC 61966-2-1."""


def linear(color: str) -> Array:
    """Return the linear RGB values of a color."""
    values = np.array([int(color[start : start + 2], 16) for start in (1, 3, 5)]) / 255.0
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def lab(rgb: Array) -> Array:
    """Return CIE L*a*b* (1976) of linear RGB values with the white of sRGB."""
    ratio = TO_XYZ @ np.clip(rgb, 0.0, 1.0) / (TO_XYZ @ np.ones(3))
    x, y, z = np.where(ratio > 0.008856, np.cbrt(ratio), 7.787 * ratio + 16.0 / 116.0)
    return np.array([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)])


def contrast(first: str, second: str) -> float:
    """Return the contrast of two colors: WCAG 2.2."""
    low, high = sorted(float(TO_XYZ[1] @ linear(color)) for color in (first, second))
    return (high + 0.05) / (low + 0.05)


def test_lab_of_white_and_red_are_published_values() -> None:
    """Lindbloom's calculator with D65: sRGB red is 53.24, 80.09, 67.20."""
    assert lab(linear("#ffffff")) == pytest.approx([100.0, 0.0, 0.0], abs=0.1)
    assert lab(linear("#ff0000")) == pytest.approx([53.24, 80.09, 67.20], abs=0.1)


@pytest.mark.parametrize("mode", COLORS)
@pytest.mark.parametrize("vision", VISION)
def test_lines_of_map_differ_for_each_color_vision(mode: str, vision: str) -> None:
    colors = {name: lab(np.asarray(VISION[vision]) @ linear(COLORS[mode][name])) for name in LINES}
    for one, other in itertools.combinations(LINES, 2):
        assert float(np.linalg.norm(colors[one] - colors[other])) >= 20.0, (one, other)


@pytest.mark.parametrize("mode", COLORS)
def test_lines_contrast_with_road(mode: str) -> None:
    for name in LINES:
        assert contrast(COLORS[mode][name], COLORS[mode]["lane"]) >= 2.0, name


def test_dark_mode_has_dark_map_and_the_same_names() -> None:
    light, dark = COLORS["light"], COLORS["dark"]
    assert light.keys() == dark.keys()
    assert light["lanes"].keys() == dark["lanes"].keys()
    assert len(light["senders"]) == len(dark["senders"])
    for name in ("ground", "lane", "house"):
        assert contrast(dark[name], "#000000") < 4.5 < contrast(light[name], "#000000")
