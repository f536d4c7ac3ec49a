"""Lidar scans of many scenes at once, cast on a GPU against the meshes of the bodies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import torch
import triton  # type: ignore[import-not-found]
import triton.language as tl  # type: ignore[import-not-found]

CHUNK = 16
"""Triangles that share a bounding box."""
GROUND, NOTHING = -1, -2
"""Hit slots of rays that meet the ground, and nothing."""
ASPHALT = 0.17
ATTENUATION = 0.004
RANGE_NOISE = 0.02
TEN_PERCENT_RANGE = 150.0
"""Values of LidarSettings and of the sensor model."""
AIR = (0.9, 10.0)
"""Distances of returns from the air [m]."""


@dataclass(frozen=True)
class Meshes:
    """Meshes of all bodies in chunks of neighboring triangles, on the device.

    triangles  (K, 13) corner, two edges, unit normal, and reflectivity
    boxes      (C, 6) lower and upper corner of each chunk
    chunks     (M + 1,) first chunk of each body
    bounds     (M, 6) lower and upper corner of each body
    """

    triangles: torch.Tensor
    boxes: torch.Tensor
    chunks: torch.Tensor
    bounds: torch.Tensor

    @classmethod
    def of(
        cls,
        triangles: np.ndarray[Any, Any],
        reflectivity: np.ndarray[Any, Any],
        first: np.ndarray[Any, Any],
        device: str,
    ) -> Meshes:
        """Return the meshes of bodies: triangles (K, 3, 3) [m], reflectivity (K,), first triangle of each (M + 1,)."""
        rows, boxes, chunks, bounds = [], [], [0], []
        for start, end in pairwise(first.tolist()):
            corners = triangles[start:end].astype(np.float64)
            order = _morton_order(corners.mean(axis=1))
            order = np.concatenate([order, np.full(-len(order) % CHUNK, order[-1])])  # repeated ones change nothing
            corners = corners[order]
            edges = corners[:, 1:] - corners[:, :1]
            normal = np.cross(edges[:, 0], edges[:, 1])
            normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
            rows.append(np.column_stack([corners[:, 0], edges.reshape(-1, 6), normal, reflectivity[start:end][order]]))
            groups = corners.reshape(-1, CHUNK * 3, 3)
            boxes.append(np.column_stack([groups.min(axis=1), groups.max(axis=1)]))
            chunks.append(chunks[-1] + len(groups))
            points = corners.reshape(-1, 3)
            bounds.append(np.concatenate([points.min(axis=0), points.max(axis=0)]))

        def tensor(value: np.ndarray[Any, Any]) -> torch.Tensor:
            return torch.tensor(value, dtype=torch.float32, device=device)

        return cls(
            tensor(np.concatenate(rows)),
            tensor(np.concatenate(boxes)),
            torch.tensor(chunks, dtype=torch.int32, device=device),
            tensor(np.array(bounds)),
        )


def _morton_order(points: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Return the order of points (N, 3) along a Morton curve."""
    extent = np.maximum(np.ptp(points, axis=0), 1e-9)
    cells = ((points - points.min(axis=0)) / extent * 1023).astype(np.int64)
    code = np.zeros(len(points), dtype=np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")


@triton.jit
def _enters(ox, oy, oz, ix, iy, iz, box):  # type: ignore[no-untyped-def]
    """Return where rays enter and leave an axis-aligned box, from the inverses of their directions."""
    x0, x1 = (tl.load(box) - ox) * ix, (tl.load(box + 3) - ox) * ix
    y0, y1 = (tl.load(box + 1) - oy) * iy, (tl.load(box + 4) - oy) * iy
    z0, z1 = (tl.load(box + 2) - oz) * iz, (tl.load(box + 5) - oz) * iz
    near = tl.maximum(tl.maximum(tl.minimum(x0, x1), tl.minimum(y0, y1)), tl.minimum(z0, z1))
    far = tl.minimum(tl.minimum(tl.maximum(x0, x1), tl.maximum(y0, y1)), tl.maximum(z0, z1))
    return near, far


@triton.jit  # type: ignore[untyped-decorator]
def _cast(  # type: ignore[no-untyped-def]
    triangles, boxes, chunks, bounds, bodies, counts, scenes, heads, elevations, distance, hit_slots, brightness,
    rings, columns, slots, block: tl.constexpr, chunk: tl.constexpr,
):  # fmt: skip
    """Cast the rays of one block of one scan against all bodies of its scene."""
    scan = tl.program_id(0)
    ray = tl.program_id(1) * block + tl.arange(0, block)
    inside = ray < rings * columns
    column, ring = ray // rings, ray % rings
    head = heads + scan * 5
    sx, sy, sz = tl.load(head), tl.load(head + 1), tl.load(head + 2)
    azimuth = tl.load(head + 3) + (column.to(tl.float32) + tl.load(head + 4)) * (2.0 * 3.141592653589793 / columns)
    elevation = tl.load(elevations + scan * rings + ring, mask=inside, other=0.0)
    flat = tl.cos(elevation)
    dx, dy, dz = flat * tl.cos(azimuth), flat * tl.sin(azimuth), tl.sin(elevation)
    dz = tl.where(tl.abs(dz) < 1e-7, 1e-7, dz)
    best = tl.where(dz < 0.0, -sz / dz, 1e9)
    hit_slot = tl.where(dz < 0.0, -1, -2)
    bright = tl.abs(dz)
    scene = tl.load(scenes + scan)
    for slot in range(0, tl.load(counts + scene)):
        body = bodies + (scene * slots + slot) * 9
        mesh = tl.load(body).to(tl.int32)
        c, s = tl.load(body + 4), tl.load(body + 5)
        wx, wy, wz = sx - tl.load(body + 1), sy - tl.load(body + 2), sz - tl.load(body + 3)
        gx, gy, gz = tl.load(body + 6), tl.load(body + 7), tl.load(body + 8)
        ox, oy, oz = (c * wx + s * wy) / gx, (c * wy - s * wx) / gy, wz / gz
        ux, uy = c * dx + s * dy, c * dy - s * dx
        lx, ly, lz = ux / gx, uy / gy, dz / gz
        lx, ly = tl.where(tl.abs(lx) < 1e-7, 1e-7, lx), tl.where(tl.abs(ly) < 1e-7, 1e-7, ly)
        ix, iy, iz = 1.0 / lx, 1.0 / ly, 1.0 / lz
        near, far = _enters(ox, oy, oz, ix, iy, iz, bounds + mesh * 6)
        meets = inside & (near <= far) & (far > 0.0) & (near < best)
        if tl.max(meets.to(tl.int32), axis=0) > 0:
            for group in range(tl.load(chunks + mesh), tl.load(chunks + mesh + 1)):
                near, far = _enters(ox, oy, oz, ix, iy, iz, boxes + group * 6)
                within = meets & (near <= far + 1e-5) & (far > 0.0) & (near < best)
                if tl.max(within.to(tl.int32), axis=0) > 0:
                    for number in range(group * chunk, group * chunk + chunk):
                        t = triangles + number * 13
                        ax, ay, az = tl.load(t + 3), tl.load(t + 4), tl.load(t + 5)
                        bx, by, bz = tl.load(t + 6), tl.load(t + 7), tl.load(t + 8)
                        px, py, pz = ly * bz - lz * by, lz * bx - lx * bz, lx * by - ly * bx
                        det = ax * px + ay * py + az * pz
                        inverse = 1.0 / tl.where(tl.abs(det) < 1e-12, 1e-12, det)
                        tx, ty, tz = ox - tl.load(t), oy - tl.load(t + 1), oz - tl.load(t + 2)
                        u = (tx * px + ty * py + tz * pz) * inverse
                        qx, qy, qz = ty * az - tz * ay, tz * ax - tx * az, tx * ay - ty * ax
                        v = (lx * qx + ly * qy + lz * qz) * inverse
                        reach = (bx * qx + by * qy + bz * qz) * inverse
                        hit = within & (tl.abs(det) >= 1e-12) & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)
                        hit = hit & (reach > 1e-3) & (reach < best)
                        facing = tl.load(t + 9) * ux + tl.load(t + 10) * uy + tl.load(t + 11) * dz
                        best = tl.where(hit, reach, best)
                        hit_slot = tl.where(hit, slot, hit_slot)
                        bright = tl.where(hit, tl.abs(facing) * tl.load(t + 12), bright)
    out = scan * rings * columns + ray
    tl.store(distance + out, best, mask=inside)
    tl.store(hit_slots + out, hit_slot, mask=inside)
    tl.store(brightness + out, bright, mask=inside)


