"""How commands draw clouds: as configs/cpu.yaml, without its file."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ddf.fields import cloud_projection

CLOUD: dict[str, Any] = {  # of `cloud_projection.CloudConfig`, whose defaults are the paper's
    "cycles": 3,
    "num_directions": 16,
    "jitter": 0.2,
    "recheck": (0.1,),
    "spread": 0.75,
    "crowding": 1.0,
    "least_confidence": 0.1,
    "aimed": 0.5,
    "temperature": 0.05,
    "inverse_depth": 0.05,
}


def cloud(**changed: Any) -> "cloud_projection.CloudConfig":
    """How clouds are drawn.

    Raises:
      InputError: a changed setting that does not do.
    """
    from ddf.fields import cloud_projection

    return cloud_projection.CloudConfig(**(CLOUD | changed))
