"""Conversion of luminance to image values: exposure, noise, tone mapping."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Floats
from eidrive_scenario.sensing.settings import CameraSettings, NoiseSettings
from eidrive_scenario.world.render.tone_mapping import tone_map, white_level

LENS = 0.65
"""H = 0.65 L t / N²: exposure [lx s] behind a lens of f-number N for a luminance L [cd/m²] (ISO 12232)."""
SATURATION = 78.0
"""H_sat = 78 / S: exposure that saturates a sensor of speed S [lx s] (ISO 12232)."""
BASE_SPEED = 100.0
"""Speed of the sensor at a gain of 0 dB."""
_BLOCK_SIZE = 49_152
"""Number of values per block, which fit into the processor cache; a multiple of four."""


@dataclass(frozen=True)
class Exposure:
    """Exposure time [s], gain [dB], and the luminance at saturation [cd/m²]."""

    time: float
    gain: float
    saturation: float


def meter_exposure(luminance: Floats, settings: CameraSettings) -> Exposure:
    """Return the exposure of an image (H, W, 3) [cd/m²]: fixed settings, and an ideal meter for the others.

    The meter increases time first, then gain, up to their limits.
    """
    optics = SATURATION / BASE_SPEED * settings.f_number**2 / LENS
    time, gain = settings.exposure_time, settings.gain
    if time is None or gain is None:
        required = optics / white_level(luminance)
        if time is None:
            time = min(required / (1.0 if gain is None else _linear(gain)), settings.max_exposure_time)
        if gain is None:
            gain = min(max(20.0 * math.log10(required / time), 0.0), settings.max_gain)
    return Exposure(time, gain, optics / (time * _linear(gain)))


def develop(
    luminance: Floats, exposure: Exposure, noise: NoiseSettings | None, draws: np.random.Generator
) -> NDArray[np.uint8]:
    """Return the image (H, W, 3) of luminance (H, W, 3) [cd/m²]; values above saturation are clipped.

    Noise is the linear model of EMVA 1288 (release 4.0): for a mean of n electrons, the variance is n + read noise²;
    gain reduces the electrons of full scale. Electrons are drawn from a normal distribution, one value per channel.
    """
    image = np.empty(luminance.shape, dtype=np.uint8)
    light, values = luminance.reshape(-1), image.reshape(-1)
    for start in range(0, len(light), _BLOCK_SIZE):
        part = slice(start, start + _BLOCK_SIZE)
        signal = light[part] * np.float32(1.0 / exposure.saturation)
        if noise is not None:
            signal += noise_of(signal, exposure, noise, draws)
        values[part] = tone_map(signal)
    return image


def noise_of(signal: Floats, exposure: Exposure, noise: NoiseSettings, draws: np.random.Generator) -> Floats:
    """Return the noise of a signal; both as shares of full scale."""
    well = noise.full_well / _linear(exposure.gain)
    deviation: Floats = np.maximum(signal, np.float32(0.0))
    deviation *= np.float32(1.0 / well)
    deviation += np.float32((noise.read_noise / well) ** 2)
    np.sqrt(deviation, out=deviation)
    # Each value of the generator contains four numbers of 16 bits.
    raw: NDArray[np.uint64] = draws.bit_generator.random_raw(-(-signal.size // 4))
    deviation *= _normal_values(1 << 16).take(raw.view(np.uint16)[: signal.size]).reshape(signal.shape)
    return deviation


@cache
def _normal_values(count: int) -> Floats:
    """Return equally likely values of the standard normal distribution.

    Drawing from them is four times as fast as drawing normal values.
    """
    from scipy.special import ndtri

    numbers = ndtri((np.arange(count) + 0.5) / count)
    found: Floats = (numbers / numbers.std()).astype(np.float32)
    return found


def _linear(gain: float) -> float:
    return float(10.0 ** (gain / 20.0))
