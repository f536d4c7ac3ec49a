"""Storage of images and labels: `pictures.bin` with consecutive WebP images, and `labels.npz` with their offsets."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Bools, Bytes, Integers

IMAGES, LABELS = "pictures.bin", "labels.npz"


@dataclass(frozen=True)
class Dataset:
    """Images and their objects.

    Columns of images (P,): begin [byte, P + 1], size (P, 2) stored width and height [px], scale (P, 2) from camera
    pixels to stored ones, camera (P, 4) width, height [px], fov [degrees], height above ground [m], weather (P,) name,
    visual_range [m], sun_elevation [degrees].

    Columns of objects (N,): picture, the row of its image; number of the class; box (N, 4) x1 y1 x2 y2 [px as stored];
    height [px of the camera]; seen and whole, the visible and total pixels of the silhouette [px of the camera];
    distance [m]; place (N, 7); readable.
    """

    folder: Path
    columns: dict[str, NDArray[Any]]

    def __len__(self) -> int:
        return len(self.columns["begin"]) - 1

    def __getattr__(self, name: str) -> NDArray[Any]:
        try:
            return self.columns[name]
        except KeyError:
            raise AttributeError(name) from None

    @classmethod
    def load(cls, folder: Path) -> Dataset:
        """Return the dataset in a folder."""
        with np.load(folder / LABELS) as stored:
            return cls(folder, {name: stored[name] for name in stored.files})

    def images(self, numbers: Sequence[int]) -> Iterator[Bytes]:
        """Yield the images with these numbers, red green blue."""
        with (self.folder / IMAGES).open("rb") as stream:
            for number in numbers:
                stream.seek(int(self.begin[number]))
                yield decode(stream.read(int(self.begin[number + 1] - self.begin[number])))

    def objects(self, image: int) -> Integers:
        """Return the rows of the objects in an image."""
        return np.flatnonzero(self.picture == image)

    def to_find(self) -> Bools:
        """Return whether each object (N,) is required; the others are ignored, detected or not."""
        return np.asarray(shows_enough(self.height, self.seen, self.whole) & self.readable)


def shows_enough(height: NDArray[Any], visible: NDArray[Any], silhouette: NDArray[Any]) -> Bools:
    """Return whether objects (N,) are at least 8 pixels high, with 30 pixels and a fifth of the silhouette visible."""
    return np.asarray((height >= 8.0) & (visible >= 30) & (visible / np.maximum(silhouette, 1) >= 0.2))


def write(folder: Path, images: Sequence[bytes], columns: dict[str, NDArray[Any]]) -> None:
    """Write a dataset; `columns` without `begin`, which follows from the images."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / IMAGES).open("wb") as stream:
        for image in images:
            stream.write(image)
    begin = np.cumsum([0, *(len(image) for image in images)], dtype=np.int64)
    np.savez_compressed(folder / LABELS, begin=begin, **columns)  # type: ignore[arg-type]


def encode(image: Bytes, quality: int) -> bytes:
    """Return an image, red green blue, as WebP."""
    done, content = cv2.imencode(".webp", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_WEBP_QUALITY, quality])
    if not done:
        raise ValueError("OpenCV does not support WebP")
    return bytes(content)


def decode(content: bytes) -> Bytes:
    """Return the image of WebP data, red green blue."""
    image = cv2.imdecode(np.frombuffer(content, dtype=np.uint8), cv2.IMREAD_COLOR)
    if image is None:
        raise ValueError("the data is not a WebP image")
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), dtype=np.uint8)
