"""Conversion of luminance to pixel values: exposure metering and a tone curve."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Floats
from eidrive_scenario.world.camera import CameraImage, Radiance

LUMA: Array = np.array([0.2126, 0.7152, 0.0722])
"""Luminance weights of linear sRGB (IEC 61966-2-1)."""
HEADROOM = 4.0
"""Luminance of white in units of the luminance that becomes middle light gray before the shoulder."""
BRIGHTNESS = 0.85
"""Factor of the published key, which keeps white road markings below white."""
DARKEST = 0.03
BLACK = 0.02
"""Minimum luminance that affects the exposure [cd/m²]."""
_STEPS = 8192


def white_level(luminance: Floats) -> float:
    """Return the luminance of an image (H, W, 3) that becomes white [cd/m²].

    The mean of log luminance is mapped to a key that decreases with darkness, so that night images are dark: 1.03 - 2 /
    (2 + log10(L + 1)) (Krawczyk, Myszkowski, Seidel: Perceptual effects in real-time tone mapping, 2005).
    """
    sampled = np.maximum(_luma(np.ascontiguousarray(luminance[::2, ::2])), np.float32(BLACK))
    mean = math.exp(float(np.log(sampled).mean()))
    key = max(BRIGHTNESS * (1.03 - 2.0 / (2.0 + math.log10(mean + 1.0))), DARKEST)
    return HEADROOM * mean / key


def _luma(luminance: Floats) -> Floats:
    """Return the luminance (H, W) of an image (H, W, 3)."""
    red, green, blue = (np.float32(part) for part in LUMA)
    found: Floats = luminance[..., 0] * red + luminance[..., 1] * green + luminance[..., 2] * blue
    return found


def tone_map(signal: Floats) -> NDArray[np.uint8]:
    """Return the pixel values of an image given as shares of white; higher values are clipped."""
    steps: Floats = np.clip(signal, np.float32(0.0), np.float32(1.0))
    steps *= np.float32(_STEPS - 1)
    return _TONES.take(steps.astype(np.uint16))


def ideal_image(seen: Radiance) -> CameraImage:
    """Return the image of an ideal camera that receives this light: automatic exposure, no noise."""
    rgb = tone_map(seen.luminance * np.float32(1.0 / white_level(seen.luminance)))
    return CameraImage(rgb, seen.depth, seen.segmentation)


def _tone_curve() -> NDArray[np.uint8]:
    """Return a shoulder for highlights (Reinhard et al., Photographic tone reproduction, 2002, eq. 4) and the sRGB
    curve.
    """
    scaled = np.linspace(0.0, HEADROOM, _STEPS)
    tone = scaled * (1.0 + scaled / HEADROOM**2) / (1.0 + scaled)
    encoded = np.where(tone <= 0.0031308, 12.92 * tone, 1.055 * tone ** (1 / 2.4) - 0.055)
    return np.rint(255.0 * np.clip(encoded, 0.0, 1.0)).astype(np.uint8)


_TONES = _tone_curve()
