"""Fast fading: independent random power of each message at each receiver, relative to the link budget."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from eidrive_scenario.arrays import Array
from eidrive_scenario.settings import Settings
from eidrive_scenario.v2x.counter_random import Keys, combine_keys, key, uniforms

Shape = Annotated[float, Field(ge=0.5, le=1000.0)]


class NoFading(Settings):
    """No fading: every message has the power of the link budget."""

    kind: Literal["none"] = "none"


class Nakagami(Settings):
    """Nakagami-m fading: the power is gamma distributed with shape m around its mean (M. Nakagami, 1960).

    m          shape, at least 0.5 (1: Rayleigh fading; infinity: no fading), or one shape per distance range
    distances  boundaries between the distance ranges [m], one fewer than shapes
    """

    kind: Literal["nakagami"]
    m: tuple[Shape, ...]
    distances: tuple[Annotated[float, Field(gt=0.0)], ...] = ()

    @field_validator("m", mode="before")
    @classmethod
    def _wrap_single_shape(cls, value: object) -> object:
        return (value,) if isinstance(value, int | float | str) else value

    @model_validator(mode="after")
    def _check_ranges(self) -> Nakagami:
        if len(self.m) != len(self.distances) + 1 or list(self.distances) != sorted(set(self.distances)):
            counts = f"{len(self.distances)} distances and {len(self.m)} values of m"
            raise ValueError(f"distances must be ascending, one fewer than values of m (got {counts})")
        return self

    def gain_db(self, distance: Array, draws: Array) -> Array:
        """Return the fading gain (N,) [dB] at these distances [m]; `draws` (N,) in (0, 1)."""

        from scipy.special import gammaincinv

        shape = np.array(self.m)[np.searchsorted(self.distances, distance, side="right")]
        gain: Array = 10.0 * np.log10(np.maximum(gammaincinv(shape, draws) / shape, 1e-30))
        return gain


Fading = Annotated[NoFading | Nakagami, Field(discriminator="kind")]


class FadingDraws:
    """Random fading of messages between N stations, keyed by link and message number."""

    def __init__(self, fading: Nakagami, seed: int) -> None:
        self._fading = fading
        self._seed = seed
        self._keys: Keys = np.zeros((0, 0), dtype=np.uint64)
        self.distance: Array = np.zeros((0, 0))
        """Current distance between the antennas (N, N) [m]."""

    def rearrange(self, names: tuple[str, ...]) -> None:
        """Replace the stations."""
        own = np.array([key(self._seed, "fading", name) for name in names], dtype=np.uint64)
        self._keys = combine_keys(own[:, None], own[None, :])

    def gain_db(self, row: int, number: int) -> Array:
        """Return the fading gain (N,) of message `number` of the station in `row` at each station [dB]."""
        return self._fading.gain_db(self.distance[row], uniforms(self._keys[row], number))
