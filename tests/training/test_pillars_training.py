"""Training of the detector `pillars` against the engine: network, input grid, and overlap of bodies."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from eidrive_scenario.base.geometry import overlap
from eidrive_scenario.perception.geometry.lidar_geometry import LevelFrame
from eidrive_scenario.perception.learned.pillars.grid import ScanHistory
from eidrive_scenario.perception.learned.pillars.network import PillarNetwork
from eidrive_scenario.perception.learned.weights import DESCRIPTION
from eidrive_scenario.sensing.readings import LidarReading
from eidrive_scenario.v2x.messages.point_cloud import compress
from training.pillars.scenes import CLASSES, overlaps

torch = pytest.importorskip("torch")


def test_folded_weights_give_the_outputs_of_the_trained_network(tmp_path: Path) -> None:
    from training.pillars.network import Pillars

    torch.manual_seed(3)
    network = Pillars()
    for module in network.modules():
        if isinstance(module, torch.nn.BatchNorm2d):
            torch.nn.init.uniform_(module.weight, 0.5, 1.5)
            torch.nn.init.uniform_(module.bias, -0.2, 0.5)
            module.running_mean.uniform_(-0.2, 0.2)
            module.running_var.uniform_(0.5, 2.0)
    network.eval()
    description = {"network": "pillars", "classes": CLASSES, "input_size": [256, 256]}
    path = tmp_path / "pillars.npz"
    arrays: dict[str, Any] = {**network.folded(), DESCRIPTION: np.array(json.dumps(description))}
    np.savez(path, codebook=np.zeros((256, 8), dtype=np.float32), **arrays)
    grid = np.random.default_rng(3).random((12, 256, 256), dtype=np.float32)
    engine = PillarNetwork(path, "opencv")
    features = engine.features(grid)
    with torch.no_grad():
        expected = network.features(torch.from_numpy(grid)[None])
        maps = network.head(expected)[0].numpy()
        latent = network.compress(expected)
        sent = network.sent(expected)[0].flatten(1)
        received = network.received(network.sent(expected))[0].flatten(1)[:, :50].numpy()
    np.testing.assert_allclose(features, expected[0].numpy(), atol=2e-4)
    np.testing.assert_allclose(engine.objects(features), maps, atol=1e-3)
    np.testing.assert_allclose(engine.compress(features), latent[0].numpy(), atol=1e-3)
    codes = engine.codec.to_int8(latent[0].flatten(1).numpy())
    np.testing.assert_allclose(engine.codec.from_int8(codes), sent.numpy(), atol=1e-6)
    np.testing.assert_allclose(engine.codec.expand(sent[:, :50].numpy()), received, atol=1e-4)


@pytest.fixture
def samples(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Module `samples`, without Triton."""
    language = SimpleNamespace()
    monkeypatch.setitem(sys.modules, "triton", SimpleNamespace(jit=lambda function: function, language=language))
    monkeypatch.setitem(sys.modules, "triton.language", language)
    from training.pillars import samples

    return samples


def test_grids_of_training_are_those_of_the_engine(samples: Any) -> None:
    """Two scans of a station at rest, with points 1 m above a level ground and below the clearance."""
    rng = np.random.default_rng(4)
    plan = rng.uniform(-55.0, 55.0, (4000, 2))
    ground = np.column_stack([plan, np.full(len(plan), -2.0)])
    standing = np.column_stack([rng.uniform(-30.0, 30.0, (500, 2)), rng.uniform(-1.5, 1.0, 500)])
    clouds = [np.concatenate([ground, standing + shift]) for shift in ((0.0, 0.0, 0.0), (0.37, -0.21, 0.0))]
    intensity = rng.random(len(clouds[0]))
    pose = np.eye(4)
    pose[2, 3] = 2.0
    history, frame = ScanHistory(), LevelFrame(0.0, 0.0, 2.0, 0.0)
    for time, cloud in zip((0.0, 0.2), clouds, strict=True):
        grid = history.add(time, [LidarReading(cloud, intensity, pose)], frame, 0.0)
    points, before = (torch.from_numpy(cloud + np.array([0.0, 0.0, 2.0]))[None].float() for cloud in reversed(clouds))
    returned, strength = torch.ones(1, len(intensity), dtype=torch.bool), torch.from_numpy(intensity)[None].float()
    slots = torch.zeros(1, len(intensity), dtype=torch.int32)
    now, earlier = (samples.Scans(part, returned, strength, slots) for part in (points, before))
    trained = samples._grids(now, earlier)[0].numpy()
    different = ~np.isclose(trained, grid.channels, atol=2e-3)
    assert different.mean() < 1e-4, "except points on the border of a cell"
    assert (grid.channels[0] > 0.0).sum() > 400


def test_merged_points_of_training_are_those_of_early_fusion(samples: Any) -> None:
    """Three stations, whose grids are centered 4 and 8 m apart; the first two points are on the body of the first."""
    rng = np.random.default_rng(6)
    world = np.round(rng.uniform(-6.0, 6.0, (3, 400, 3)), 1) + 0.03
    center = torch.tensor([[0.0, 0.0], [4.0, 0.0], [0.0, 8.0]])
    points = torch.from_numpy(world).float() - torch.cat([center, torch.zeros(3, 1)], dim=1)[:, None]
    returned, slots = torch.ones(3, 400, dtype=torch.bool), torch.full((3, 400), 5, dtype=torch.int32)
    returned[:, -20:] = False
    slots[:, :2] = 7
    scans = samples.Scans(points, returned, torch.full((3, 400), 0.25), slots)
    shown = samples._merged(scans, center, torch.tensor([7, 1, -1]), torch.zeros(3, 3))
    sent = [compress(world[station, 2:-20].astype(np.float32).astype(float), 0.0, 0.1).points() for station in (1, 2)]
    own = shown.intensity == 0.25
    np.testing.assert_allclose(shown.points[own & shown.returned].numpy(), world[0, :-20], atol=1e-5)
    received = shown.points[~own & shown.returned].numpy()
    assert (shown.intensity[~own] == 1.0).all()
    assert len(received) == sum(map(len, sent))
    np.testing.assert_allclose(np.sort(received.sum(axis=1)), np.sort(np.concatenate(sent).sum(axis=1)), atol=1e-4)


def test_overlap_of_bodies_is_that_of_the_engine() -> None:
    rng = np.random.default_rng(5)
    boxes = np.column_stack(
        [rng.uniform(-6.0, 6.0, (200, 2)), rng.uniform(0.4, 8.0, (200, 2)), rng.uniform(-4.0, 4.0, 200)]
    )
    own = np.array([0.0, 0.0, 5.0, 2.0, 0.6])
    expected = [overlap(_in_space(own), _in_space(box)) for box in boxes]
    assert [overlaps(own, box[None]) for box in boxes] == expected
    assert 20 < sum(expected) < 180


def _in_space(box: np.ndarray[Any, Any]) -> tuple[float, ...]:
    x, y, length, width, yaw = box.tolist()
    return x, y, 0.0, length, width, 1.0, yaw
