"""Training of the network for lamp states of traffic lights: `python -m training.train_lamps`; minutes on a CPU.

Images are rendered first (about 10 minutes on two cores). No road of the library is among them, and none of the images
in which `make eval` reads lights. Writes training/out/lamps.npz and its metadata lamps.json.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterable
from datetime import date
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from eidrive_scenario.base.arrays import Array, Bytes, Floats, Integers
from eidrive_scenario.base.randomness import generator
from eidrive_scenario.perception.learned.lights import CROP, NONE, SHOWN, LightsOnMap, crops
from training.light_scenes import LightScene, light_scenes
from training.weight_files import write_card

VERSIONS = 12
"""Number of versions of each light: shifted, scaled, mirrored, with noise and dimmed."""
EMPTY_PER_IMAGE = 2
BATCH, RATE = 128, 2e-3
LEAST_HEIGHT = 5.0
SHIFT, STRETCH = 0.12, 0.15
"""Standard deviations of the position error of a light, as a share of its height, and of the logarithm of the height.
"""


class Samples(NamedTuple):
    """Image regions (N, 3, 32, 16) and their states (N,)."""

    regions: Floats
    states: Integers


def samples(scenes: Iterable[LightScene], seed: int) -> Samples:
    """Return lights that show enough, occluded lights, and regions without lights."""
    regions, states = [], []
    for number, scene in enumerate(scenes):
        rng = generator(seed, "lamps", number)
        truth = {light.id: light for light in scene.lights}
        views = [view for view in LightsOnMap(scene.roads).in_view(scene.reading) if view.height >= LEAST_HEIGHT]
        for view in views:
            light = truth.get(view.id)
            if light is None or (light.box is not None and not light.to_read):
                continue
            state = light.state if light.to_read else NONE
            centers = np.array(view.center) + view.height * SHIFT * rng.standard_normal((VERSIONS, 2))
            heights = view.height * np.exp(STRETCH * rng.standard_normal(VERSIONS))
            regions.append(crops(with_noise(scene.reading.rgb, centers, heights, rng), centers, heights))
            states += [SHOWN.index(state)] * VERSIONS
        height, width = scene.reading.rgb.shape[:2]
        places = rng.uniform((0, 0), (width, height), (EMPTY_PER_IMAGE, 2))
        sizes = np.exp(rng.uniform(np.log(LEAST_HEIGHT), np.log(80.0), EMPTY_PER_IMAGE))
        near = [np.abs(places - view.center).max(axis=1) < view.height + sizes for view in views]
        without_light = ~np.any(near, axis=0) if near else np.ones(EMPTY_PER_IMAGE, dtype=bool)
        regions.append(crops(scene.reading.rgb, places[without_light], sizes[without_light]))
        states += [SHOWN.index(NONE)] * int(without_light.sum())
    stacked = np.concatenate(regions)
    rng = generator(seed, "lamps", "mirrored")
    mirrored = rng.random(len(stacked)) < 0.5
    stacked[mirrored] = stacked[mirrored, :, :, ::-1]
    return Samples(stacked, np.array(states, dtype=np.int64))


def with_noise(image: Bytes, centers: Array, heights: Array, rng: np.random.Generator) -> Bytes:
    """Return the image with weak noise, so that no two regions are equal."""
    left, top = np.floor((centers - 2.0 * heights[:, None]).min(axis=0)).astype(int).clip(0)
    right, bottom = np.ceil((centers + 2.0 * heights[:, None]).max(axis=0)).astype(int).clip(1)
    region = image[top:bottom, left:right].astype(float)
    changed = image.copy()
    changed[top:bottom, left:right] = (region + rng.normal(0.0, 3.0, region.shape)).clip(0, 255).astype(np.uint8)
    return changed


class Network(nn.Module):
    """Trainable version of `LampNetwork` of perception/learned/lights.py."""

    def __init__(self) -> None:
        super().__init__()
        self.first, self.second = nn.Conv2d(3, 12, 3, padding=1), nn.Conv2d(12, 24, 3, padding=1)
        self.third = nn.Conv2d(24, 32, 3, padding=1)
        self.last = nn.Linear(32 * (CROP[1] // 4) * (CROP[0] // 4), len(SHOWN))

    def forward(self, regions: Tensor) -> Tensor:
        features = nn.functional.max_pool2d(self.first(regions).relu(), 2)
        features = nn.functional.max_pool2d(self.second(features).relu(), 2)
        features = self.third(features).relu().flatten(1)
        logits: Tensor = self.last(nn.functional.dropout(features, 0.3, self.training))
        return logits

    def weights(self) -> dict[str, Floats]:
        """Return the weights in the format of `LampNetwork`."""
        names = ("first", "second", "third", "last")
        values = {name: value.detach().numpy() for name, value in self.state_dict().items()}
        kernels = {f"w{number}": values[f"{name}.weight"] for number, name in enumerate(names)}
        return kernels | {f"b{number}": values[f"{name}.bias"] for number, name in enumerate(names)}


def fit(data: Samples, seed: int, epochs: int) -> Network:
    """Return the network, trained with weights that balance the states."""
    torch.manual_seed(seed)
    network = Network()
    regions, states = torch.from_numpy(data.regions), torch.from_numpy(data.states)
    counts = torch.bincount(states, minlength=len(SHOWN)).float().clamp(min=1.0)
    loss = nn.CrossEntropyLoss(weight=(counts.sum() / counts / len(SHOWN)).sqrt(), label_smoothing=0.02)
    steps = epochs * -(-len(regions) // BATCH)
    optimizer = torch.optim.AdamW(network.parameters(), RATE, weight_decay=1e-2)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, RATE, total_steps=steps)
    for _ in range(epochs):
        for rows in torch.split(torch.randperm(len(regions)), BATCH):
            gain = 0.7 + 0.6 * torch.rand(len(rows), 3, 1, 1).mean(dim=1, keepdim=True)
            value = loss(network((regions[rows] * gain).clamp(max=1.0)), states[rows])
            optimizer.zero_grad()
            value.backward()
            optimizer.step()
            schedule.step()
    return network.eval()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--worlds", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--epochs", type=int, default=12)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("training/out"))
    options = parser.parse_args()
    data = samples(light_scenes(options.seed, "lights train", options.worlds, options.processes), options.seed)
    started = time.perf_counter()
    torch.set_num_threads(2)
    network = fit(data, options.seed, options.epochs)
    counts = np.bincount(data.states, minlength=len(SHOWN))
    card = {
        "network": "lamps",
        "shown": list(SHOWN),
        "input_size": list(CROP),
        "date": date.today().isoformat(),
        "torch": torch.__version__,
        "data": {
            "script": "training/train_lamps.py",
            "seed": options.seed,
            "worlds": options.worlds,
            "versions": dict(zip(SHOWN, counts.tolist(), strict=True)),
        },
        "training": {"epochs": options.epochs, "device": "cpu", "seconds": round(time.perf_counter() - started)},
    }
    halves: dict[str, Any] = {name: value.astype(np.float16) for name, value in network.weights().items()}
    path = options.out / "lamps.npz"
    options.out.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(path, **halves)
    write_card(path, card)
    print(f"{len(data.states)} image regions; written: {path}, .json")


if __name__ == "__main__":
    main()
