"""How near two clouds are."""

import numpy as np
import numpy.typing as npt

from ddf.api import inputs
from ddf.core import checks
from ddf.metrics import cloud_scores


def compare(
    pred: npt.ArrayLike, truth: npt.ArrayLike, tau_sq: float = cloud_scores.TAU_SQ, relative: bool = False
) -> cloud_scores.CloudScores:
    """Chamfer distance and F-scores of two clouds.

    Args:
      pred, truth: (n, 3) and (m, 3), in one frame and unit.
      tau_sq: threshold on the squared distance; a point counts as hit when its squared distance is <= tau_sq. The
        default is meant for the benchmark frame.
      relative: lengths are shares of the diagonal of the truth's box, tau_sq too.
    Returns:
      `.chamfer_l2_sq`, the sum of both means of squared distances; `.f_score_tau`, `.f_score_2tau`, `.precision_tau`
      and `.recall_tau` in [0, 1]; `.num_pred`, `.num_truth`.
    Raises:
      ValueError: a shape that is not (n, 3), a value that is not finite, an empty cloud, tau_sq not positive, or
        lengths relative to a truth that is a single point.

    Example:
      >>> import ddf
      >>> scores = ddf.compare([[0.0, 0.0, 0.0]], [[0.0, 0.0, 0.005]])
      >>> round(scores.chamfer_l2_sq, 6), scores.f_score_tau
      (5e-05, 1.0)
    """
    found, true, unit = inputs.points("pred", pred), inputs.points("truth", truth), 1.0
    if relative and len(true):
        unit = float(np.linalg.norm(np.ptp(true, axis=0)))
        if not unit > 0:
            raise checks.InputError("truth: all points are one, so nothing is relative to its box")
    return cloud_scores.compare_clouds(found / unit, true / unit, tau_sq)
