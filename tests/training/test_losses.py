"""Networks and their losses: shapes, encoding, assignment, folding, and training."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the extra 'learned'")

from eidrive_scenario.perception.learned.image_network import (  # noqa: E402
    IMAGE_CLASSES,
    Candidates,
)
from eidrive_scenario.perception.learned.networks.blocks import fold  # noqa: E402
from eidrive_scenario.perception.learned.networks.ssd import Ssd  # noqa: E402
from eidrive_scenario.perception.learned.networks.ssd_sizes import (  # noqa: E402
    BOXES_PER_CELL,
    MAX_LOG_SIZE,
    STRIDES,
    VARIANCES,
)
from eidrive_scenario.perception.learned.networks.yolov5 import YoloV5  # noqa: E402
from eidrive_scenario.perception.learned.own_network import (  # noqa: E402
    ssd_candidates,
    ssd_scales,
    yolo_candidates,
    yolo_scales,
)
from training.boxes import (  # noqa: E402
    IGNORED,
    PADDING,
    Targets,
    centered,
    complete_iou,
    corners,
    pairwise_iou,
)
from training.losses import (  # noqa: E402
    BACKGROUND,
    UNLABELED,
    assign,
    cell_corners,
    default_boxes,
    encode,
    hardest,
    match,
    ssd_loss,
    ssd_rows,
    state_rare_objects,
    yolo_cells,
    yolo_loss,
)

ANCHORS = (
    ((8.0, 10.0), (18.0, 14.0), (12.0, 30.0)),
    ((40.0, 26.0), (30.0, 60.0), (70.0, 44.0)),
    ((110.0, 70.0), (160.0, 120.0), (300.0, 200.0)),
)


@pytest.fixture(autouse=True)
def one_thread() -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def yolo() -> YoloV5:
    torch.manual_seed(0)
    network = YoloV5(len(IMAGE_CLASSES), ANCHORS)
    state_rare_objects(network)
    return network


def ssd() -> Ssd:
    torch.manual_seed(0)
    return Ssd(len(IMAGE_CLASSES))


def ssd_decode(encoded: Any, defaults: Any) -> Any:
    """Return boxes (…, N, 4) in center form: the inverse of `encode`."""
    center = encoded[..., :2] * VARIANCES[0] * defaults[..., 2:] + defaults[..., :2]
    size = torch.exp((encoded[..., 2:] * VARIANCES[1]).clamp(max=MAX_LOG_SIZE)) * defaults[..., 2:]
    return torch.cat([center, size], dim=-1)


def yolo_decode(network: YoloV5, scales: list[Any]) -> Any:
    """Return (B, N, 5 + C) of outputs (B, A, H, W, 5 + C): cx cy w h [px], objectness, probability of each class."""
    predictions = []
    for scale, (raw, stride) in enumerate(zip(scales, (8, 16, 32), strict=True)):
        share = raw.sigmoid()
        center = (2.0 * share[..., :2] - 0.5 + cell_corners(raw.shape[2], raw.shape[3], raw.device)) * stride
        size = (2.0 * share[..., 2:4]).square() * network.anchors[scale][None, :, None, None, :]
        predictions.append(torch.cat([center, size, share[..., 4:]], dim=-1).flatten(1, 3))
    return torch.cat(predictions, dim=1)


def two_objects(boxes: list[list[float]], classes: list[int]) -> Targets:
    return Targets(torch.tensor([boxes]), torch.tensor([classes]))


def test_networks_have_documented_output_shapes_and_sizes() -> None:
    images = torch.zeros(2, 3, 128, 256)
    outputs = yolo_cells(yolo()(images))
    assert [tuple(output.shape) for output in outputs] == [
        (2, 3, 16, 32, 16),
        (2, 3, 8, 16, 16),
        (2, 3, 4, 8, 16),
    ]
    encoded, logits = ssd_rows(ssd()(images))
    count = BOXES_PER_CELL * sum((128 // stride) * (256 // stride) for stride in STRIDES)
    assert encoded.shape == (2, count, 4)
    assert logits.shape == (2, count, 12)
    assert default_boxes(128, 256).shape == (count, 4)
    assert 1.6e6 < sum(value.numel() for value in yolo().parameters()) < 2.0e6
    assert sum(value.numel() for value in ssd().parameters()) < 1.2e6


def test_iou_and_ciou_equal_hand_calculation() -> None:
    a, b = torch.tensor([[5.0, 5.0, 10.0, 10.0]]), torch.tensor([[10.0, 5.0, 10.0, 10.0]])
    assert pairwise_iou(corners(a), corners(b)).item() == pytest.approx(1 / 3)
    # same shape, centers 5 apart, hull 15 x 10: CIoU = 1/3 - 25/325
    assert complete_iou(a, b).item() == pytest.approx(1 / 3 - 25 / 325, abs=1e-6)
    assert complete_iou(a, a).item() == pytest.approx(1.0, abs=1e-6)
    # same center and area, 10 x 10 and 20 x 5: iou 50/150, v = 4/pi² (atan 4 - atan 1)²
    other = torch.tensor([[5.0, 5.0, 20.0, 5.0]])
    unlike = 4 / math.pi**2 * (math.atan(4.0) - math.atan(1.0)) ** 2
    expected = 1 / 3 - unlike * unlike / (1 - 1 / 3 + unlike)
    assert complete_iou(a, other).item() == pytest.approx(expected, abs=1e-6)
    torch.testing.assert_close(centered(corners(other)), other)


def test_decode_inverts_encode() -> None:
    defaults = default_boxes(128, 256)
    boxes = defaults * torch.tensor([1.0, 1.0, 1.3, 0.7]) + torch.tensor([3.0, -2.0, 0.0, 0.0])
    torch.testing.assert_close(ssd_decode(encode(boxes, defaults), defaults), boxes)
    by_hand = encode(torch.tensor([[14.0, 10.0, 40.0, 20.0]]), torch.tensor([[10.0, 10.0, 20.0, 20.0]]))
    torch.testing.assert_close(by_hand, torch.tensor([[2.0, 0.0, math.log(2.0) / 0.2, 0.0]]))


def test_yolo_assigned_cells_can_represent_box() -> None:
    network = yolo()
    target = two_objects([[61.0, 45.0, 30.0, 20.0]], [2])
    for scale, stride in enumerate((8, 16, 32)):
        height, width = 128 // stride, 256 // stride
        found = assign(target, network.anchors[scale], stride, height, width)
        for anchor, line, column in zip(found.anchor, found.line, found.column, strict=True):
            x, y = (61.0 / stride - column + 0.5) / 2.0, (45.0 / stride - line + 0.5) / 2.0
            sides = torch.tensor([30.0, 20.0]) / network.anchors[scale][anchor]
            w, h = (sides.sqrt() / 2.0).tolist()
            shares = torch.tensor([float(x), float(y), w, h])
            assert (shares > 0.0).all()
            assert (shares < 1.0).all()
            raw = [torch.full((1, 3, 128 // s, 256 // s, 16), -20.0) for s in (8, 16, 32)]
            raw[scale][0, anchor, line, column, :4] = torch.logit(shares)
            raw[scale][0, anchor, line, column, 4] = 20.0
            raw[scale][0, anchor, line, column, 5 + 2] = 20.0
            candidates = yolo_candidates(network.anchors.numpy(), [output[0].numpy() for output in raw], 0.5)
            np.testing.assert_allclose(candidates.boxes, corners(target.boxes[0]).numpy(), atol=1e-3)
            assert candidates.scores.item() == pytest.approx(1.0, abs=1e-6)
            assert candidates.classes.item() == 2
            decoded = yolo_decode(network, raw)[0]
            torch.testing.assert_close(decoded[decoded[:, 4] > 0.5][0, :4], target.boxes[0, 0], atol=1e-3, rtol=0.0)
    # Center 7.625, 5.625 in cells of 8: its cell and those to the right and below, for all anchors of similar size
    fine = assign(target, network.anchors[0], 8, 16, 32)
    cells = {(int(line), int(column)) for line, column in zip(fine.line, fine.column, strict=True)}
    assert cells == {(5, 7), (5, 8), (6, 7)}
    assert set(fine.anchor.tolist()) == {0, 1, 2}


def test_yolo_assign_excludes_anchors_of_different_size() -> None:
    network = yolo()
    large = two_objects([[128.0, 64.0, 200.0, 110.0]], [1])
    assert len(assign(large, network.anchors[0], 8, 16, 32).classes) == 0
    assert len(assign(large, network.anchors[2], 32, 4, 8).classes) > 0


def test_ssd_match_assigns_by_overlap_and_always_the_best_box() -> None:
    defaults = torch.tensor([[50.0, 50.0, 20.0, 20.0], [56.0, 50.0, 20.0, 20.0], [100.0, 50.0, 20.0, 20.0]])
    # overlaps of the object: 1, 14/26 = 0.54, 0; the second object overlaps nothing by half
    row, label = match(two_objects([[50.0, 50.0, 20.0, 20.0], [112.0, 50.0, 20.0, 20.0]], [3, 5]), defaults)
    assert label.tolist() == [[4, 4, 6]]
    assert row.tolist() == [[0, 0, 1]]
    _, label = match(two_objects([[50.0, 50.0, 20.0, 20.0], [100.0, 50.0, 60.0, 60.0]], [3, IGNORED]), defaults)
    assert label.tolist() == [[4, 4, UNLABELED]]
    _, label = match(two_objects([[0.0, 0.0, 0.0, 0.0]], [PADDING]), defaults)
    assert label.tolist() == [[BACKGROUND] * 3]


def test_ssd_hardest_selects_three_negatives_per_positive() -> None:
    loss = torch.tensor([[9.0, 1.0, 5.0, 4.0, 3.0, 2.0]])
    label = torch.tensor([[2, BACKGROUND, BACKGROUND, UNLABELED, BACKGROUND, BACKGROUND]])
    assert hardest(loss, label).tolist() == [[False, False, True, False, True, True]]


def test_yolo_loss_excludes_cells_of_ignored_objects() -> None:
    network = yolo()
    outputs = [torch.zeros(1, 48, 128 // s, 256 // s) for s in (8, 16, 32)]
    none_ignored, all_ignored, half_ignored = (
        yolo_loss(outputs, two_objects([box], [kind]), network.anchors)["object"].item()
        for box, kind in (
            ([0.0, 0.0, 0.0, 0.0], PADDING),
            ([128.0, 64.0, 256.0, 128.0], IGNORED),
            ([64.0, 64.0, 128.0, 128.0], IGNORED),
        )
    )
    assert all_ignored == 0.0
    assert half_ignored == pytest.approx(none_ignored / 2, rel=1e-6)


def images_and_targets() -> tuple[Any, Targets]:
    """Return two images of two colored rectangles on noise, and their targets."""
    draws = torch.Generator().manual_seed(3)
    image = 0.2 * torch.rand(2, 3, 128, 256, generator=draws)
    for left, top, right, bottom, channel in ((20, 25, 60, 55, 0), (90, 65, 110, 115, 1)):
        image[:, channel, top:bottom, left:right] = 1.0
    one = two_objects([[40.0, 40.0, 40.0, 30.0], [100.0, 90.0, 20.0, 50.0]], [0, 5])
    return image, Targets(one.boxes.repeat(2, 1, 1), one.classes.repeat(2, 1))


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", ["yolov5", "ssd"])
def test_network_overfits_single_image_and_fold_preserves_outputs(name: str) -> None:
    network = yolo() if name == "yolov5" else ssd()
    if isinstance(network, YoloV5):
        loss_of = partial(yolo_loss, anchors=network.anchors)
    else:
        loss_of = partial(ssd_loss, defaults=default_boxes(128, 256))
    for module in network.modules():
        if isinstance(module, torch.nn.BatchNorm2d):
            module.momentum = 0.2
    image, targets = images_and_targets()
    optimizer = torch.optim.AdamW(network.parameters(), 2e-3)
    losses = []
    for _ in range(60):
        loss = torch.stack(list(loss_of(network(image), targets).values())).sum()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    assert losses[-1] < 0.35 * losses[0]
    network.eval()
    with torch.no_grad():
        before = network(image)
        fold(network)
        after = network(image)
        for first, second in zip(before, after, strict=True):
            torch.testing.assert_close(first, second, atol=2e-3, rtol=1e-3)
        arrays = [output[:1].numpy() for output in network(image)]
    found = (
        yolo_candidates(network.anchors.numpy(), yolo_scales(arrays), 0.05)
        if isinstance(network, YoloV5)
        else ssd_candidates(ssd_scales(arrays), 0.05)
    )
    for box, number in zip(corners(targets.boxes[0]), (0, 5), strict=True):
        of_class = found.classes == number
        assert of_class.any()
        best = torch.from_numpy(found.boxes[of_class][found.scores[of_class].argmax()]).float()
        assert pairwise_iou(best[None], box[None]).item() > 0.6


def test_candidates_equal_boxes_that_networks_decode() -> None:
    """All boxes from 0.3 on; the networks have random weights with large outputs."""
    draws = torch.Generator().manual_seed(4)
    detector = yolo().eval()
    outputs = [3.0 * torch.randn(1, 48, 128 // s, 256 // s, generator=draws) for s in (8, 16, 32)]
    shaped = [raw.view(1, 3, 16, *raw.shape[2:]).permute(0, 1, 3, 4, 2) for raw in outputs]
    decoded = yolo_decode(detector, shaped)[0]
    scores, numbers = (decoded[:, 4:5] * decoded[:, 5:]).max(dim=1)
    found = yolo_candidates(detector.anchors.numpy(), yolo_scales([raw.numpy() for raw in outputs]), 0.3)
    assert_candidates_equal(found, corners(decoded[:, :4]), scores, numbers)

    outputs = [3.0 * torch.randn(1, 6 * each, 128 // s, 256 // s, generator=draws) for each in (4, 12) for s in STRIDES]
    encoded, logits = ssd_rows(outputs)
    boxes, probabilities = corners(ssd_decode(encoded, default_boxes(128, 256))), logits.softmax(dim=-1)[..., 1:]
    scores, numbers = probabilities[0].max(dim=1)
    found = ssd_candidates(ssd_scales([raw.numpy() for raw in outputs]), 0.3)
    assert_candidates_equal(found, boxes[0], scores, numbers)


def assert_candidates_equal(found: Candidates, boxes: Any, scores: Any, numbers: Any) -> None:
    confident = scores >= 0.3
    assert 100 < len(found.scores) == int(confident.sum())
    np.testing.assert_allclose(found.boxes, boxes[confident].numpy(), rtol=1e-5, atol=1e-3)
    np.testing.assert_allclose(found.scores, scores[confident].numpy(), rtol=1e-5)
    np.testing.assert_array_equal(found.classes, numbers[confident].numpy())