@dataclass(frozen=True)
class Heads:
    """Lidars of N scans, all with the same numbers of rings and columns.

    scene      (N,) scene of each
    own        (N,) slot of the body that carries it; its hits are no returns; -1: a mast, which is too thin to hide
    position   (N, 3) of the sensor [m], yaw (N,) [rad], elevations (N, R) of the rings [rad]
    half_field (N,) half the field of view [rad], reach (N,) range [m]
    fade       (N,) extinction of the air [1/m]
    columns    of a revolution
    """

    scene: torch.Tensor
    own: torch.Tensor
    position: torch.Tensor
    yaw: torch.Tensor
    elevations: torch.Tensor
    half_field: torch.Tensor
    reach: torch.Tensor
    fade: torch.Tensor
    columns: int


@dataclass(frozen=True)
class Scans:
    """Returns of N scans of M rays.

    points     (N, M, 3) relative to the sensor, in axes of its heading [m]
    returned   (N, M) whether there is a return;  intensity (N, M)
    hit_slots  (N, M) slot of the body that it shows, GROUND, or NOTHING for the air
    """

    points: torch.Tensor
    returned: torch.Tensor
    intensity: torch.Tensor
    hit_slots: torch.Tensor


def cast(meshes: Meshes, bodies: torch.Tensor, counts: torch.Tensor, heads: Heads, *, block: int = 128) -> Scans:
    """Return the scans of scenes with bodies (S, B, 9): mesh, x, y, z of its center, cos and sin of its heading, scale.

    The sensor model is that of `sensing.lidar` without drops of rain.
    """
    device, rings = bodies.device, heads.elevations.shape[1]
    shape = len(heads.scene), heads.columns * rings
    distance, brightness = torch.empty(shape, device=device), torch.empty(shape, device=device)
    hit_slots = torch.empty(shape, dtype=torch.int32, device=device)
    start = torch.zeros(shape[0], device=device)
    table = torch.cat([heads.position, heads.yaw[:, None], start[:, None]], dim=1).contiguous()
    _cast[(shape[0], triton.cdiv(shape[1], block))](
        meshes.triangles, meshes.boxes, meshes.chunks, meshes.bounds, bodies.contiguous(),
        counts.to(torch.int32), heads.scene.to(torch.int32), table, heads.elevations.contiguous(),
        distance, hit_slots, brightness, rings, heads.columns, bodies.shape[1], block=block, chunk=CHUNK,
    )  # fmt: skip
    turn = torch.arange(heads.columns, device=device) * (2.0 * math.pi / heads.columns)
    azimuth = torch.remainder(turn + math.pi, 2.0 * math.pi) - math.pi
    azimuth, elevation = azimuth.repeat_interleave(rings), heads.elevations.repeat(1, heads.columns)
    own = hit_slots == heads.own[:, None]
    brightness = torch.where(hit_slots == GROUND, ASPHALT * brightness, brightness)
    fade = heads.fade[:, None]
    through = torch.exp(-2.0 * fade * distance.clamp(max=1e4))
    returned = brightness * through / distance.square().clamp(min=1e-6) >= 0.1 / TEN_PERCENT_RANGE**2
    returned &= (distance < heads.reach[:, None]) & ~own & (azimuth.abs() <= heads.half_field[:, None] + 1e-6)
    intensity = (brightness * through * torch.exp(-ATTENUATION * distance.clamp(max=1e4))).clamp(0.0, 1.0)
    length = distance + RANGE_NOISE * torch.randn(shape, device=device)
    air = torch.rand(shape, device=device) < 0.6 * fade  # a few percent of the rays in dense fog
    air_distance = AIR[0] + (AIR[1] - AIR[0]) * torch.rand(shape, device=device)
    air &= air_distance < distance
    length, intensity = torch.where(air, air_distance, length), torch.where(air, 0.05, intensity)
    hit_slots = torch.where(air, NOTHING, hit_slots)
    flat = torch.cos(elevation)
    directions = torch.stack([flat * torch.cos(azimuth), flat * torch.sin(azimuth), torch.sin(elevation)], dim=2)
    return Scans(directions * length[..., None], returned | (air & ~own), intensity, hit_slots)
