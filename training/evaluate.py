"""How well the detectors see: `make eval`, or `python -m training.evaluate`.

On at least 1,000 held-out pictures (rendered first, where they are not there yet) and on the library's own scenes:
average precision at overlap 0.5 with the detections sorted over the whole set, recall by class, distance and weather;
error of lifted centres by distance; recall against fog and darkness; size and time. Writes reports/detection.md, .json
and .png.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.perception.learned.classes import IMAGE_CLASSES, LIGHT
from eidrive_scenario.perception.learned.detector import (
    SHIPPED,
    LearnedDetector,
    LearnedSettings,
    SsdDetector,
    YoloDetector,
    build_network,
)
from eidrive_scenario.perception.learned.image_network import ImageNetwork
from eidrive_scenario.world.weather import Weather, load_weather
from training.dataset import Dataset, shows_enough, write
from training.labels import Label
from training.render_data import PER_WORLD, Shot, render, table
from training.scenes import Seen, library_scenes, random_scenes
from training.scoring import ROAD_USERS, VEHICLES, Judged, Objects, Part, as_one_light, mean_precision, score
from training.sweeps import plot_sweeps, sweeps

Array = NDArray[np.float64]

DETECTORS: dict[str, type[LearnedDetector]] = {"yolov5": YoloDetector, "ssd": SsdDetector}
LOW = 0.01
"""Confidence from which boxes count for average precision."""
DISTANCES = ((0.0, 20.0), (20.0, 40.0), (40.0, 60.0), (60.0, 100.0))
WEATHERS = ("clear", "overcast", "fog", "rain", "snow", "dusk", "night")
MATCHED_WITHIN = 4.0
"""Lifted boxes farther from every object's centre than this are not of one [m]."""

Table = tuple[str, list[str], list[list[str]]]


