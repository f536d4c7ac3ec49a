"""Input grids and targets of a batch of scenes, on the device."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import torch
from torch import Tensor

from training.pillars.network import BOX, CELLS, CHANNELS, OUT, REACH, SIDE, STRIDE_SIDE
from training.pillars.scans import Heads, Meshes, Scans, cast
from training.pillars.scenes import CLASSES, LAG, STATIONS

CLEARANCE, TALLEST = 0.25, 4.5
"""Heights between which a point stands on the ground [m]."""
SHARED_CELL = 0.1
"""Cells of the points of a message of early fusion [m]."""
GROUND_NOISE = 0.02
"""Standard deviation of the estimated height of the ground [m]."""
FEWEST = 3
"""Fewest points on a body that the network has to detect; those with fewer are neither required nor errors."""
PATCH = 4
"""Half the edge of the square of cells around an object that has targets [cells]."""


@dataclass(frozen=True)
class Batch:
    """Scenes with N = S · STATIONS stations.

    grids   (N, 12, 256, 256)
    center  (N, 2) center of the grid of each station, a multiple of its output cells, in the scene [m]
    boxes   (S, B, 7), velocity (S, B, 2), classes (S, B) as in the scene
    own     (N,) slot of the carrier; -1: a mast
    points  (N, B) number of points of each station on each body
    has_earlier_scan  (N,) whether the grid has the earlier scan
    merged  (P, 12, 256, 256) grids of the first stations of P scenes with the points of all, as in early fusion
    """

    grids: Tensor
    center: Tensor
    boxes: Tensor
    velocity: Tensor
    classes: Tensor
    own: Tensor
    points: Tensor
    has_earlier_scan: Tensor
    merged: Tensor


class Sampler:
    """Maker of batches on the device."""

    def __init__(self, meshes: Meshes, device: str) -> None:
        self._meshes, self._device = meshes, device
        self.device_type = torch.device(device).type

    def batch(self, arrays: dict[str, Any], noise: Tensor) -> Batch:
        """Return the batch of scenes of `SceneMaker.batch`, each turned by a random angle.

        noise  errors (P · STATIONS, 3) of the poses of the stations in x, y [m] and heading [rad], of the merged points
        """
        scene = {
            name: torch.as_tensor(value).to(self._device, non_blocking=True)
            for name, value in arrays.items()
            if name not in ("rings", "columns")
        }
        _turn(scene)
        rings, columns = int(arrays["rings"]), int(arrays["columns"])
        count = len(scene["bodies"])
        share = torch.linspace(0.0, 1.0, rings, device=self._device)
        upper, lower = scene["upper"].flatten()[:, None], scene["lower"].flatten()[:, None]
        numbers = torch.arange(count, device=self._device).repeat_interleave(STATIONS)
        own = scene["own"].flatten()

        def heads(position: Tensor) -> Heads:
            return Heads(
                numbers, own, position, scene["yaw"].flatten(), upper + (lower - upper) * share,
                scene["half_field"].flatten(), scene["reach"].flatten(), scene["fade"].flatten(), columns,
            )  # fmt: skip

        position = scene["position"].reshape(-1, 3)
        before = position.clone()
        before[:, :2] -= LAG * scene["speed"].reshape(-1, 2)
        moved = scene["bodies"].clone()
        moved[:, :, 1:3] -= LAG * scene["velocity"]
        now = cast(self._meshes, scene["bodies"], scene["count"], heads(position))
        earlier = cast(self._meshes, moved, scene["count"], heads(before))
        phase = (torch.rand(len(position), 2, device=self._device) - 0.5) * STRIDE_SIDE
        center = position[:, :2] + phase
        placed = _placed(now, position, scene["yaw"], center), _placed(earlier, before, scene["yaw"], center)
        grids = _grids(*placed)
        merged = _grids(*(_merged(scans, center, own, noise) for scans in placed))
        has_earlier_scan = torch.rand(len(position), device=self._device) < 0.9  # the earlier scan is sometimes missing
        grids[:, 8:] *= has_earlier_scan[:, None, None, None]
        merged[:, 8:] *= has_earlier_scan[: len(noise) : STATIONS, None, None, None]
        slots = scene["bodies"].shape[1]
        hits = torch.zeros(len(position), slots + 1, device=self._device)
        hit_slots = torch.where(now.returned & (now.hit_slots >= 0), now.hit_slots, slots).long()
        hits.scatter_add_(1, hit_slots, torch.ones_like(hit_slots, dtype=torch.float32))
        return Batch(
            grids, center, scene["boxes"], scene["velocity"], scene["classes"].long(), own.long(),
            hits[:, :slots], has_earlier_scan, merged,
        )  # fmt: skip


def _turn(scene: dict[str, Tensor]) -> None:
    """Turn each scene by a random angle."""
    angle = torch.rand(len(scene["bodies"]), device=scene["bodies"].device) * math.tau
    cos, sin = torch.cos(angle)[:, None], torch.sin(angle)[:, None]

    def turned(x: Tensor, y: Tensor) -> tuple[Tensor, Tensor]:
        return cos * x - sin * y, sin * x + cos * y

    for name, column in (("bodies", 1), ("bodies", 4), ("velocity", 0), ("boxes", 0), ("position", 0), ("speed", 0)):
        part = scene[name]
        x, y = turned(part[..., column], part[..., column + 1])
        part[..., column], part[..., column + 1] = x, y
    scene["boxes"][..., 6] += angle[:, None]
    scene["yaw"] += angle[:, None]


def _placed(scans: Scans, position: Tensor, yaw: Tensor, center: Tensor) -> Scans:
    """Return the scans with points (N, M, 3) relative to the center of the grid and the ground."""
    yaw = yaw.flatten()[:, None]
    cos, sin = torch.cos(yaw), torch.sin(yaw)
    x, y, z = scans.points.unbind(2)
    shift = (position[:, :2] - center)[:, None]
    height = z + position[:, 2:3] + GROUND_NOISE * torch.randn(len(position), 1, device=z.device)
    points = torch.stack([cos * x - sin * y + shift[..., 0], sin * x + cos * y + shift[..., 1], height], dim=2)
    return replace(scans, points=points)


def _merged(scans: Scans, center: Tensor, own: Tensor, noise: Tensor) -> Scans:
    """Return scans of P · STATIONS rays with the points of all stations of the first P scenes in the grids of the first
    stations, with pose errors (P · STATIONS, 3).

    Points of the others are those of the message: centers of occupied cells, each once, with the intensity 1, without
    those on the body of the receiver.
    """
    number, rays = len(noise), scans.points.shape[1]
    scans = Scans(*(part[:number] for part in (scans.points, scans.returned, scans.intensity, scans.hit_slots)))
    center = center[:number]
    stations = torch.arange(number, device=center.device)
    receiver = stations // STATIONS * STATIONS
    cos, sin = torch.cos(noise[:, 2:3]), torch.sin(noise[:, 2:3])
    x, y, height = scans.points.unbind(2)
    shift = center + noise[:, :2] - center[receiver]
    apart = torch.stack([cos * x - sin * y + shift[:, :1], sin * x + cos * y + shift[:, 1:], height], dim=2)
    cells = torch.floor(apart / SHARED_CELL)
    mine = (stations == receiver)[:, None]
    apart = torch.where(mine[..., None], scans.points, (cells + 0.5) * SHARED_CELL)
    # One number per station and cell; the first point of equal ones remains.
    i, j, k = (cells.long() + 4096).clamp(0, 8191).unbind(2)
    key = ((stations[:, None] * 8192 + i) * 8192 + j) * 8192 + k
    order = torch.sort(torch.where(scans.returned, key, -1).flatten(), stable=True)
    again = torch.zeros_like(order.values, dtype=torch.bool)
    again[1:] = order.values[1:] == order.values[:-1]
    repeated = torch.zeros_like(again).scatter_(0, order.indices, again).reshape(number, rays)
    body = own[receiver, None]
    on_receiver = (scans.hit_slots == body) & (body >= 0)
    returned = scans.returned & (mine | ~(repeated | on_receiver))
    intensity = torch.where(mine, scans.intensity, 1.0)
    size = number // STATIONS, STATIONS * rays
    parts = returned, intensity, scans.hit_slots
    return Scans(apart.reshape(*size, 3), *(part.reshape(size) for part in parts))


def _grids(now: Scans, earlier: Scans) -> Tensor:
    """Return the input of the network (N, 12, 256, 256), with the channels of a cell side by side in memory."""
    number = len(now.points)
    cell, values = _in_cells(now)
    ground = values[:, 0] <= CLEARANCE
    below = _sums(number, torch.where(ground, cell, _outside(cell, number)), torch.ones_like(values[:, :1]))[:, 0]
    cell = torch.where(ground, _outside(cell, number), cell)
    count, high, means = _statistics(number, cell, values)
    low = -_maxima(number, cell, -values[:, 0], -torch.inf)
    height, x, y, intensity = means.unbind(1)
    channels = [torch.log1p(count) / 3.0, high / 4.0, torch.where(count > 0.0, low, 0.0) / 4.0, height / 4.0,
                intensity, x, y, torch.log1p(below) / 3.0]  # fmt: skip
    cell, values = _in_cells(earlier)
    cell = torch.where(values[:, 0] <= CLEARANCE, _outside(cell, number), cell)
    count, high, means = _statistics(number, cell, values)
    _, x, y, _ = means.unbind(1)
    channels += [torch.log1p(count) / 3.0, high / 4.0, x, y]
    grids = torch.stack(channels, dim=1).reshape(number, CELLS, CELLS, CHANNELS)
    return grids.permute(0, 3, 1, 2)


def _outside(cell: Tensor, number: int) -> Tensor:
    """Return cells of one more grid, for points that count nowhere.

    A selection of points would wait for the device. One cell for all of them would make additions wait for each other.
    """
    return torch.arange(len(cell), device=cell.device) % CELLS**2 + number * CELLS**2


def _in_cells(scans: Scans) -> tuple[Tensor, Tensor]:
    """Return the cells (P,) of the points of N scans in (N, 256, 256), and their height, offset from the center of the
    cell along x and y, and intensity (P, 4).
    """
    points, number = scans.points, len(scans.points)
    coordinates = (points[..., :2] + REACH) / SIDE
    index = torch.floor(coordinates)
    inside = scans.returned & ((index >= 0) & (index < CELLS)).all(dim=2) & (points[..., 2] < TALLEST)
    scan = torch.arange(number, device=points.device)[:, None]
    cell = ((scan * CELLS + index[..., 0].long()) * CELLS + index[..., 1].long()).flatten()
    cell = torch.where(inside.flatten(), cell, _outside(cell, number))
    offset = coordinates - index - 0.5
    return cell, torch.stack([points[..., 2], offset[..., 0], offset[..., 1], scans.intensity], dim=2).reshape(-1, 4)


def _sums(number: int, cell: Tensor, values: Tensor) -> Tensor:
    """Return the sums (N · 256 · 256, V) of values (P, V) in each cell."""
    sums = torch.zeros((number + 1) * CELLS**2, values.shape[1], device=cell.device)
    return sums.index_add_(0, cell, values)[: number * CELLS**2]


def _maxima(number: int, cell: Tensor, values: Tensor, least: float) -> Tensor:
    """Return the maxima (N · 256 · 256,) of `least` and the values (P,) in each cell."""
    maxima = torch.full(((number + 1) * CELLS**2,), least, device=cell.device)
    return maxima.scatter_reduce_(0, cell, values, "amax")[: number * CELLS**2]


def _statistics(number: int, cell: Tensor, values: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Return number of points and maximum height (C,) of each cell, and the means of the values (C, 4)."""
    sums = _sums(number, cell, torch.cat([torch.ones_like(values[:, :1]), values], dim=1))
    return sums[:, 0], _maxima(number, cell, values[:, 0], 0.0), sums[:, 1:] / sums[:, :1].clamp(min=1.0)


