"""How large a predicted shape is: v1 units per field unit, from the box of its cloud."""

from jaxtyping import Float
from torch import Tensor

from ddf.core import checks


def scale_from_cloud(points: Float[Tensor, "n 3"]) -> float:
    """v1 units per field unit, from the diagonal of the cloud's box. [DDF22] app. E.

    Raises:
      InputError: the cloud is a single point.
    """
    return _inverse_diagonal(points.amin(dim=0), points.amax(dim=0))


def _inverse_diagonal(lower: Float[Tensor, "3"], upper: Float[Tensor, "3"]) -> float:
    diagonal = float((upper - lower).norm())
    if not diagonal > 0:
        raise checks.InputError("the predicted cloud is one point; train the model for longer")
    return 1.0 / diagonal
