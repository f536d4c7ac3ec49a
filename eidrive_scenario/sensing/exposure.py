"""From the light that reaches a lens to the numbers of a picture: exposure, noise, tone curve."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.sensing.settings import CameraSettings, NoiseSettings

Floats = NDArray[np.float32]

LUMA = np.array([0.2126, 0.7152, 0.0722], dtype=np.float32)
"""Luminance of linear sRGB (IEC 61966-2-1)."""
LENS = 0.65
"""H = 0.65 L t / N²: exposure [lx s] behind a lens of f-number N of a thing of luminance L [cd/m²] (ISO 12232)."""
SATURATION = 78.0
"""H_sat = 78 / S: exposure at which a sensor of speed S saturates [lx s] (ISO 12232)."""
BASE_SPEED = 100.0
"""Speed of the sensor at a gain of 0 dB."""
HEADROOM = 4.0
"""Luminance of white, in units of that which the automatic exposure puts at full scale before the shoulder."""
_STEPS = 8192


@dataclass(frozen=True)
class Exposure:
    """time [s], gain [dB], and the luminance that fills the sensor's wells [cd/m²]."""

    time: float
    gain: float
    saturation: float


def metered(luminance: Floats, settings: CameraSettings) -> Exposure:
    """The exposure of a picture (H, W, 3) [cd/m²]: what the settings fix, and for the rest an ideal meter.

    The meter puts the mean of log luminance at a key that falls with darkness, so that a night looks like one:
    1.03 - 2 / (2 + log10(L + 1)) (Krawczyk, Myszkowski, Seidel: Perceptual effects in real-time tone mapping, 2005).
    It turns up time first, then gain, up to their limits.
    """
    optics = SATURATION / BASE_SPEED * settings.f_number**2 / LENS
    time, gain = settings.exposure_time, settings.gain
    if time is None or gain is None:
        mean = math.exp(float(np.log(np.maximum(luminance[::2, ::2] @ LUMA, 1e-4)).mean()))
        key = 1.03 - 2.0 / (2.0 + math.log10(mean + 1.0))
        wanted = optics / (HEADROOM * mean / max(key, 0.03))
        if time is None:
            time = min(wanted / (1.0 if gain is None else _linear(gain)), settings.longest_exposure)
        if gain is None:
            gain = min(max(20.0 * math.log10(wanted / time), 0.0), settings.highest_gain)
    return Exposure(time, gain, optics / (time * _linear(gain)))


def develop(
    luminance: Floats, exposure: Exposure, noise: NoiseSettings | None, draws: np.random.Generator
) -> NDArray[np.uint8]:
    """The picture (H, W, 3) that a sensor makes of luminance (H, W, 3) [cd/m²]; clips what overfills its wells.

    Noise is the linear model of EMVA 1288 (release 4.0, section 2): of a mean of n electrons, their number varies by
    n + read noise²; gain shows fewer electrons as full scale. Electrons are drawn as normal numbers, one per channel.
    """
    signal = luminance * np.float32(1.0 / exposure.saturation)
    if noise is not None:
        well = noise.full_well / _linear(exposure.gain)
        deviation = np.sqrt(
            np.maximum(signal, 0.0) * np.float32(1.0 / well) + np.float32((noise.read_noise / well) ** 2)
        )
        deviation *= draws.standard_normal(signal.shape, dtype=np.float32)
        signal += deviation
    np.clip(signal, 0.0, 1.0, out=signal)
    signal *= np.float32(_STEPS - 1)
    return _TONES[signal.astype(np.uint16)]


def _linear(gain: float) -> float:
    return float(10.0 ** (gain / 20.0))


def _tone_curve() -> NDArray[np.uint8]:
    """A shoulder for highlights (Reinhard et al., Photographic tone reproduction, 2002, eq. 4), then sRGB's curve."""
    scaled = np.linspace(0.0, HEADROOM, _STEPS)
    tone = scaled * (1.0 + scaled / HEADROOM**2) / (1.0 + scaled)
    encoded = np.where(tone <= 0.0031308, 12.92 * tone, 1.055 * tone ** (1 / 2.4) - 0.055)
    return np.rint(255.0 * np.clip(encoded, 0.0, 1.0)).astype(np.uint8)


_TONES = _tone_curve()
