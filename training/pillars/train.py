"""Training of the network `pillars` on a GPU: first single stations, then fusion of three stations.

Each batch is cast from other scenes, so that none occurs twice.
"""

from __future__ import annotations

import argparse
import copy
import json
import math
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional
from torch.utils.data import DataLoader, IterableDataset, get_worker_info

from training.pillars.network import (
    BOX,
    OUT,
    REACH,
    STRIDE_SIDE,
    Pillars,
    fuse,
    most_confident,
    probabilities,
    warp,
)
from training.pillars.samples import Batch, Sampler, Targets, targets
from training.pillars.scans import Meshes
from training.pillars.scenes import CLASSES, STATIONS, Assets, SceneMaker

RATE = 3e-3
DECAY = 0.01
AVERAGE = 0.998
"""Decay of the moving average of the weights in each step."""
SHARES = (1.0, 1.0, 0.1, 0.05, 0.02, 0.01)
"""Shares of the cells that senders of a batch send."""
LARGEST_NOISE = 0.6
"""Largest standard deviation of the pose error of a sender, in meters and in degrees; half of the batches have none."""
TEST_SEED, TEST_BATCHES = 10**6, 12
_BOX_WEIGHTS = (2.0, 2.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
K = len(CLASSES)


class Scenes(IterableDataset[dict[str, Any]]):
    """Endless batches of scenes, made by the workers of a loader."""

    def __init__(self, assets: Path, seed: int, scenes: int) -> None:
        self._assets, self._seed, self._scenes = assets, seed, scenes

    def __iter__(self) -> Iterator[dict[str, Any]]:
        maker, worker = SceneMaker(Assets.load(self._assets)), get_worker_info()
        number = 0
        while True:
            yield maker.batch((self._seed, worker.id if worker else 0, number), self._scenes)
            number += 1


def heat_loss(logits: Tensor, target: Targets) -> Tensor:
    """Return the focal loss of the class maps per object (Zhou, Wang, Krähenbühl: Objects as points, 2019)."""
    logits = logits.float()
    share = torch.sigmoid(logits)
    positive = (target.heat >= 0.999).float()
    hit = -functional.logsigmoid(logits) * (1.0 - share) ** 2 * positive
    miss = -functional.logsigmoid(-logits) * share**2 * (1.0 - target.heat) ** 4 * (1.0 - positive)
    return (hit + miss).sum() / target.objects


def box_loss(maps: Tensor, target: Targets) -> Tensor:
    """Return the loss of the boxes per weight, and of the standard deviation of the position."""
    boxes = maps[:, K:].permute(0, 2, 3, 1).reshape(-1, BOX)[target.cells].float()
    error = functional.smooth_l1_loss(boxes[:, :-1], target.values[:, :-1], reduction="none", beta=0.1)
    scale = error.new_tensor(_BOX_WEIGHTS).expand_as(error).clone()
    scale[:, 10:] *= target.moving[:, None]
    weight = target.weights[:, None] / target.weights.sum().clamp(min=1.0)
    distance = ((boxes[:, :2] - target.values[:, :2]).detach() * STRIDE_SIDE).square().mean(dim=1, keepdim=True)
    spread = boxes[:, -1:].clamp(-4.0, 2.0)
    likelihood = 0.5 * distance * torch.exp(-2.0 * spread) + spread
    return ((error * scale).sum(dim=1, keepdim=True) * weight).sum() + 0.1 * (likelihood * weight).sum()


def loss_of(maps: Tensor, target: Targets) -> Tensor:
    """Return the loss of head maps (N, K + 13, 128, 128)."""
    return heat_loss(maps[:, :K], target) + 2.0 * box_loss(maps, target)


def union(batch: Batch) -> Tensor:
    """Return the number of points of all stations of the scene on each body (N, B)."""
    return batch.points.reshape(-1, STATIONS, batch.points.shape[1]).sum(dim=1).repeat_interleave(STATIONS, dim=0)


def pose_errors(number: int, noise: float, device: torch.device) -> Tensor:
    """Return errors (number, 3) in x, y [m] and heading [rad] with the standard deviation `noise` in m and degrees."""
    errors = noise * torch.randn(number, 3, device=device)
    errors[:, 2] = torch.deg2rad(errors[:, 2])
    return errors


def warped(batch: Batch, latent: Tensor, mask: Tensor, errors: Tensor) -> tuple[Tensor, Tensor]:
    """Return the values of the other stations in each grid (STATIONS - 1, N, 8, H, W), and the present cells.

    errors  (STATIONS - 1, N, 3) of the pose of each other station in x, y [m] and heading [rad]
    """
    grids = torch.arange(len(latent), device=latent.device)
    scene, station = grids // STATIONS, grids % STATIONS
    values, present = [], []
    for step, error in enumerate(errors, start=1):
        sender = scene * STATIONS + (station + step) % STATIONS
        shift = batch.center - batch.center[sender] + error[:, :2]
        received, cells = warp(latent[sender], mask[sender], shift, error[:, 2])
        values.append(received)
        present.append(cells * ~_own_cells(batch))
    return torch.stack(values), torch.stack(present)


def _own_cells(batch: Batch) -> Tensor:
    """Return the cells of each grid on the body of its station (N, H, W)."""
    number = len(batch.own)
    scene = torch.arange(number, device=batch.own.device) // STATIONS
    box = batch.boxes[scene, batch.own.clamp(min=0)]
    cell = (torch.arange(OUT, device=box.device) + 0.5) * STRIDE_SIDE - REACH
    x = cell[None, :, None] + (batch.center[:, 0] - box[:, 0])[:, None, None]
    y = cell[None, None, :] + (batch.center[:, 1] - box[:, 1])[:, None, None]
    cos, sin = torch.cos(box[:, 6])[:, None, None], torch.sin(box[:, 6])[:, None, None]
    ahead, aside = cos * x + sin * y, cos * y - sin * x
    on = (ahead.abs() < box[:, 3, None, None] / 2 + 0.4) & (aside.abs() < box[:, 4, None, None] / 2 + 0.4)
    return on & (batch.own >= 0)[:, None, None]


def own_loss(network: Pillars, features: Tensor, target: Targets) -> tuple[Tensor, Tensor, Tensor]:
    """Return the loss of detections in features and in those that a receiver decodes, the sent values, and the
    confidence.
    """
    own, latent = network.head(features), network.sent(features)
    restored = network.head(network.received(latent))
    return loss_of(own, target) + 0.5 * loss_of(restored, target), latent, probabilities(own.detach())


def fused_maps(network: Pillars, own: Tensor, values: Tensor, present: Tensor, method: str) -> Tensor:
    """Return head maps of own features (N, 96, H, W) fused with those of received values (S, N, 8, H, W)."""
    received = network.received(values.flatten(0, 1))
    received = received.reshape(*values.shape[:2], *received.shape[1:])
    maps: Tensor = network.head(fuse(own, received, present, method))
    return maps


def fused_loss(network: Pillars, own: Tensor, values: Tensor, present: Tensor, target: Targets, method: str) -> Tensor:
    """Return the loss of detections in fused features."""
    return loss_of(fused_maps(network, own, values, present, method), target)


def merged_loss(network: Pillars, features: Tensor, target: Targets) -> Tensor:
    """Return the loss of detections in features of the points of all stations."""
    return loss_of(network.head(features), target)


def train(
    network: Pillars, sampler: Sampler, scenes: Iterator[dict[str, Any]], arguments: argparse.Namespace
) -> tuple[Pillars, int]:
    """Train until the time is over; return the moving average of the network, and the number of steps."""
    joint = arguments.stage == "fusion"
    network.train()
    average = copy.deepcopy(network).eval()
    parameters = list(network.parameters())
    optimizer = torch.optim.AdamW(parameters, lr=RATE, weight_decay=DECAY, fused=sampler.device_type == "cuda")
    averages, currents = (
        [value for value in module.state_dict().values() if value.dtype.is_floating_point]
        for module in (average, network)
    )
    compiled = partial(torch.compile, dynamic=False, disable=not arguments.compile)
    features_of, own_of = compiled(network.features), compiled(own_loss)
    fused_of, merged_of = compiled(fused_loss), compiled(merged_loss)
    random = np.random.default_rng(arguments.seed + (1 if joint else 0))
    device = parameters[0].device
    start, step, losses = time.monotonic(), 0, []
    peak = RATE * (0.4 if joint else 1.0)
    while (progress := (time.monotonic() - start) / (60.0 * arguments.minutes)) < 1.0:
        rate = peak * min(1.0, (step + 1) / 300.0) * (0.01 + 0.99 * 0.5 * (1.0 + math.cos(math.pi * progress)))
        for group in optimizer.param_groups:
            group["lr"] = rate
        noise = float(random.uniform(0.0, LARGEST_NOISE)) if joint and random.random() < 0.5 else 0.0
        with torch.no_grad():
            arrays = next(scenes)
            number = len(arrays["bodies"]) * STATIONS
            batch = sampler.batch(arrays, pose_errors(number if joint else 0, noise, device))
            own = targets(batch, batch.points)
            # In one batch, so that normalization has the same statistics in training as later.
            grids = torch.cat([batch.grids, batch.merged])
        with torch.autocast(sampler.device_type, torch.bfloat16):
            features = features_of(grids.contiguous(memory_format=torch.channels_last))
            loss, latent, confidence = own_of(network, features[:number], own)
            if joint:
                with torch.no_grad():
                    together, merged = (targets(batch, union(batch), every) for every in (1, STATIONS))
                    mask = most_confident(confidence, float(random.choice(SHARES)))
                    errors = pose_errors((STATIONS - 1) * number, noise, device).reshape(STATIONS - 1, number, 3)
                values, present = warped(batch, latent, mask, errors)
                method = str(random.choice(["max", "attention"]))
                loss = loss + fused_of(network, features[:number], values, present, together, method)
                loss = loss + 0.5 * merged_of(network, features[number:], merged)
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(parameters, 10.0)
        optimizer.step()
        with torch.no_grad():
            decay = min(AVERAGE, (step + 1) / (step + 20))
            torch._foreach_lerp_(averages, currents, 1.0 - decay)
        losses.append(loss.detach())
        step += 1
        if step % 100 == 0:
            mean = torch.stack(losses).mean().item()
            losses.clear()
            print(f"step {step}  {time.monotonic() - start:.0f} s  loss {mean:.3f}  rate {rate:.2e}", flush=True)
    return average, step


def peaks(maps: Tensor, count: int = 100) -> tuple[Tensor, Tensor]:
    """Return scores (N, count) and centers (N, count, 2) of the best local maxima of head maps."""
    best = probabilities(maps)
    best = torch.where(functional.max_pool2d(best[:, None], 3, 1, 1)[:, 0] == best, best, 0.0)
    scores, cells = best.flatten(1).topk(count, dim=1)
    i, j = cells // OUT, cells % OUT
    offset = maps[:, K : K + 2].float().flatten(2).gather(2, cells[:, None].expand(-1, 2, -1))
    x = (i + 0.5 + offset[:, 0]) * STRIDE_SIDE - REACH
    y = (j + 0.5 + offset[:, 1]) * STRIDE_SIDE - REACH
    return scores, torch.stack([x, y], dim=2)


def average_precision(entries: list[tuple[float, bool]], objects: int) -> float:
    """Return the area below precision over recall of detections (score, correct)."""
    entries = sorted(entries, key=lambda entry: -entry[0])
    hits = np.cumsum([hit for _, hit in entries])
    precision = hits / np.arange(1, len(entries) + 1)
    precision = np.maximum.accumulate(precision[::-1])[::-1]
    recall = np.concatenate([[0.0], hits / max(objects, 1)])
    return float((np.diff(recall) * precision).sum())


@torch.no_grad()
def evaluate(network: Pillars, sampler: Sampler, arguments: argparse.Namespace) -> dict[str, float]:
    """Return the average precision by distance of centers below 1 m, on scenes that training does not see."""
    maker = SceneMaker(Assets.load(arguments.assets))
    detections: dict[str, list[tuple[float, bool]]] = {}
    objects: dict[str, int] = {}
    for number in range(TEST_BATCHES):
        arrays = maker.batch((TEST_SEED, number), arguments.scenes)
        batch = sampler.batch(arrays, pose_errors(arguments.scenes * STATIONS, 0.0, network.head.weight.device))
        features = network.features(batch.grids)
        own = network.head(features)
        latent = network.sent(features)
        results = {"single": (own, batch.points), "restored": (network.head(network.received(latent)), batch.points),
                   "none": (own, union(batch))}  # fmt: skip
        for share, noise, methods in ((1.0, 0.0, ("max", "attention")), (0.01, 0.0, ("attention",)),
                                      (0.05, 0.0, ("attention",)), (1.0, 0.4, ("attention",))):  # fmt: skip
            mask = most_confident(probabilities(own), share)
            errors = pose_errors((STATIONS - 1) * len(own), noise, own.device).reshape(STATIONS - 1, len(own), 3)
            values, present = warped(batch, latent, mask, errors)
            for method in methods:
                name = f"{method} {share:g} {noise:g}"
                results[name] = (fused_maps(network, features, values, present, method), union(batch))
        results["early"] = network.head(network.features(batch.merged)), union(batch)
        scene = torch.arange(len(batch.own), device=batch.own.device) // STATIONS
        centers = batch.boxes[scene][..., :2] - batch.center[:, None]
        inside = (centers.abs() < REACH).all(dim=2) & (batch.classes[scene] >= 0)
        inside &= torch.arange(centers.shape[1], device=centers.device) != batch.own[:, None]
        for name, (maps, points) in results.items():
            scores, peak_centers = (part.cpu().numpy() for part in peaks(maps))
            step = len(inside) // len(maps)
            truth = (inside & (points > 0))[::step].cpu().numpy()
            distance = torch.cdist(torch.as_tensor(peak_centers), centers[::step].cpu().float()).numpy()
            for grid in range(len(scores)):
                unmatched = truth[grid].copy()
                objects[name] = objects.get(name, 0) + int(unmatched.sum())
                for rank in range(scores.shape[1]):
                    if scores[grid, rank] < 0.05:
                        break
                    near = np.where(unmatched, distance[grid, rank], np.inf)
                    best = int(near.argmin())
                    hit = bool(near[best] < 1.0)
                    unmatched[best] &= not hit
                    detections.setdefault(name, []).append((float(scores[grid, rank]), hit))
    return {name: round(average_precision(detections.get(name, []), objects[name]), 4) for name in objects}


def main() -> None:
    """Train one stage, and write its state, and after a stage of fusion the weights."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("stage", choices=("single", "fusion"))
    parser.add_argument("--minutes", type=float, default=8.0)
    parser.add_argument("--scenes", type=int, default=32, help="scenes of a batch, with three stations each")
    parser.add_argument("--workers", type=int, default=15)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--assets", type=Path, default=Path("training/data/pillars_assets.npz"))
    parser.add_argument("--start", type=Path, help="state of an earlier stage")
    parser.add_argument("--out", type=Path, default=Path("training/out"))
    parser.add_argument("--device", default="cuda")
    parser.add_argument("--compile", action="store_true")
    arguments = parser.parse_args()
    torch.manual_seed(arguments.seed)
    torch.backends.cudnn.benchmark = True
    with np.load(arguments.assets) as file:
        meshes = Meshes.of(file["triangles"], file["reflectivity"], file["first"], arguments.device)
    sampler = Sampler(meshes, arguments.device)
    network = Pillars().to(arguments.device, memory_format=torch.channels_last)  # type: ignore[call-overload]
    if arguments.start is not None:
        network.load_state_dict(torch.load(arguments.start, map_location=arguments.device))
    loader = DataLoader(
        Scenes(arguments.assets, arguments.seed + (1000 if arguments.stage == "fusion" else 0), arguments.scenes),
        batch_size=None, num_workers=arguments.workers, prefetch_factor=4 if arguments.workers else None,
        pin_memory=sampler.device_type == "cuda",
    )  # fmt: skip
    average, steps = train(network, sampler, iter(loader), arguments)
    arguments.out.mkdir(parents=True, exist_ok=True)
    torch.save(average.state_dict(), arguments.out / f"pillars_{arguments.stage}.pt")
    record = {
        "script": "training/pillars/train.py",
        "seed": arguments.seed,
        "steps": steps,
        "grids_per_step": arguments.scenes * STATIONS,
        "minutes": arguments.minutes,
        "device": torch.cuda.get_device_name() if sampler.device_type == "cuda" else "cpu",
        "torch": str(torch.__version__),
        "ap_1m": evaluate(average, sampler, arguments),
    }
    print(json.dumps(record), flush=True)
    np.savez(arguments.out / f"pillars_{arguments.stage}.npz", allow_pickle=False, **average.folded())
    (arguments.out / f"pillars_{arguments.stage}.json").write_text(json.dumps(record, indent=2))


if __name__ == "__main__":
    main()
