"""Training of a network on rendered images: `python -m training.train yolov5 --data training/data --out training/out`.

Training takes minutes on a GPU and a night on a CPU, with the same seeds. All images are stored and augmented in device
memory. The result is the moving average of the weights in the best epoch on the validation images.
"""

from __future__ import annotations

import argparse
import copy
import datetime
import json
import math
import time
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from eidrive_scenario.base.arrays import Bools
from eidrive_scenario.experiments.average_precision import Matches, average_precision, best_confidence, match
from eidrive_scenario.perception.learned.detector import INPUT_SIZE
from eidrive_scenario.perception.learned.image_network import IMAGE_CLASSES, suppression_groups
from eidrive_scenario.perception.learned.networks.ssd import Ssd
from eidrive_scenario.perception.learned.networks.suppression import suppress
from eidrive_scenario.perception.learned.networks.yolov5 import YoloV5
from eidrive_scenario.perception.learned.networks.yolov5_sizes import ANCHORS_PER_SCALE, STRIDES, Anchors
from eidrive_scenario.perception.learned.own_network import ssd_candidates, ssd_scales, yolo_candidates, yolo_scales
from eidrive_scenario.perception.learned.torch_network import untrained
from eidrive_scenario.perception.learned.weights import Description
from training.augment import change_colors, transform_images
from training.boxes import IGNORED, PADDING, Targets, centered
from training.dataset import Dataset
from training.losses import default_boxes, ssd_loss, state_rare_objects, yolo_loss
from training.weight_files import write_card, write_weights

MOST_OBJECTS = 48
"""Maximum number of objects of an image; the farthest are omitted."""
AVERAGE_DECAY = 0.9995
"""Decay of the moving average per step, after the initial phase."""
LEAST_CONFIDENCE = 0.02
UNCHANGED_FROM = 0.92
"""Share of the training from which images are no longer zoomed and shifted."""


class Samples:
    """Dataset on a device: images (P, 3, H, W) uint8, boxes (P, M, 4) x1 y1 x2 y2 [px], classes (P, M)."""

    def __init__(self, dataset: Dataset, device: torch.device) -> None:
        width, height = INPUT_SIZE
        images = np.empty((len(dataset), height, width, 3), dtype=np.uint8)
        for number, image in enumerate(dataset.images(range(len(dataset)))):
            images[number] = image
        boxes = np.zeros((len(dataset), MOST_OBJECTS, 4), dtype=np.float32)
        classes = np.full((len(dataset), MOST_OBJECTS), PADDING, dtype=np.int64)
        to_find = dataset.to_find()
        filled = np.zeros(len(dataset), dtype=np.int64)
        for row in np.argsort(dataset.distance, kind="stable").tolist():
            image_row = int(dataset.picture[row])
            at = filled[image_row]
            if at < MOST_OBJECTS:
                boxes[image_row, at] = dataset.box[row]
                classes[image_row, at] = dataset.number[row] if to_find[row] else IGNORED
                filled[image_row] += 1
        self.images = torch.from_numpy(images).to(device).permute(0, 3, 1, 2)
        self.boxes = torch.from_numpy(boxes).to(device)
        self.classes = torch.from_numpy(classes).to(device)

    def __len__(self) -> int:
        return len(self.images)


def fit_anchors(dataset: Dataset, seed: int) -> Anchors:
    """Return nine anchors, sorted by area, three for each scale.

    They are the k-means clusters of box widths and heights, with the overlap of concentric boxes as similarity (Redmon
    and Farhadi, YOLO9000, 2017, section 2).
    """
    box = dataset.box[dataset.to_find()].astype(float)
    sides = np.maximum(box[:, 2:] - box[:, :2], 2.0)
    rng = np.random.default_rng(seed)
    means = sides[rng.choice(len(sides), len(STRIDES) * ANCHORS_PER_SCALE, replace=False)]
    for _ in range(60):
        shared = np.minimum(sides[:, None], means[None]).prod(axis=2)
        near = (shared / (sides.prod(axis=1)[:, None] + means.prod(axis=1)[None] - shared)).argmax(axis=1)
        means = np.array(
            [np.median(sides[near == k], axis=0) if (near == k).any() else means[k] for k in range(len(means))]
        )
    means = means[np.argsort(means.prod(axis=1))].round(1).reshape(len(STRIDES), ANCHORS_PER_SCALE, 2)
    return tuple(tuple((float(w), float(h)) for w, h in scale) for scale in means)


