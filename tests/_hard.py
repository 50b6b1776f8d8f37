"""What tests of hard inputs share: tolerances to the bit, refusals, rays of a lattice, fields that say one thing.

The fixture `dtype` of conftest.py runs such a test in float32 and in float64. ε is the distance from 1 to the next
number of the type: `step(dtype)`.
"""

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch
from _support import assert_close
from torch import Tensor
from torch.nn import functional

from ddf.core import checks
from ddf.fields import pddf
from ddf.geometry import mesh_io

SLOPES = (1.0, 1e-1, 1e-2, 1e-3, 1e-4)  # |n·v|
SATURATED = 1e4  # a logit
FAR = np.array([1e6, -1e6, 5e5])  # multiples of 1/4 around it are float32 numbers
LATTICE = torch.tensor(list(itertools.product((-1.0, 0.0, 1.0), repeat=3)), dtype=torch.float64)
TARGETS = LATTICE[LATTICE.square().sum(-1) > 0]  # corners, middles of edges and of faces of [-1, 1]³
DIRECTIONS = functional.normalize(TARGETS, dim=-1)


def step(dtype: torch.dtype) -> float:
    """ε of the type."""
    return torch.finfo(dtype).eps


def assert_within(found: Any, expected: Any, allowed: Any) -> None:
    """|found - expected| <= allowed, a finite number or one for each entry; equal infinities agree, NaN never does."""
    bound = np.asarray(allowed)
    assert np.isfinite(bound).all()
    assert_close(found, expected, atol=bound, rtol=0.0)


def assert_exact(found: Any, expected: Any) -> None:
    """Equal in every entry; 0 and -0 are."""
    assert_within(found, expected, 0.0)


def assert_refused(call: Callable[[], Any], message: str) -> None:
    """`call` raises InputError with a message in which the pattern `message` is found."""
    with pytest.raises(checks.InputError, match=message):
        call()


def constant_field(
    raw: tuple[float, float, float, float], dtype: torch.dtype, config: pddf.PDDFConfig | None = None
) -> pddf.PDDF:
    """A field with these raw outputs (d_1, d_2, logit w_1, logit ξ) everywhere; its sine layer is random."""
    torch.manual_seed(0)
    field = pddf.PDDF(config or pddf.PDDFConfig((8,), 1.0, 1.0, "relu", 1.0)).to(dtype)
    with torch.no_grad():
        field.network.head.weight.zero_()
        field.network.head.bias.copy_(torch.tensor(raw, dtype=torch.float64))
    return field


def lattice_rays(dtype: torch.dtype) -> tuple[Tensor, Tensor]:
    """Corners, edge and face middles and the centre of [-1, 1]³, each with 26 directions, zeros of both signs."""
    both = torch.cat((DIRECTIONS, torch.where(DIRECTIONS == 0, -0.0, DIRECTIONS))).to(dtype)
    return LATTICE.to(dtype).repeat_interleave(len(both), dim=0), both.repeat(len(LATTICE), 1)


def box(lower: tuple[float, float, float], upper: tuple[float, float, float]) -> mesh_io.Mesh:
    """Twelve triangles of an axis-aligned box."""
    corners = np.array(list(itertools.product(*zip(lower, upper, strict=True))))
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    return mesh_io.Mesh(corners, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))