def held_out(folder: Path, seed: int, pictures: int, processes: int) -> Dataset:
    """The held-out pictures, rendered where they are missing."""
    if not (folder / "labels.npz").is_file():
        taken: list[Shot] = []
        worlds = -(-pictures // PER_WORLD)
        for number, found in enumerate(render(seed, "held_out", worlds, 0, processes)):
            taken += found
            print(f"\rrendering held-out pictures: {(number + 1) * PER_WORLD}/{worlds * PER_WORLD}", end="", flush=True)
        print()
        write(folder, [entry.data for entry in taken], table(taken))
    return Dataset.load(folder)


def judge_dataset(network: ImageNetwork, dataset: Dataset, confidence: float) -> list[Judged]:
    """What a network finds in the pictures of a dataset."""
    to_find = dataset.to_find()
    judged = []
    for number, picture in enumerate(dataset.pictures()):
        rows = dataset.objects(number)
        objects = Objects(
            boxes=dataset.box[rows].astype(float),
            names=tuple(IMAGE_CLASSES[which] for which in dataset.number[rows]),
            height=dataset.height[rows].astype(float),
            distance=dataset.distance[rows].astype(float),
            to_find=to_find[rows],
        )
        judged.append(Judged(objects, network.find(picture), str(dataset.weather[number]), confidence))
    return judged


def judge_scenes(network: ImageNetwork, scenes: Sequence[Seen], confidence: float) -> list[Judged]:
    """The same for scenes."""
    return [
        Judged(_objects(seen.labels), network.find(seen.readings.cameras["camera"].rgb), seen.weather, confidence)
        for seen in scenes
    ]


def _objects(labels: Sequence[Label]) -> Objects:
    boxes = np.array([label.box for label in labels], dtype=float).reshape(-1, 4)
    height = boxes[:, 3] - boxes[:, 1]
    seen, whole = (np.array([getattr(label, key) for label in labels], dtype=float) for key in ("seen", "whole"))
    return Objects(
        boxes=boxes,
        names=tuple(IMAGE_CLASSES[label.number] for label in labels),
        height=height,
        distance=np.array([label.distance for label in labels], dtype=float),
        to_find=shows_enough(height, seen, whole),
    )


def centre_errors(kind: type[LearnedDetector], scenes: Iterable[Seen], use_lidar: bool) -> Array:
    """(K, 2) distance of each vehicle that was found [m], and how far off in plan view its lifted centre is [m]."""
    detector = kind(LearnedSettings())
    found = []
    for seen in scenes:
        readings = seen.readings
        if not use_lidar:
            readings = type(readings)(readings.time, readings.ego, cameras=readings.cameras)
        detector.install(seen.installation)
        detections = detector.detect(readings)
        objects = _objects(seen.labels)
        vehicles = [
            label
            for label, enough in zip(seen.labels, objects.to_find, strict=True)
            if enough and IMAGE_CLASSES[label.number] in VEHICLES
        ]
        centres = np.array([label.place[:2] for label in vehicles], dtype=float).reshape(-1, 2)
        free = np.ones(len(vehicles), dtype=bool)
        for row in np.argsort(-detections.scores, kind="stable"):
            away = np.linalg.norm(centres - detections.boxes[row, :2], axis=1)
            away[~free] = np.inf
            if len(away) and away.min() <= MATCHED_WITHIN:
                nearest = int(np.argmin(away))
                free[nearest] = False
                found.append((vehicles[nearest].distance, float(away[nearest])))
    return np.array(found).reshape(-1, 2)


def milliseconds(network: ImageNetwork, picture: NDArray[np.uint8], repeats: int = 60) -> float:
    """Median time for one picture [ms]."""
    times = []
    for _ in range(repeats + 5):
        started = time.perf_counter()
        network.find(picture)
        times.append(time.perf_counter() - started)
    return float(np.median(times[5:])) * 1e3


def _text(value: float) -> str:
    return "-" if np.isnan(value) else f"{value:.3f}"


def tables_of(judged: dict[str, list[Judged]], of: str) -> list[Table]:
    """Average precision and recall by weather, class and distance."""

    def row(name: str, part: Part, pictures: Callable[[str], list[Judged]]) -> list[str]:
        cells = [name]
        for detector in judged:
            result = score(pictures(detector), part)
            cells += [_text(result.precision), _text(result.recall)]
        return [*cells, str(result.objects)]

    def all_of(detector: str) -> list[Judged]:
        return judged[detector]

    weathers = sorted({entry.weather for entry in next(iter(judged.values()))}, key=WEATHERS.index)
    head = [f"{name} {what}" for name in judged for what in ("AP50", "recall")] + ["objects"]
    found: list[Table] = [
        (
            f"{of}: vehicles within 40 m and at least 15 px high",
            ["weather", *head],
            [
                *(
                    row(weather, Part(VEHICLES, farthest=40.0, height=15.0, weather=weather), all_of)
                    for weather in weathers
                ),
                *(
                    row(f"clear, {name} alone", Part((name,), farthest=40.0, height=15.0, weather="clear"), all_of)
                    for name in VEHICLES
                ),
            ],
        )
    ]
    for weather in [name for name in ("clear", "fog") if name in weathers]:
        rows = [row(name, Part((name,), weather=weather), all_of) for name in IMAGE_CLASSES]
        lights = {name: as_one_light(entries) for name, entries in judged.items()}
        rows.append(row(f"{LIGHT}, any state", Part((LIGHT,), weather=weather), lights.__getitem__))
        mean = ["mean of classes"]
        for entries in judged.values():
            mean += [_text(mean_precision(entries, IMAGE_CLASSES, weather)), ""]
        rows.append([*mean, ""])
        found.append((f"{of}, {weather}: by class", ["class", *head], [r for r in rows if r[-1] != "0"]))
        found.append(
            (
                f"{of}, {weather}: road users by distance",
                ["class and distance", *head],
                [
                    row(f"{title} {near:.0f} to {far:.0f} m", Part(names, near, far, weather=weather), all_of)
                    for title, names in (("vehicles", VEHICLES), ("others", ROAD_USERS[3:]))
                    for near, far in DISTANCES
                ],
            )
        )
    return found


def error_table(errors: dict[str, Array], of: str) -> Table:
    """Medians of the errors of lifted centres."""
    bins = (
        ("all within 30 m", 0.0, 30.0),
        *((f"{a:.0f} to {b:.0f} m", a, b) for a, b in ((0, 10), (10, 20), (20, 30), (30, 50))),
    )
    rows = []
    for name, low, high in bins:
        cells = [name]
        for found in errors.values():
            inside = found[(found[:, 0] >= low) & (found[:, 0] < high), 1]
            if len(inside):
                cells += [f"{np.median(inside):.2f}", f"{np.percentile(inside, 90):.2f}", str(len(inside))]
            else:
                cells += ["-", "-", "0"]
        rows.append(cells)
    head = [f"{name} {what}" for name in errors for what in ("median", "90 %", "n")]
    return f"{of}: error of lifted centres in plan view [m]", ["distance", *head], rows


def as_markdown(tables: Sequence[Table]) -> str:
    """Tables as text that is also easy to read unrendered."""
    lines = []
    for title, head, rows in tables:
        widths = [max(len(row[column]) for row in (head, *rows)) for column in range(len(head))]
        lines += [f"## {title}", ""]
        for row in (head, ["-" * width for width in widths], *rows):
            lines.append("| " + " | ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) + " |")
        lines.append("")
    return "\n".join(lines)


def evaluate(options: argparse.Namespace) -> None:
    cv2.setNumThreads(1)
    names = [name for name in DETECTORS if (SHIPPED / f"{name}.npz").is_file()]
    networks = {name: build_network(name, LearnedSettings(confidence=LOW)) for name in names}
    dataset = held_out(options.data / "held_out", options.seed, options.pictures, options.processes)
    tables: list[Table] = []
    clear = Weather(name="clear")
    fog = load_weather("foggy_morning").model_copy(update={"name": "fog"})
    scenes = list(library_scenes([clear, fog]))
    others = list(random_scenes(options.seed, "held_out lidar", options.worlds, clear))
    picture = scenes[0].readings.cameras["camera"].rgb
    own = {name: build_network(name, LearnedSettings()) for name in names}
    tables.append(
        (
            "Size and time, one core, pictures of 800 x 600",
            ["detector", "parameters", "file [MB]", "ms"],
            [
                [
                    name,
                    f"{_parameters(SHIPPED / f'{name}.npz'):,}",
                    f"{(SHIPPED / f'{name}.npz').stat().st_size / 1e6:.2f}",
                    f"{milliseconds(own[name], picture):.1f}",
                ]
                for name in names
            ],
        )
    )
    print(f"{len(dataset)} held-out pictures, {len(scenes)} of the library's scenes", flush=True)
    judged = {name: judge_dataset(networks[name], dataset, own[name].confidence) for name in names}
    tables += tables_of(judged, "Held-out pictures")
    tables += tables_of(
        {name: judge_scenes(networks[name], scenes, own[name].confidence) for name in names}, "Library scenes"
    )
    for of, some in (
        ("Library scenes, clear", [s for s in scenes if s.weather == "clear"]),
        ("Random scenes, clear", others),
    ):
        for sensor, use_lidar in (("camera and LiDAR", True), ("camera alone", False)):
            errors = {name: centre_errors(DETECTORS[name], some, use_lidar) for name in names}
            tables.append(error_table(errors, f"{of}, {sensor}"))
    curves = sweeps(own, options.seed, options.sweep_worlds)
    text = as_markdown(tables)
    print(text)
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "detection.md").write_text(f"# What the learned detectors see\n\n{text}\n", encoding="utf-8")
    record: dict[str, Any] = {
        "tables": [{"title": title, "head": head, "rows": rows} for title, head, rows in tables],
        "recall_against_weather": curves,
    }
    (options.out / "detection.json").write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    plot_sweeps(curves, options.out / "detection.png")
    if options.cards:
        for name in names:
            add_to_card(name, judged[name], len(dataset))
    print(f"written: {options.out / 'detection.md'}, .json, .png")


def add_to_card(name: str, judged: Sequence[Judged], pictures: int) -> None:
    """What shipped weights reach on the held-out pictures, into the card beside them."""
    path = SHIPPED / f"{name}.json"
    card = json.loads(path.read_text(encoding="utf-8"))
    card["held_out"] = {"script": "training/evaluate.py", "pictures": pictures}
    for weather in WEATHERS:
        part = Part(VEHICLES, farthest=40.0, height=15.0, weather=weather)
        card["held_out"][f"vehicles_within_40_m_ap50_{weather}"] = round(score(judged, part).precision, 4)
    for each in IMAGE_CLASSES:
        card["held_out"][f"{each.replace(' ', '_')}_ap50_clear"] = round(
            score(judged, Part((each,), weather="clear")).precision, 4
        )
    path.write_text(json.dumps(card, indent=1) + "\n", encoding="utf-8")


def _parameters(path: Path) -> int:
    """Numbers that were learned, in a file of weights; running means and the like aside."""
    with np.load(path) as stored:
        return sum(int(stored[name].size) for name in stored.files if name.endswith((".weight", ".bias")))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=Path("training/data"))
    parser.add_argument("--out", type=Path, default=Path("reports"))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--pictures", type=int, default=1200, help="held out; rendered once")
    parser.add_argument("--worlds", type=int, default=30, help="random scenes with LiDAR")
    parser.add_argument("--sweep-worlds", type=int, default=20, help="scenes in each weather of the curves")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--cards", action="store_true", help="write the results into the cards of the shipped weights")
    evaluate(parser.parse_args())


if __name__ == "__main__":
    main()