def learning_rate(step: int, steps: int, highest: float) -> float:
    """Return the rate: linear warm-up, then a half cosine to 1 % (Loshchilov and Hutter 2017)."""
    rise = max(steps // 20, 1)
    if step < rise:
        return highest * (step + 1) / rise
    share = (step - rise) / max(steps - rise, 1)
    return highest * (0.01 + 0.99 * 0.5 * (1.0 + math.cos(math.pi * share)))


@torch.no_grad()
def scores(network: YoloV5 | Ssd, samples: Samples, autocast: bool) -> tuple[dict[str, float], float]:
    """Return AP at overlap 0.5 of each class, their mean over the classes that occur, and the confidence of the best
    F1."""
    device = samples.images.device
    groups = suppression_groups(IMAGE_CLASSES)
    matches: list[list[Matches]] = [[] for _ in IMAGE_CLASSES]
    present = np.zeros(len(IMAGE_CLASSES), dtype=np.int64)
    for start in range(0, len(samples), 64):
        pixels = samples.images[start : start + 64].float().div(255.0)
        with torch.autocast(device.type, torch.bfloat16, enabled=autocast):
            outputs = network(pixels.contiguous(memory_format=torch.channels_last))
        arrays = [output.float().cpu().numpy() for output in outputs]
        for index in range(len(pixels)):
            single = [array[index : index + 1] for array in arrays]
            if isinstance(network, YoloV5):
                anchors = network.anchors.cpu().numpy()
                candidates = yolo_candidates(anchors, yolo_scales(single), LEAST_CONFIDENCE)
            else:
                candidates = ssd_candidates(ssd_scales(single), LEAST_CONFIDENCE)
            best = np.argsort(-candidates.scores, kind="stable")[:500]
            separate = groups[candidates.classes[best]]
            best = best[suppress(candidates.boxes[best], candidates.scores[best], separate, 0.5)]
            objects = samples.boxes[start + index].cpu().double().numpy()
            classes = samples.classes[start + index].cpu().numpy()
            for class_number in range(len(IMAGE_CLASSES)):
                of_class = (classes == class_number) | (classes == IGNORED)
                ignored: Bools = classes[of_class] == IGNORED
                present[class_number] += int((~ignored).sum())
                detected = best[candidates.classes[best] == class_number]
                matches[class_number].append(
                    match(candidates.boxes[detected], candidates.scores[detected], objects[of_class], ignored)
                )
    precisions = {
        name: average_precision(matches[number], int(present[number]))
        for number, name in enumerate(IMAGE_CLASSES)
        if present[number]
    }
    of_all = [of_image for of_class in matches for of_image in of_class]
    any_correct = any(of_image.correct.any() for of_image in of_all)
    confidence = best_confidence(of_all, int(present.sum())) if any_correct else Description.confidence
    return {"mean": float(np.mean(list(precisions.values()))), **precisions}, confidence


def train(options: argparse.Namespace) -> None:
    device = torch.device(options.device)
    torch.manual_seed(options.seed)
    autocast = device.type == "cuda"
    started = time.perf_counter()
    dataset, validation = (Dataset.load(options.data / split) for split in ("train", "validation"))
    samples, checks = Samples(dataset, device), Samples(validation, device)
    print(f"{len(samples)} + {len(checks)} images on {device} after {time.perf_counter() - started:.0f} s", flush=True)
    anchors = fit_anchors(dataset, options.seed) if options.network == "yolov5" else None
    description = Description(options.network, IMAGE_CLASSES, INPUT_SIZE, anchors)
    network = untrained(description)
    if isinstance(network, YoloV5):
        state_rare_objects(network)
    network.to(device, memory_format=torch.channels_last)  # type: ignore[call-overload]
    defaults = default_boxes(INPUT_SIZE[1], INPUT_SIZE[0]).to(device)
    average = copy.deepcopy(network).eval().requires_grad_(False)
    # Weights and running statistics without batch counters; the optimizer changes them in place.
    averages, currents = (
        [value for value in module.state_dict().values() if value.dtype.is_floating_point]
        for module in (average, network)
    )
    decayed = [value for value in network.parameters() if value.ndim > 1]
    others = [value for value in network.parameters() if value.ndim <= 1]
    optimizer = torch.optim.AdamW(
        [{"params": decayed, "weight_decay": 0.02}, {"params": others, "weight_decay": 0.0}], lr=options.rate
    )
    draws = torch.Generator(device).manual_seed(options.seed)
    per_epoch = len(samples) // options.batch
    if not per_epoch:
        raise SystemExit(f"--batch: larger than the training set (got {options.batch}; expected up to {len(samples)})")
    steps = per_epoch * options.epochs
    best, step = -1.0, 0
    start = time.perf_counter()
    limit = options.minutes * 60.0 if options.minutes else math.inf
    for epoch in range(options.epochs):
        network.train()
        order = torch.randperm(len(samples), generator=draws, device=device)
        means: dict[str, float] = {}
        for number in range(per_epoch):
            rows = order[number * options.batch : (number + 1) * options.batch]
            pixels = samples.images[rows].float().div_(255.0)
            # With a time limit, the time determines the schedule, so that it always ends with small steps.
            progress = max(step / steps, (time.perf_counter() - start) / limit)
            if progress > UNCHANGED_FROM:
                images, targets = pixels, Targets(centered(samples.boxes[rows]), samples.classes[rows])
            else:
                images, targets = transform_images(pixels, samples.boxes[rows], samples.classes[rows], draws)
            images = change_colors(images, draws)
            for group in optimizer.param_groups:
                group["lr"] = learning_rate(int(progress * steps), steps, options.rate)
            with torch.autocast(device.type, torch.bfloat16, enabled=autocast):
                outputs = network(images.contiguous(memory_format=torch.channels_last))
            if isinstance(network, YoloV5):
                terms = yolo_loss(outputs, targets, network.anchors)
            else:
                terms = ssd_loss(outputs, targets, defaults)
            optimizer.zero_grad(set_to_none=True)
            torch.stack(list(terms.values())).sum().backward()  # type: ignore[no-untyped-call]
            nn.utils.clip_grad_norm_(network.parameters(), 10.0)
            optimizer.step()
            step += 1
            with torch.no_grad():
                decay = AVERAGE_DECAY * (1.0 - math.exp(-step / 300.0))  # small at first
                torch._foreach_lerp_(averages, currents, 1.0 - decay)
            for name, term in terms.items():
                means[name] = means.get(name, 0.0) + float(term.detach()) / per_epoch
        elapsed = time.perf_counter() - start
        is_over = elapsed > limit
        losses = " ".join(f"{name} {mean:.3f}" for name, mean in means.items())
        line = f"epoch {epoch + 1}/{options.epochs} {elapsed:.0f} s {losses}"
        if is_over or epoch + 1 == options.epochs or (epoch + 1) % options.check == 0:
            results, confidence = scores(average, checks, autocast)
            description = replace(description, confidence=round(confidence, 3))
            line += f" | AP50 {results['mean']:.4f}"
            if results["mean"] > best:
                best = results["mean"]
                path = options.out / f"{options.network}.npz"
                write_weights(path, stored_arrays(average), asdict(description))
                write_card(path, card_of(options, description, results, epoch + 1, elapsed, len(samples), len(checks)))
        print(line, flush=True)
        if is_over:
            break
    print(json.dumps(results, indent=1))


def stored_arrays(network: nn.Module) -> dict[str, NDArray[Any]]:
    """Return the weights: convolutions in half precision, other tensors in single precision."""
    arrays = {name: value.cpu().numpy() for name, value in network.state_dict().items()}
    return {name: array.astype(np.float16) if array.ndim == 4 else array for name, array in arrays.items()}


def card_of(
    options: argparse.Namespace,
    description: Description,
    results: dict[str, float],
    epochs: int,
    seconds: float,
    images: int,
    checks: int,
) -> dict[str, Any]:
    """Return the card of the weights: their origin, and their results on the validation images."""
    return {
        "network": description.network,
        "classes": list(description.classes),
        "input_size": list(description.input_size),
        "anchors": description.anchors,
        "confidence": description.confidence,
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "torch": torch.__version__,
        "data": {
            "script": "training/render_data.py",
            "seed": options.data_seed,
            "train_pictures": images,
            "validation_pictures": checks,
        },
        "training": {
            "script": "training/train.py",
            "seed": options.seed,
            "epochs": epochs,
            "batch": options.batch,
            "rate": options.rate,
            "device": torch.cuda.get_device_name(options.device) if options.device.startswith("cuda") else "CPU",
            "seconds": round(seconds),
        },
        "validation_ap50": {name: round(value, 4) for name, value in results.items()},
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("network", choices=("yolov5", "ssd"))
    parser.add_argument("--data", type=Path, default=Path("training/data"))
    parser.add_argument("--data-seed", type=int, default=1, help="seed of render_data.py, for the metadata")
    parser.add_argument("--out", type=Path, default=Path("training/out"))
    parser.add_argument("--epochs", type=int, default=120)
    parser.add_argument("--minutes", type=float, default=0.0, help="maximum duration; 0 for no limit")
    parser.add_argument("--batch", type=int, default=32)
    parser.add_argument("--rate", type=float, default=2e-3)
    parser.add_argument("--check", type=int, default=15, help="number of epochs between validations")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    train(parser.parse_args())


if __name__ == "__main__":
    main()
