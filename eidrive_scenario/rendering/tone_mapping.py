"""Conversion of luminance to pixel values: exposure metering and a tone curve."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Floats
from eidrive_scenario.base.kernels import kernel
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
    return white_of_mean(math.exp(float(np.log(sampled).mean())))


def white_of_mean(mean: float) -> float:
    """Return the luminance that becomes white by the mean of log luminance, as `white_level` [cd/m²]."""
    key = max(BRIGHTNESS * (1.03 - 2.0 / (2.0 + math.log10(mean + 1.0))), DARKEST)
    return HEADROOM * mean / key


def _luma(luminance: Floats) -> Floats:
    """Return the luminance (H, W) of an image (H, W, 3)."""
    red, green, blue = (np.float32(part) for part in LUMA)
    luma: Floats = luminance[..., 0] * red + luminance[..., 1] * green + luminance[..., 2] * blue
    return luma


class PixelNoise(NamedTuple):
    """Noise of a signal s in shares of white: the variance is variance[0] + variance[1] s.

    numbers  random numbers, one for each value of the image
    normal   value of the standard normal distribution for each random number
    """

    variance: Floats
    numbers: NDArray[np.uint16]
    normal: Floats


_NO_NOISE = PixelNoise(np.zeros(2, np.float32), np.empty(0, np.uint16), np.empty(0, np.float32))


def tone_map(luminance: Floats, white: float, noise: PixelNoise = _NO_NOISE) -> NDArray[np.uint8]:
    """Return the pixel values of an image (H, W, 3) whose white has this luminance; higher values are clipped."""
    light, image = np.ascontiguousarray(luminance), np.empty(luminance.shape, dtype=np.uint8)
    _tone_map(light.reshape(-1), np.float32(1.0 / white), *noise, _TONES, image.reshape(-1))
    return image


@kernel("void(f4[::1], f4, f4[::1], u2[::1], f4[::1], u1[::1], u1[::1])")
def _tone_map(
    light: Floats, scale: np.float32, variance: Floats, numbers: NDArray[np.uint16], normal: Floats,
    tones: NDArray[np.uint8], image: NDArray[np.uint8],
) -> None:  # fmt: skip
    zero, one, steps = np.float32(0.0), np.float32(1.0), np.float32(len(tones) - 1)
    for pixel in range(len(light)):
        signal = light[pixel] * scale
        if len(numbers):
            signal += np.sqrt(max(zero, signal) * variance[1] + variance[0]) * normal[numbers[pixel]]
        image[pixel] = tones[int(min(max(zero, signal), one) * steps)]


def ideal_image(seen: Radiance) -> CameraImage:
    """Return the image of an ideal camera that receives this light: automatic exposure, no noise."""
    rgb = tone_map(seen.luminance, white_level(seen.luminance))
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
