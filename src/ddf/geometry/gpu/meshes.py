"""Triangles of many meshes in one tensor of a device, and first hits of rays on them, each row of rays on its mesh.

Open3D's answers within float32, without the host: corners and rays are taken as they are, in float32, so a mesh should
lie near the origin and have a size of order 1, as training meshes do.
"""

import importlib.util
import subprocess
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from ddf.core import arrays

TOGETHER = 4  # triangles that a thread reads at once; every mesh gets a multiple of it
COLUMNS = 16  # divides the columns of `corners`, so that four of a row can be read at once
REFUSALS = (ImportError, RuntimeError, OSError, subprocess.SubprocessError)  # beside Triton's own, where none compiles


@dataclass(frozen=True)
class Meshes:
    """Meshes by their number; triangles keep their order.

    corners: the coordinates of the first, the second and the third corner of every triangle, float32. Those whose
    corners are one point, as all that fill blocks, are never met. begins: the first triangle of each mesh, and the end
    of the last.
    """

    corners: Float[Tensor, "9 columns"]
    begins: Int[np.ndarray, "_"]

    def first_hits(
        self, meshes: Int[np.ndarray, "b"], positions: Float[Tensor, "b n 3"], directions: Float[Tensor, "b n 3"]
    ) -> tuple[Float[Tensor, "b n"], Int[Tensor, "b n"]]:
        """Depth and triangle of rays against the mesh of each row, `inf` and -1 on a miss.

        Triangles are numbered over all meshes. Of equal depths the first one's counts.

        Args:
          positions, directions: on the device of the corners, float32; depths are in lengths of the direction.
        """
        ranges = arrays.send(np.stack((self.begins[meshes], self.begins[meshes + 1]), axis=1), self.corners.device)
        rays = torch.cat((positions[..., None, :], frames(directions)), dim=-2).flatten(-2).movedim(-1, 0).contiguous()
        depth, own = _kernel(self.corners, ranges, rays)
        return depth, torch.where(own < 0, -1, own + ranges[:, :1])


def _kernel(
    corners: Float[Tensor, "9 columns"], ranges: Int[Tensor, "b 2"], rays: Float[Tensor, "12 b n"]
) -> tuple[Float[Tensor, "b n"], Int[Tensor, "b n"]]:
    from ddf.geometry.gpu import cast_kernel  # needs Triton

    return cast_kernel.first_hits(corners, ranges, rays, TOGETHER)


def frames(directions: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch 3 3"]:
    """The shear that brings each direction onto the third axis, at length 1; exact for directions along an axis.

    Its first two rows are the coordinates beside the longest one, each less its share of that. [Woop et al. 2013]
    """
    axis = torch.arange(3, device=directions.device)
    order = (directions.abs().argmax(dim=-1, keepdim=True) + axis + 1) % 3  # the longest comes last
    rows = (order[..., None] == axis).to(directions.dtype)
    along, last = directions.gather(-1, order), rows[..., 2:, :]
    beside = rows[..., :2, :] - (along[..., :2] / along[..., 2:])[..., None] * last
    return torch.cat((beside, last / along[..., 2:, None]), dim=-2)


def begins_of(counts: Sequence[int]) -> Int[np.ndarray, "_"]:
    """`Meshes.begins` of meshes with so many triangles."""
    return np.cumsum([0, *(-(-count // TOGETHER) * TOGETHER for count in counts)])


def joined(counts: Sequence[int], triangles: Iterable[Float[np.ndarray, "_ 3 3"]], device: torch.device) -> Meshes:
    """Meshes of so many triangles each, on a device."""
    begins = begins_of(counts)
    corners = torch.zeros((9, -(-int(begins[-1]) // COLUMNS) * COLUMNS), device=device)
    for own, begin in zip(triangles, begins[:-1], strict=True):
        corners[:, begin : begin + len(own)] = torch.from_numpy(own.astype(np.float32).reshape(-1, 9).T)
    return Meshes(corners, begins)


def refusal(device: torch.device) -> str | None:
    """Why this machine casts no rays on a device, in one line; None where it does, as a trial shows."""
    if device.type != "cuda":
        return f"{device.type} is no GPU"
    if importlib.util.find_spec("triton") is None:
        return "Triton is missing"
    from triton import TritonError

    one = np.array([[[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]]])
    ray = torch.tensor([[[0.25, 0.25, 0.0]]], device=device), torch.tensor([[[0.0, 0.0, 1.0]]], device=device)
    try:
        depth, _ = joined([1], [one], device).first_hits(np.array([0]), *ray)
    except (TritonError, *REFUSALS) as error:
        return " ".join(str(error).split())[:200]
    return None if float(depth) == 1.0 else f"a trial gave {float(depth)} in place of 1"
