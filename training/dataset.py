"""Storage of images and labels: `pictures.bin` with consecutive WebP images, and `labels.npz` with their offsets."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

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

    def images(self, rows: Sequence[int] | None = None) -> Iterator[NDArray[np.uint8]]:
        """Yield the images, red green blue, all or those of `rows`."""
        begin = self.columns["begin"]
        with (self.folder / IMAGES).open("rb") as stream:
            for row in range(len(self)) if rows is None else rows:
                stream.seek(int(begin[row]))
                yield decode(stream.read(int(begin[row + 1] - begin[row])))

    def objects(self, image: int) -> NDArray[np.int64]:
        """Return the rows of the objects in an image."""
        return np.flatnonzero(self.columns["picture"] == image)

    def to_find(self) -> NDArray[np.bool_]:
        """Return whether each object (N,) is required; the others are ignored, detected or not."""
        enough = shows_enough(self.columns["height"], self.columns["seen"], self.columns["whole"])
        return np.asarray(enough & self.columns["readable"], dtype=bool)


def shows_enough(height: NDArray[Any], visible: NDArray[Any], silhouette: NDArray[Any]) -> NDArray[np.bool_]:
    """Return whether objects (N,) are at least 8 pixels high, with 30 pixels and a fifth of the silhouette visible."""
    enough: NDArray[np.bool_] = (height >= 8.0) & (visible >= 30) & (visible / np.maximum(silhouette, 1) >= 0.2)
    return enough


def write(folder: Path, images: Sequence[bytes], columns: dict[str, NDArray[Any]]) -> None:
    """Write a dataset; `columns` without `begin`, which follows from the images."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / IMAGES).open("wb") as stream:
        for image in images:
            stream.write(image)
    begin = np.cumsum([0, *(len(image) for image in images)], dtype=np.int64)
    np.savez_compressed(folder / LABELS, begin=begin, **columns)  # type: ignore[arg-type]


def encode(image: NDArray[np.uint8], quality: int) -> bytes:
    """Return an image, red green blue, as WebP."""
    import cv2

    done, data = cv2.imencode(".webp", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_WEBP_QUALITY, quality])
    if not done:
        raise ValueError("OpenCV does not support WebP")
    return bytes(data)


def decode(data: bytes) -> NDArray[np.uint8]:
    """Return the image of WebP data, by OpenCV, or by Pillow if OpenCV is missing."""
    try:
        import cv2
    except ImportError:
        import io

        from PIL import Image

        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"), dtype=np.uint8)
    image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_COLOR)
    if image is None:
        raise ValueError("the data is not a WebP image")
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), dtype=np.uint8)
