"""Hard scenes of several fields: nothing visible, touching, far away, extreme constants. Truth: constant fields."""

import functools
import math

import numpy as np
import torch
from torch import Tensor

from ddf.fields import composition
from ddf.geometry import transforms

from . import case

SCENES = case.Group("composition")
TEMPERATURE, INVERSE_DEPTH = 1e-4, 0.05  # η_T and ε_s


def _fixed(visibility: float, depth: float, at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> composition.Placed:
    """A field of the cube around `at` that says the same everywhere."""

    def query(positions: Tensor, _: Tensor) -> tuple[Tensor, Tensor]:
        return torch.full_like(positions[:, 0], visibility), torch.full_like(positions[:, 0], depth)

    return composition.Placed(query, transforms.Similarity(1.0, np.eye(3), np.array(at)).inverse())


def _ray(
    objects: list[composition.Placed],
    dtype: torch.dtype,
    temperature: float = TEMPERATURE,
    inverse_depth: float = INVERSE_DEPTH,
    start: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> tuple[composition.Composite, Tensor]:
    """The composite of the ray from `start` along z, and the gradient of visibility and depth in the start."""
    positions = torch.tensor([start], dtype=dtype, requires_grad=True)
    directions = torch.tensor([[0.0, 0.0, 1.0]], dtype=dtype)
    found = composition.compose(objects, positions, directions, temperature, inverse_depth)
    finite = torch.where(torch.isfinite(found.depth), found.depth, 0.0)
    (gradient,) = torch.autograd.grad((finite + found.visibility).sum() + 0.0 * positions.sum(), positions)
    return found, gradient


@SCENES.case(
    "depth 0",
    "two fields with ξ = 1 and d = 0 at the same place",
    "ξ = 1, d = 0, nearest depth 0, finite gradients",
)
def _touching(dtype: torch.dtype) -> case.Outcome:
    found, gradient = _ray([_fixed(1.0, 0.0)] * 2, dtype)
    return case.worst(
        case.exact(found.visibility, [1.0]),
        case.exact(found.depth, [0.0]),
        case.exact(found.nearest_depth, [0.0]),
        case.true("finite gradients", torch.isfinite(gradient)),
    )


@SCENES.case(
    "nothing visible",
    "three fields with ξ = 0 and d = 1/4, 1/2 and 3/4",
    "ξ = 0, equal weights: d = 1/2; no nearest depth; finite gradients",
)
def _invisible(dtype: torch.dtype) -> case.Outcome:
    found, gradient = _ray([_fixed(0.0, depth) for depth in (0.25, 0.5, 0.75)], dtype)
    return case.worst(
        case.exact(found.visibility, [0.0]),
        case.close(found.depth, [0.5], 4 * case.step(dtype)),
        case.exact(found.nearest_depth, [math.inf]),
        case.true("finite gradients", torch.isfinite(gradient)),
    )


@SCENES.case(
    "tiny and huge constants",
    "η_T = ε_s = 1e-30, 1e-300 and 1e30; fields with ξ = 1 at d = 1/4 and 1/2",
    "the nearer one where η_T is tiny, the mean 3/8 where it is huge; finite gradients",
)
def _extreme(dtype: torch.dtype) -> case.Outcome:
    outcomes = []
    for constant, depth in ((1e-30, 0.25), (1e-300, 0.25), (1e30, 0.375)):
        found, gradient = _ray([_fixed(1.0, 0.25), _fixed(1.0, 0.5)], dtype, constant, constant)
        outcomes += [
            case.close(found.depth, [depth], 4 * case.step(dtype)),
            case.exact(found.visibility, [1.0]),
            case.true("finite gradients", torch.isfinite(gradient)),
        ]
    return case.worst(*outcomes)


@SCENES.case(
    "two equal fields",
    "the same field twice, ξ = 3/4, d = 1/2",
    "ξ = 1 - 1/16, d = 1/2",
)
def _twice(dtype: torch.dtype) -> case.Outcome:
    found, _ = _ray([_fixed(0.75, 0.5)] * 2, dtype)
    return case.worst(
        case.close(found.visibility, [0.9375], 4 * case.step(dtype)),
        case.close(found.depth, [0.5], 4 * case.step(dtype)),
    )


@SCENES.case(
    "every box missed",
    "two fields with ξ = 1, a ray that passes both boxes",
    "ξ = 0, d = inf, no query at all",
)
def _missed(dtype: torch.dtype) -> case.Outcome:
    found, _ = _ray([_fixed(1.0, 0.5)] * 2, dtype, start=(5.0, 0.0, 0.0))
    return case.worst(
        case.exact(found.visibility, [0.0]),
        case.exact(found.depth, [math.inf]),
        case.exact(found.queries, 0),
    )


@SCENES.case(
    "a field far behind another",
    "a field with ξ = 1 and d = 1/2 at the start, another 1e4 away along the ray, where ξ = 1 and d = 0 in its box",
    "d = 1/2 and nearest depth 1/2, exactly: the far one has no weight left",
)
def _far(dtype: torch.dtype) -> case.Outcome:
    found, _ = _ray([_fixed(1.0, 0.5), _fixed(1.0, 0.0, (0.0, 0.0, 1e4))], dtype)
    return case.worst(case.exact(found.depth, [0.5]), case.exact(found.nearest_depth, [0.5]))


@SCENES.case(
    "constants that are none",
    "η_T or ε_s of 0, -1, inf and NaN",
    "refused, naming the constant",
)
def _constants(dtype: torch.dtype) -> case.Outcome:
    outcomes = []
    for value in (0.0, -1.0, math.inf, math.nan):
        for name, constants in (("temperature", (value, INVERSE_DEPTH)), ("inverse_depth", (TEMPERATURE, value))):
            call = functools.partial(_ray, [_fixed(1.0, 0.5)], dtype, *constants)
            outcomes.append(case.refused(call, f"{name} must be positive and finite"))
    return case.worst(*outcomes)


@SCENES.case("an empty scene", "no object", "refused")
def _empty(dtype: torch.dtype) -> case.Outcome:
    return case.refused(lambda: _ray([], dtype), "at least one object")
