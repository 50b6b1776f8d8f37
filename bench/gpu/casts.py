"""Rays cast on meshes in a device's memory: how fast, and against float64 by brute force, without Open3D."""

from typing import Any

import numpy as np
import torch
from torch import Tensor

from bench.gpu import rates
from bench.gpu.sizes import Sizes
from bench.lib import measuring
from ddf.geometry.gpu import meshes

CHECKED = 8  # rays of each mesh that are compared
Hits = tuple[Tensor, Tensor]


def rows(how: Sizes, device: str) -> list[dict[str, Any]]:
    """The kernel, where the device has it; elsewhere plain operators, which try the check itself."""
    place, number = torch.device(device), np.arange(how.cast_meshes)
    triangles = [bumpy_sphere(how.cast_triangles, int(seed)) for seed in number]
    held = meshes.joined([len(own) for own in triangles], triangles, place)
    size = how.cast_meshes * how.cast_rays
    starts, aim = (
        each.view(how.cast_meshes, how.cast_rays, 3) for each in rates.random_rays(size, torch.float32, place)
    )
    has_kernel = meshes.refusal(place) is None

    def cast(checked: slice = slice(None)) -> Hits:
        given = number, starts[:, checked], aim[:, checked]
        return held.first_hits(*given) if has_kernel else by_operators(held, *given, torch.float32)

    depth, triangle = cast(slice(CHECKED))
    exact, nearest = by_operators(held, number, starts[:, :CHECKED], aim[:, :CHECKED], torch.float64)
    seen = (triangle >= 0) & (nearest >= 0)
    error = {
        "other_hits": int(((triangle >= 0) != (nearest >= 0)).sum()),
        "depth_max": float((depth.double() - exact)[seen].abs().max()),
    }
    told = {"meshes": how.cast_meshes, "rays": how.cast_rays, "triangles": len(triangles[0]), "device": device}
    told["checked"] = how.cast_meshes * min(CHECKED, how.cast_rays)
    row = measuring.row("kernel" if has_kernel else "operators", told, rates.seconds_of(cast, how.repeats), error)
    return [{**row, "billion_tests_per_s": size * len(triangles[0]) / row["median_s"] / 1e9}]


def bumpy_sphere(count: int, seed: int) -> np.ndarray:
    """A closed surface of about so many triangles, (n, 3, 3), of which rays from inside meet several."""
    around = max(4, round((count / 4) ** 0.5) * 2)
    across = max(2, count // (2 * around))
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, 3)
    polar, turn = np.linspace(0, np.pi, across + 1)[:, None], np.linspace(0, 2 * np.pi, around + 1)[None]
    radius = 0.6 + 0.1 * np.sin(5 * polar + phases[0]) * np.sin(polar) * np.cos(6 * turn + phases[1])
    axes = np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar) + 0 * turn
    points = radius[..., None] * np.stack(axes, axis=-1)
    points[:, -1] = points[:, 0]
    corner, right, below, last = points[:-1, :-1], points[:-1, 1:], points[1:, :-1], points[1:, 1:]
    upper, lower = (
        np.stack(each, axis=-2).reshape(-1, 3, 3) for each in ((corner, below, right), (right, below, last))
    )
    return np.concatenate([upper, lower])


def by_operators(held: meshes.Meshes, number: np.ndarray, starts: Tensor, aim: Tensor, dtype: torch.dtype) -> Hits:
    """`Meshes.first_hits` with all pairs of a mesh at once (Moller and Trumbore 1997)."""
    depths, faces = [], []
    for mesh, start, direction in zip(number, starts.to(dtype), aim.to(dtype), strict=True):
        first, end = (int(each) for each in held.begins[[mesh, mesh + 1]])
        a, b, c = held.corners[:, first:end].T.to(dtype).unflatten(-1, (3, 3)).unbind(-2)
        edges, toward = (b - a, c - a), start[:, None] - a
        across = torch.linalg.cross(direction[:, None].expand_as(toward), edges[1].expand_as(toward))
        slope = (across * edges[0]).sum(-1)
        over = torch.linalg.cross(toward, edges[0].expand_as(toward))
        u, v = (across * toward).sum(-1) / slope, (over * direction[:, None]).sum(-1) / slope
        depth = (over * edges[1]).sum(-1) / slope
        inside = (u >= 0) & (v >= 0) & (u + v <= 1) & (depth >= 0)
        nearest, face = depth.where(inside, torch.inf).min(dim=-1)
        depths.append(nearest)
        faces.append(torch.where(torch.isfinite(nearest), face + first, -1))
    return torch.stack(depths), torch.stack(faces)
