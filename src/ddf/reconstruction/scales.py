"""How large a predicted shape is: v1 units per field unit, from the box of its cloud or of all hits."""

from collections.abc import Sequence

from jaxtyping import Float
from torch import Tensor

from ddf.core import checks
from ddf.fields import cloud_projection


def scale_from_cloud(points: Float[Tensor, "n 3"]) -> float:
    """v1 units per field unit, from the diagonal of the cloud's box. [DDF22] app. E.

    Raises:
      InputError: the cloud is a single point.
    """
    return _inverse_diagonal(points.amin(dim=0), points.amax(dim=0))


def scale_from_cycles(cycles: Sequence[cloud_projection.ProjectedPoints], quantile: float) -> float:
    """v1 units per field unit, from all candidates of a cloud, each as heavy as its confidence (derived here).

    The outermost point sets the box of a cloud: one that missed the surface shrinks the whole shape, and a thin tip of
    which the field is unsure is missing from it. Of all candidates many lie near any tip, and few far from a surface.

    Args:
      quantile: share of the weight that is left out at either end of every axis.
    Raises:
      InputError: the candidates are a single point, but for that share.
    """
    points, confidence = cloud_projection.candidates(cycles)
    weights = confidence.double().clamp_min(cloud_projection.LEAST_WEIGHT)
    return _inverse_diagonal(_lower_end(points, weights, quantile), -_lower_end(-points, weights, quantile))


def _lower_end(points: Float[Tensor, "n 3"], weights: Float[Tensor, "n"], quantile: float) -> Float[Tensor, "3"]:
    """Of each axis the first coordinate below which, itself included, lies more than this share of the weight."""
    ordered, order = points.sort(dim=0)
    passed = weights[order].cumsum(dim=0) > quantile * weights.sum()
    return ordered.gather(0, passed.int().argmax(dim=0, keepdim=True))[0]


def _inverse_diagonal(lower: Float[Tensor, "3"], upper: Float[Tensor, "3"]) -> float:
    diagonal = float((upper - lower).norm())
    if not diagonal > 0:
        raise checks.InputError("the predicted cloud is one point; train the model for longer")
    return 1.0 / diagonal
