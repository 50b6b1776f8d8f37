"""Curvature at grazing angles. Truth: networks whose depth has the exact value, gradient and Hessian of a shape's.

With n the normal that faces the viewer, s = |n·v|, principal curvatures κ_i along t_i (signs as in `primitives`) and
P = I + v ∇d^T, differentiating F(p + d v) = 0 twice gives (derived here)

  ∇d = n/s,  H[d] = -1/s Σ_i κ_i a_i a_i^T,  a_i = P^T t_i = t_i + n (v·t_i)/s.

Three sine units have these at p = 0: sin(∇d·p) the gradient, κ_i/s (sin(a_i·p + π/2) - 1) each term of the Hessian.
The shapes of `primitives` have to say the same of such rays. The networks see a turned copy: no number is round.
"""

import math
from dataclasses import dataclass

import _closed_form
import torch
from torch.nn import functional

from ddf.fields import derivatives, pddf
from ddf.geometry import primitives, rays

from . import case
from .ray_cases import SLOPES

CURVATURE = case.Group("curvature")
DEPTH = 2.0


def two_jet_field(
    v: torch.Tensor, n: torch.Tensor, tangents: torch.Tensor, kappa: tuple[float, float], dtype: torch.dtype
) -> pddf.PDDF:
    """The field of the module's docstring, seen from p = 0 along v.

    Args:
      v, n: (3), unit, n·v < 0. tangents: t_1 and t_2 as rows. kappa: κ_1 and κ_2.
    """
    slope = float(-(n * v).sum())
    field = pddf.PDDF(pddf.PDDFConfig((3,), 1.0, 1.0, "relu", 1.0))
    layer, head = field.network.layers[0], field.network.head
    heights = torch.tensor([1.0, kappa[0] / slope, kappa[1] / slope], dtype=torch.float64)
    with torch.no_grad():
        field.double()
        for parameter in field.parameters():
            parameter.zero_()
        layer.weight[0, :3] = n / slope
        layer.weight[1:, :3] = tangents + (tangents @ v)[:, None] * n / slope
        layer.bias[1:] = math.pi / 2
        head.weight[0] = heights
        head.bias[0] = DEPTH - heights[1:].sum()
        head.bias[2] = 9.0  # the first component is the heavier
    return field.to(dtype).requires_grad_(False)


@dataclass(frozen=True)
class Place:
    """A point of a closed-form shape: q, the normal that a viewer sees, and the principal curvatures along y and z.

    back: how far along the ray, over |n·v|, a start still sees q first; `inf` where 2 is near enough at any angle.
    """

    shape: primitives.Primitive
    point: tuple[float, float, float]
    side: float
    kappa: tuple[float, float]
    back: float = math.inf


TORUS = _closed_form.Torus(0.75, 0.25)
FRAME = torch.eye(3, dtype=torch.float64)
TURN = torch.tensor([[0.48, 0.8, 0.36], [-0.6, 0.0, 0.8], [0.64, -0.6, 0.48]], dtype=torch.float64)


def _compare(place: Place, dtype: torch.dtype) -> case.Outcome:
    """Normals and both curvatures at every slope, and that the shape itself has these curvatures there."""
    normal, across = place.side * FRAME[0], functional.normalize(FRAME[1] + FRAME[2], dim=0)
    start, largest = torch.zeros(1, 3, dtype=dtype), max(map(abs, place.kappa))
    found = []
    for slope in SLOPES:
        v = math.sqrt(1 - slope * slope) * across - slope * normal
        way = min(2.0, place.back * slope)
        seen = rays.OrientedPoints(torch.tensor([place.point], dtype=torch.float64) - way * v, v[None])
        told = primitives.curvatures(place.shape, seen).sort().values
        found.append(case.close(told, torch.tensor([sorted(place.kappa)]), 1e-6))
        field = two_jet_field(TURN @ v, TURN @ normal, FRAME[1:] @ TURN.T, place.kappa, dtype)
        surface = derivatives.Surface(field, start, (TURN @ v).to(dtype)[None])
        allowed = 8 * case.step(dtype) / slope
        found.append(case.close(surface.normals[0], TURN @ normal, 4 * case.step(dtype)))
        found.append(case.close(surface.gaussian, [place.kappa[0] * place.kappa[1]], allowed * largest**2))
        found.append(case.close(surface.mean, [sum(place.kappa)], allowed * largest))
    return case.worst(*found)


GIVEN = "|n·v| = 1, 1e-1, ..., 1e-4, v along no principal direction; "
ALLOWED = " within 8 ε/|n·v|, the rounding of a tangent over the slope"


@CURVATURE.case("plane", GIVEN + "κ = 0, 0", "mean 0, Gaussian 0")
def _plane(dtype: torch.dtype) -> case.Outcome:
    return _compare(Place(_closed_form.Plane((1.0, 0.0, 0.0)), (0.0, 0.0, 0.0), 1.0, (0.0, 0.0)), dtype)


@CURVATURE.case("sphere from outside", GIVEN + "radius 1/2", "mean -4, Gaussian 4," + ALLOWED)
def _sphere_outside(dtype: torch.dtype) -> case.Outcome:
    return _compare(Place(primitives.Sphere(radius=0.5), (0.5, 0.0, 0.0), 1.0, (-2.0, -2.0)), dtype)


@CURVATURE.case("sphere from inside", GIVEN + "radius 1/2", "mean 4, Gaussian 4," + ALLOWED)
def _sphere_inside(dtype: torch.dtype) -> case.Outcome:
    return _compare(Place(primitives.Sphere(radius=0.5), (0.5, 0.0, 0.0), -1.0, (2.0, 2.0), 0.5), dtype)


@CURVATURE.case(
    "torus, outermost circle",
    GIVEN + "tube 1/4 around a circle of 3/4: κ = -4 and -1",
    "mean -5, Gaussian 4," + ALLOWED,
)
def _torus_outer(dtype: torch.dtype) -> case.Outcome:
    return _compare(Place(TORUS, (1.0, 0.0, 0.0), 1.0, (-4.0, -1.0)), dtype)


@CURVATURE.case(
    "torus, innermost circle (a saddle)",
    GIVEN + "tube 1/4 around a circle of 3/4: κ = -4 and 2",
    "mean -2, Gaussian -8," + ALLOWED,
)
def _torus_inner(dtype: torch.dtype) -> case.Outcome:
    return _compare(Place(TORUS, (0.5, 0.0, 0.0), -1.0, (-4.0, 2.0), 0.5), dtype)
