"""Evaluation of the learned detectors: `make eval`, or `python -m training.evaluate`.

The detectors are evaluated on at least 1,000 held-out images, which are rendered if they are missing, and on the scenes
of the library: average precision at overlap 0.5 with detections sorted over the whole set; recall by class, distance
and weather; causes of misses; traffic lights; errors of lifted centers by distance; recall against fog and darkness;
size and time; average precision by runtime; recall of `ssd_openimages`, if it is installed. Writes
reports/detection.md, .json and .png.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2

from eidrive_scenario.perception.learned.detector import LearnedDetector, SsdDetector, YoloDetector
from eidrive_scenario.perception.learned.image_network import IMAGE_CLASSES, VEHICLES, ImageNetwork
from eidrive_scenario.perception.learned.network_loading import SHIPPED, build_network
from eidrive_scenario.perception.learned.openimages import ARCHIVE
from eidrive_scenario.perception.learned.settings import LearnedSettings
from eidrive_scenario.world.weather import Weather, load_weather
from training.image_evaluation import (
    center_errors,
    evaluate_dataset,
    evaluate_scenes,
    milliseconds,
    parameters,
)
from training.light_scenes import light_scenes
from training.light_scores import light_table, readings
from training.misses import misses
from training.realism import realism_tables
from training.render_data import rendered
from training.runtime_scores import runtime_table
from training.scenes import StationScene, library_scenes, random_scenes
from training.scoring import EvaluatedImage, Part, score
from training.sweeps import plot_sweeps, sweeps
from training.tables import WEATHERS, Table, as_markdown, error_table, tables_of
from training.weight_files import update_card

DETECTORS: dict[str, type[LearnedDetector]] = {"yolov5": YoloDetector, "ssd": SsdDetector}
LOW = 0.01
"""Minimum confidence of boxes for average precision."""

INTRODUCTION = """# Evaluation of the learned detectors

AP50 is average precision at an overlap of 0.5, with the detections of the whole set sorted by score. Recall is that at
the default confidence of the detector. Required objects are at least 8 pixels high and show 30 pixels and a fifth of
their silhouette; in the table of the aims, vehicles within 40 m that are at least 15 pixels high. Vehicles are one
class there: a truck that is detected as a car counts as detected.
"""


def evaluate(options: argparse.Namespace) -> None:
    """Compute and print all tables."""
    cv2.setNumThreads(1)
    names = [name for name in DETECTORS if (SHIPPED / f"{name}.npz").is_file()]
    networks = {name: build_network(name, LearnedSettings()) for name in names}
    sensitive_networks = {name: build_network(name, LearnedSettings(confidence=LOW)) for name in names}
    dataset = rendered(options.data, options.seed, "held_out", options.pictures, options.processes)
    clear = Weather(name="clear")
    fog = load_weather("foggy_morning").model_copy(update={"name": "fog"})
    scenes = list(library_scenes([clear, fog]))
    print(f"{len(dataset)} held-out images, {len(scenes)} scenes of the library", flush=True)
    tables: list[Table] = []

    def add(new_tables: Sequence[Table]) -> None:
        tables.extend(new_tables)
        print(as_markdown(new_tables), flush=True)

    add([_size_and_time(networks, scenes[0])])
    evaluated = {name: evaluate_dataset(sensitive_networks[name], dataset, networks[name].confidence) for name in names}
    add([*tables_of(evaluated, "Held-out images"), misses(evaluated, dataset)])
    add([runtime_table(names, dataset, options.runtime_pictures, LOW)])
    add(realism_tables(dataset, options.openimages, options.photographs, networks))
    in_library = {name: evaluate_scenes(sensitive_networks[name], scenes, networks[name].confidence) for name in names}
    add(tables_of(in_library, "Library scenes"))
    lights = light_scenes(options.seed, "lights held_out", options.light_worlds, options.processes)
    add([light_table(readings(networks, lights))])
    random = list(random_scenes(options.seed, "held_out lidar", options.worlds, clear))
    add(_lifting("Library scenes, clear", [scene for scene in scenes if scene.weather == "clear"], names))
    add(_lifting("Random scenes, clear", random, names))
    curves = sweeps(networks, options.seed, options.sweep_worlds)
    write_report(options.out, tables, curves)
    if options.cards:
        for name in names:
            add_to_metadata(name, evaluated[name], len(dataset))


def _size_and_time(networks: Mapping[str, ImageNetwork], scene: StationScene) -> Table:
    image = scene.readings.cameras["camera"].rgb
    rows = []
    for name, network in networks.items():
        path = SHIPPED / f"{name}.npz"
        size = f"{path.stat().st_size / 1e6:.2f}"
        rows.append([name, f"{parameters(path):,}", size, f"{milliseconds(network, image):.1f}"])
    title = f"Size and processor time, one thread, images of {image.shape[1]} x {image.shape[0]}"
    return title, ["detector", "parameters", "file [MB]", "ms"], rows


def _lifting(of: str, scenes: Sequence[StationScene], names: Sequence[str]) -> list[Table]:
    """Return errors of lifted centers, with and without the lidar."""
    return [
        error_table({name: center_errors(DETECTORS[name], scenes, lidar) for name in names}, f"{of}, {sensors}")
        for sensors, lidar in (("camera and lidar", True), ("camera alone", False))
    ]


def write_report(out: Path, tables: Sequence[Table], curves: Mapping[str, Any]) -> None:
    """Write the report as text and as data, and its curves."""
    out.mkdir(parents=True, exist_ok=True)
    (out / "detection.md").write_text(f"{INTRODUCTION}\n{as_markdown(tables)}\n", encoding="utf-8")
    record: dict[str, Any] = {
        "tables": [{"title": title, "head": head, "rows": rows} for title, head, rows in tables],
        "recall_against_weather": curves,
    }
    (out / "detection.json").write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    plot_sweeps(curves, out / "detection.png")
    print(f"written: {out / 'detection.md'}, .json, .png")


def add_to_metadata(name: str, evaluated: Sequence[EvaluatedImage], pictures: int) -> None:
    """Write the results on the held-out images into the metadata of the shipped weights."""
    parts = {
        f"vehicles_within_40_m_ap50_{weather}": Part(VEHICLES, farthest=40.0, height=15.0, weather=weather)
        for weather in WEATHERS
    }
    parts |= {f"{each.replace(' ', '_')}_ap50_clear": Part((each,), weather="clear") for each in IMAGE_CLASSES}
    precisions = {key: round(score(evaluated, part).precision, 4) for key, part in parts.items()}
    held_out = {"script": "training/evaluate.py", "images": pictures, **precisions}
    update_card(SHIPPED / f"{name}.npz", held_out=held_out)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=Path("training/data"))
    parser.add_argument("--out", type=Path, default=Path("reports"))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--pictures", type=int, default=1200, help="number of held-out images; rendered once")
    parser.add_argument("--runtime-pictures", type=int, default=240, help="number of these images for each runtime")
    parser.add_argument("--openimages", type=Path, default=Path(ARCHIVE), help="npm package of ssd_openimages")
    parser.add_argument(
        "--photographs", type=Path, help="folder with the folders darknet and opencv of training/realism.py"
    )
    parser.add_argument("--light-worlds", type=int, default=80, help="places with six images of traffic lights each")
    parser.add_argument("--worlds", type=int, default=30, help="places of random scenes with lidar")
    parser.add_argument("--sweep-worlds", type=int, default=20, help="number of scenes per weather of the curves")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument(
        "--cards", action="store_true", help="write the results into the metadata of the shipped weights"
    )
    evaluate(parser.parse_args())


if __name__ == "__main__":
    main()
