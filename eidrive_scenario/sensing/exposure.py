"""From the light that reaches a lens to the numbers of a picture: exposure, noise, tones."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from eidrive_scenario.arrays import Floats
from eidrive_scenario.sensing.settings import CameraSettings, NoiseSettings
from eidrive_scenario.world.render.tone_mapping import tone_map, white_level

LENS = 0.65
"""H = 0.65 L t / N²: exposure [lx s] behind a lens of f-number N of a thing of luminance L [cd/m²] (ISO 12232)."""
SATURATION = 78.0
"""H_sat = 78 / S: exposure at which a sensor of speed S saturates [lx s] (ISO 12232)."""
BASE_SPEED = 100.0
"""Speed of the sensor at a gain of 0 dB."""
_AT_ONCE = 49_152
"""Numbers that are developed at once: as many as a processor keeps near it; a multiple of four."""


@dataclass(frozen=True)
class Exposure:
    """time [s], gain [dB], and the luminance that fills the sensor's wells [cd/m²]."""

    time: float
    gain: float
    saturation: float


def metered(luminance: Floats, settings: CameraSettings) -> Exposure:
    """The exposure of a picture (H, W, 3) [cd/m²]: what the settings fix, and for the rest an ideal meter.

    It turns up time first, then gain, up to their limits.
    """
    optics = SATURATION / BASE_SPEED * settings.f_number**2 / LENS
    time, gain = settings.exposure_time, settings.gain
    if time is None or gain is None:
        wanted = optics / white_level(luminance)
        if time is None:
            time = min(wanted / (1.0 if gain is None else _linear(gain)), settings.max_exposure_time)
        if gain is None:
            gain = min(max(20.0 * math.log10(wanted / time), 0.0), settings.max_gain)
    return Exposure(time, gain, optics / (time * _linear(gain)))


def develop(
    luminance: Floats, exposure: Exposure, noise: NoiseSettings | None, draws: np.random.Generator
) -> NDArray[np.uint8]:
    """The picture (H, W, 3) that a sensor makes of luminance (H, W, 3) [cd/m²]; clips what overfills its wells.

    Noise is the linear model of EMVA 1288 (release 4.0): of a mean of n electrons, their number varies by
    n + read noise²; gain shows fewer electrons as full scale. Electrons are drawn as normal numbers, one per channel.
    """
    picture = np.empty(luminance.shape, dtype=np.uint8)
    light, shown = luminance.reshape(-1), picture.reshape(-1)
    for start in range(0, len(light), _AT_ONCE):
        part = slice(start, start + _AT_ONCE)
        signal = light[part] * np.float32(1.0 / exposure.saturation)
        if noise is not None:
            signal += noise_of(signal, exposure, noise, draws)
        shown[part] = tone_map(signal)
    return picture


def noise_of(signal: Floats, exposure: Exposure, noise: NoiseSettings, draws: np.random.Generator) -> Floats:
    """Noise, as shares of full scale, of a signal given as such."""
    well = noise.full_well / _linear(exposure.gain)
    deviation: Floats = np.maximum(signal, np.float32(0.0))
    deviation *= np.float32(1.0 / well)
    deviation += np.float32((noise.read_noise / well) ** 2)
    np.sqrt(deviation, out=deviation)
    # Four numbers of 16 bits in each that the generator gives.
    raw: NDArray[np.uint64] = draws.bit_generator.random_raw(-(-signal.size // 4))
    deviation *= _NORMAL.take(raw.view(np.uint16)[: signal.size]).reshape(signal.shape)
    return deviation


def _quantiles(count: int) -> Floats:
    """Equally likely normal numbers, of deviation 1: drawing among them is four times as fast as drawing normally."""
    numbers = ndtri((np.arange(count) + 0.5) / count)
    found: Floats = (numbers / numbers.std()).astype(np.float32)
    return found


_NORMAL = _quantiles(1 << 16)


def _linear(gain: float) -> float:
    return float(10.0 ** (gain / 20.0))
