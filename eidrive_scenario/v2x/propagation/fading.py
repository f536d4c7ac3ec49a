"""Fast fading: the power of each message at each receiver, drawn separately around the link budget."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator
from scipy.special import gammaincinv

from eidrive_scenario.arrays import Array
from eidrive_scenario.settings import Settings
from eidrive_scenario.v2x.counter_random import Keys, combine_keys, key, uniforms

Shape = Annotated[float, Field(ge=0.5, le=1000.0)]


class NoFading(Settings):
    """Every message has the power of the link budget."""

    kind: Literal["none"] = "none"


class Nakagami(Settings):
    """Nakagami-m fading: the power is gamma distributed with shape m around its mean (M. Nakagami, 1960).

    m          shape, at least 0.5: 1 is Rayleigh fading, infinity none; or one for each range of distance
    distances  where one range ends and the next begins [m], one less than there are shapes
    """

    kind: Literal["nakagami"]
    m: tuple[Shape, ...]
    distances: tuple[Annotated[float, Field(gt=0.0)], ...] = ()

    @field_validator("m", mode="before")
    @classmethod
    def _one_for_all(cls, value: object) -> object:
        return (value,) if isinstance(value, int | float | str) else value

    @model_validator(mode="after")
    def _ranges(self) -> Nakagami:
        if len(self.m) != len(self.distances) + 1 or list(self.distances) != sorted(set(self.distances)):
            raise ValueError("distances must rise, and m needs one value more than there are distances")
        return self

    def gain_db(self, distance: Array, draws: Array) -> Array:
        """(N,) power over its mean [dB] at these distances [m]; `draws` (N,) in (0, 1)."""
        shape = np.array(self.m)[np.searchsorted(self.distances, distance, side="right")]
        gain: Array = 10.0 * np.log10(np.maximum(gammaincinv(shape, draws) / shape, 1e-30))
        return gain


Fading = Annotated[NoFading | Nakagami, Field(discriminator="kind")]


class FadingDraws:
    """Draws the fading of messages between N stations, keyed by link and message number."""

    def __init__(self, fading: Nakagami, seed: int) -> None:
        self._fading = fading
        self._seed = seed
        self._keys: Keys = np.zeros((0, 0), dtype=np.uint64)
        self.distance: Array = np.zeros((0, 0))
        """(N, N) between the antennas now [m]."""

    def rearrange(self, names: tuple[str, ...]) -> None:
        """Use these stations from now on."""
        own = np.array([key(self._seed, "fading", name) for name in names], dtype=np.uint64)
        self._keys = combine_keys(own[:, None], own[None, :])

    def gain_db(self, row: int, number: int) -> Array:
        """(N,) power of message `number` of this station over its mean at each station [dB]."""
        return self._fading.gain_db(self.distance[row], uniforms(self._keys[row], number))
