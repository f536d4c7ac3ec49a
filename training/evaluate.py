"""How well the detectors see: `make eval`, or `python -m training.evaluate`.

On at least 1,000 held-out pictures (rendered first, where they are not there yet) and on the library's own scenes:
average precision at overlap 0.5 with the detections sorted over the whole set, recall by class, distance and weather;
what is the matter with what is missed; traffic lights; error of lifted centers by distance; recall against fog and
darkness; size and time. Writes reports/detection.md, .json and .png.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2

from eidrive_scenario.perception.learned.classes import IMAGE_CLASSES
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
from training.judging import center_errors, held_out, judge_dataset, judge_scenes, milliseconds, parameters
from training.light_scenes import light_scenes
from training.light_scores import light_table, readings
from training.misses import misses
from training.scenes import Seen, library_scenes, random_scenes
from training.scoring import VEHICLES, Judged, Part, score
from training.sweeps import plot_sweeps, sweeps
from training.tables import WEATHERS, Table, as_markdown, error_table, tables_of

DETECTORS: dict[str, type[LearnedDetector]] = {"yolov5": YoloDetector, "ssd": SsdDetector}
LOW = 0.01
"""Confidence from which boxes count for average precision."""

INTRODUCTION = """# What the learned detectors see

AP50 is average precision at an overlap of 0.5, the detections of the whole set sorted by score. Recall is that at the
confidence from which on the detector itself believes its boxes. Asked for is what is at least 8 pixels high and shows
30 pixels and a fifth of its silhouette; in the table against the aims, vehicles within 40 m and at least 15 pixels
high. Vehicles are taken as one class there: a truck found as a car is found.
"""


def evaluate(options: argparse.Namespace) -> None:
    """Everything, one table after the other."""
    cv2.setNumThreads(1)
    names = [name for name in DETECTORS if (SHIPPED / f"{name}.npz").is_file()]
    own = {name: build_network(name, LearnedSettings()) for name in names}
    low = {name: build_network(name, LearnedSettings(confidence=LOW)) for name in names}
    dataset = held_out(options.data / "held_out", options.seed, options.pictures, options.processes)
    clear = Weather(name="clear")
    fog = load_weather("foggy_morning").model_copy(update={"name": "fog"})
    scenes = list(library_scenes([clear, fog]))
    print(f"{len(dataset)} held-out pictures, {len(scenes)} of the library's scenes", flush=True)
    tables: list[Table] = []

    def add(found: Sequence[Table]) -> None:
        tables.extend(found)
        print(as_markdown(found), flush=True)

    add([_size_and_time(own, scenes[0])])
    judged = {name: judge_dataset(low[name], dataset, own[name].confidence) for name in names}
    add([*tables_of(judged, "Held-out pictures"), misses(judged, dataset)])
    in_library = {name: judge_scenes(low[name], scenes, own[name].confidence) for name in names}
    add(tables_of(in_library, "Library scenes"))
    seen = light_scenes(options.seed, "lights held_out", options.light_worlds, options.processes)
    add([light_table(readings(own, seen))])
    others = list(random_scenes(options.seed, "held_out lidar", options.worlds, clear))
    add(_lifting("Library scenes, clear", [scene for scene in scenes if scene.weather == "clear"], names))
    add(_lifting("Random scenes, clear", others, names))
    curves = sweeps(own, options.seed, options.sweep_worlds)
    write_report(options.out, tables, curves)
    if options.cards:
        for name in names:
            add_to_card(name, judged[name], len(dataset))


def _size_and_time(networks: Mapping[str, ImageNetwork], scene: Seen) -> Table:
    picture = scene.readings.cameras["camera"].rgb
    rows = []
    for name, network in networks.items():
        path = SHIPPED / f"{name}.npz"
        size = f"{path.stat().st_size / 1e6:.2f}"
        rows.append([name, f"{parameters(path):,}", size, f"{milliseconds(network, picture):.1f}"])
    title = f"Size and processor time, one thread, pictures of {picture.shape[1]} x {picture.shape[0]}"
    return title, ["detector", "parameters", "file [MB]", "ms"], rows


def _lifting(of: str, scenes: Sequence[Seen], names: Sequence[str]) -> list[Table]:
    """Errors of lifted centers, with the LiDAR and without."""
    found = []
    for sensors, use_lidar in (("camera and LiDAR", True), ("camera alone", False)):
        errors = {name: center_errors(DETECTORS[name], scenes, use_lidar) for name in names}
        found.append(error_table(errors, f"{of}, {sensors}"))
    return found


def write_report(out: Path, tables: Sequence[Table], curves: Mapping[str, Any]) -> None:
    """The report as text, as data, and its curves."""
    text = as_markdown(tables)
    out.mkdir(parents=True, exist_ok=True)
    (out / "detection.md").write_text(f"{INTRODUCTION}\n{text}\n", encoding="utf-8")
    record: dict[str, Any] = {
        "tables": [{"title": title, "head": head, "rows": rows} for title, head, rows in tables],
        "recall_against_weather": curves,
    }
    (out / "detection.json").write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    plot_sweeps(curves, out / "detection.png")
    print(f"written: {out / 'detection.md'}, .json, .png")


def add_to_card(name: str, judged: Sequence[Judged], pictures: int) -> None:
    """What shipped weights reach on the held-out pictures, into the card beside them."""
    path = SHIPPED / f"{name}.json"
    card = json.loads(path.read_text(encoding="utf-8"))
    card["held_out"] = {"script": "training/evaluate.py", "images": pictures}
    for weather in WEATHERS:
        part = Part(VEHICLES, farthest=40.0, height=15.0, weather=weather)
        card["held_out"][f"vehicles_within_40_m_ap50_{weather}"] = round(score(judged, part).precision, 4)
    for each in IMAGE_CLASSES:
        precision = score(judged, Part((each,), weather="clear")).precision
        card["held_out"][f"{each.replace(' ', '_')}_ap50_clear"] = round(precision, 4)
    path.write_text(json.dumps(card, indent=1) + "\n", encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=Path("training/data"))
    parser.add_argument("--out", type=Path, default=Path("reports"))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--pictures", type=int, default=1200, help="held out; rendered once")
    parser.add_argument("--light-worlds", type=int, default=80, help="six pictures with traffic lights each")
    parser.add_argument("--worlds", type=int, default=30, help="random scenes with LiDAR")
    parser.add_argument("--sweep-worlds", type=int, default=20, help="scenes in each weather of the curves")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--cards", action="store_true", help="write the results into the cards of the shipped weights")
    evaluate(parser.parse_args())


if __name__ == "__main__":
    main()