@dataclass(frozen=True)
class Targets:
    """Targets of N grids.

    heat     (N, K, 128, 128) 1 at the cell of an object's center, lower around it
    cells    (P,) cells around objects in the flattened (N, 128, 128), values (P, 13) of their boxes
    weights  (P,) of the boxes; 0 for those that are not required
    moving   (P,) whether the displacement is known
    objects  number of required objects
    """

    heat: Tensor
    cells: Tensor
    values: Tensor
    weights: Tensor
    moving: Tensor
    objects: Tensor


def targets(batch: Batch, points: Tensor, step: int = 1) -> Targets:
    """Return the targets of every station, or of every `step`th, for bodies with these numbers of points (N, B).

    All shapes depend on those of the batch only, so that nothing waits for the device.
    """
    device = points.device
    stations = torch.arange(0, len(points), step, device=device)
    points, center, own = (part[stations] for part in (points, batch.center, batch.own))
    number, slots = points.shape
    scene = stations // STATIONS
    box, velocity, kind = batch.boxes[scene], batch.velocity[scene], batch.classes[scene]
    middle = box[..., :2] - center[:, None]
    i, j = torch.floor((middle + REACH) / STRIDE_SIDE).long().unbind(2)
    inside = (i >= 0) & (i < OUT) & (j >= 0) & (j < OUT) & (kind >= 0) & (points > 0)
    inside &= torch.arange(slots, device=device) != own[:, None]
    required = inside & (points >= FEWEST)
    sigma = (0.17 / STRIDE_SIDE * torch.sqrt(box[..., 3] * box[..., 4])).clamp(0.6, 1.5)
    around = torch.arange(-PATCH, PATCH + 1, device=device)
    di, dj = (part.flatten() for part in torch.meshgrid(around, around, indexing="ij"))
    pi, pj = i[..., None] + di, j[..., None] + dj
    on = inside[..., None] & (pi >= 0) & (pi < OUT) & (pj >= 0) & (pj < OUT)
    value = torch.exp(-(di * di + dj * dj) / (2.0 * sigma[..., None] ** 2))
    value = torch.where((di == 0) & (dj == 0) & ~required[..., None], 0.99, value) * on
    grid = torch.arange(number, device=device)[:, None, None]
    cell = (grid * OUT + pi.clamp(0, OUT - 1)) * OUT + pj.clamp(0, OUT - 1)
    heat = torch.zeros(number * OUT * OUT * len(CLASSES), device=device)
    heat.scatter_reduce_(0, (cell * len(CLASSES) + kind.clamp(min=0)[..., None]).flatten(), value.flatten(), "amax")
    heat = heat.reshape(number, OUT, OUT, len(CLASSES)).permute(0, 3, 1, 2)
    near = (di.abs() <= 1) & (dj.abs() <= 1)
    pi, pj, cell, weights = (part[..., near] for part in (pi, pj, cell, value * required[..., None]))
    beside = [((part + 0.5) * STRIDE_SIDE - REACH) for part in (pi, pj)]
    fixed = torch.cat(
        [
            box[..., 2:3], torch.log(box[..., 3:6].clamp(min=0.1)), torch.cos(box[..., 6:]), torch.sin(box[..., 6:]),
            torch.cos(2.0 * box[..., 6:]), torch.sin(2.0 * box[..., 6:]), velocity * LAG,
            torch.zeros_like(box[..., :1]),
        ],
        dim=2,
    )  # fmt: skip
    offsets = torch.stack([middle[..., :1] - beside[0], middle[..., 1:] - beside[1]], dim=3) / STRIDE_SIDE
    values = torch.cat([offsets, fixed[:, :, None].expand(-1, -1, offsets.shape[2], -1)], dim=3)
    assert values.shape[3] == BOX
    moving = batch.has_earlier_scan[stations][:, None, None].expand_as(cell).float()
    return Targets(
        heat, cell.flatten(), values.flatten(0, 2), weights.flatten(), moving.flatten(),
        required.sum().clamp(min=1).float(),
    )  # fmt: skip
