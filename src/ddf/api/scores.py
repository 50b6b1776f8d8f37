"""How near two clouds are."""

import numpy.typing as npt

from ddf.api import inputs
from ddf.metrics import cloud_scores


def compare(pred: npt.ArrayLike, truth: npt.ArrayLike, tau_sq: float = cloud_scores.TAU_SQ) -> cloud_scores.CloudScores:
    """Chamfer distance and F-scores of two clouds.

    Args:
      pred, truth: (n, 3) and (m, 3), in one frame and unit.
      tau_sq: threshold on the squared distance; a point counts as hit when its squared distance is <= tau_sq. The
        default is meant for the benchmark frame.
    Returns:
      `.chamfer_l2_sq`, the sum of both means of squared distances; `.f_score_tau`, `.f_score_2tau`, `.precision_tau`
      and `.recall_tau` in [0, 1]; `.num_pred`, `.num_truth`.
    Raises:
      ValueError: a shape that is not (n, 3), a value that is not finite, an empty cloud, or tau_sq not positive.

    Example:
      >>> import ddf
      >>> scores = ddf.compare([[0.0, 0.0, 0.0]], [[0.0, 0.0, 0.005]])
      >>> round(scores.chamfer_l2_sq, 6), scores.f_score_tau
      (5e-05, 1.0)
    """
    return cloud_scores.compare_clouds(inputs.points("pred", pred), inputs.points("truth", truth), tau_sq)
