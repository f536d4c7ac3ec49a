"""How pictures and labels lie on disk: `pictures.bin`, WebP after WebP, and `labels.npz`, where each begins."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

PICTURES, LABELS = "pictures.bin", "labels.npz"


@dataclass(frozen=True)
class Dataset:
    """Pictures and what is in them.

    Of pictures (P,): begin [byte, P + 1], size (P, 2) width and height as stored [px], scale (P, 2) from the camera's
    pixels to these, camera (P, 4) width, height [px], fov [degrees], height above ground [m], weather (P,) name,
    visual_range [m], sun_elevation [degrees].
    Of objects (N,): picture, number of the class, box (N, 4) x1 y1 x2 y2 [px as stored], height [px of the camera],
    seen and whole [px of the camera], distance [m], place (N, 7), readable.
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
        """The dataset in a folder."""
        with np.load(folder / LABELS) as stored:
            return cls(folder, {name: stored[name] for name in stored.files})

    def pictures(self, rows: Sequence[int] | None = None) -> Iterator[NDArray[np.uint8]]:
        """The pictures, red green blue, all or those of `rows`."""
        begin = self.columns["begin"]
        with (self.folder / PICTURES).open("rb") as stream:
            for row in range(len(self)) if rows is None else rows:
                stream.seek(int(begin[row]))
                yield decode(stream.read(int(begin[row + 1] - begin[row])))

    def objects(self, picture: int) -> NDArray[np.int64]:
        """The rows of the objects in a picture."""
        return np.flatnonzero(self.columns["picture"] == picture)

    def to_find(self) -> NDArray[np.bool_]:
        """(N,) whether an object shows enough to be asked for; the others are ignored, found or not."""
        enough = shows_enough(self.columns["height"], self.columns["seen"], self.columns["whole"])
        return np.asarray(enough & self.columns["readable"], dtype=bool)


def shows_enough(height: NDArray[Any], seen: NDArray[Any], whole: NDArray[Any]) -> NDArray[np.bool_]:
    """(N,) whether an object is at least 8 pixels high, and 30 pixels and a fifth of its silhouette are in sight."""
    enough: NDArray[np.bool_] = (height >= 8.0) & (seen >= 30) & (seen / np.maximum(whole, 1) >= 0.2)
    return enough


def write(folder: Path, pictures: Sequence[bytes], columns: dict[str, NDArray[Any]]) -> None:
    """Write a dataset; `columns` without `begin`, which follows from the pictures."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / PICTURES).open("wb") as stream:
        for picture in pictures:
            stream.write(picture)
    begin = np.cumsum([0, *(len(picture) for picture in pictures)], dtype=np.int64)
    np.savez_compressed(folder / LABELS, begin=begin, **columns)  # type: ignore[arg-type]


def encode(picture: NDArray[np.uint8], quality: int) -> bytes:
    """A picture, red green blue, as WebP."""
    import cv2

    done, data = cv2.imencode(".webp", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_WEBP_QUALITY, quality])
    if not done:
        raise ValueError("OpenCV cannot write WebP")
    return bytes(data)


def decode(data: bytes) -> NDArray[np.uint8]:
    """The inverse of `encode`, by OpenCV, or by Pillow where that is missing."""
    try:
        import cv2
    except ImportError:
        import io

        from PIL import Image

        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"), dtype=np.uint8)
    picture = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_COLOR)
    if picture is None:
        raise ValueError("not a picture")
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), dtype=np.uint8)
