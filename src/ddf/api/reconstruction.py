"""From one image to the field of what it shows."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from ddf.api.field import Field
from ddf.core import extras, shipped_models


@dataclass(frozen=True)
class Reconstruction:
    """What a model makes of one image.

    field: in the frame of ShapeNet's meshes (v1): Y up, box centred at 0, diagonal about 1.
    points: (n, 3), a cloud on its surface, same frame. camera: azimuth_deg, elevation_deg and radius from which the
      image seems to be taken; radius in benchmark units, 0.57 times those of the frame.
    """

    field: Field
    points: Float[np.ndarray, "n 3"]
    camera: dict[str, float]


def reconstruct(image: str | Path, model: str | Path, n: int = 5000, seed: int = 0) -> Reconstruction:
    """The object of an image, by a trained model. Needs torch.

    Args:
      image: an RGBA file of any size; its alpha is the mask of the object.
      model: a folder that `make train` wrote under train_ddf/, or a name that `ddf models` lists: chair, plane, car.
      n: points of the cloud, 2 or more. seed: the same seed gives the same points.
    Raises:
      FileNotFoundError: there is no such model.
      ValueError: the image or the model is damaged or of another kind, or torch is not installed.

    Example:
      >>> import ddf
      >>> from ddf.core import shipped_models
      >>> image = shipped_models.ROOT / "chair" / "sample_0.png"
      >>> found = ddf.reconstruct(image, "chair", n=200)
      >>> found.points.shape, sorted(found.camera)
      ((200, 3), ['azimuth_deg', 'elevation_deg', 'radius'])
    """
    with extras.named():
        from ddf.fit import shape_field
        from ddf.models.reconstruction import one_image
    trained, size = one_image.load(shipped_models.require(model, "reconstruction"))
    found = one_image.reconstruct(trained, size, Path(image), n, seed)
    shape = shape_field.conditioned(trained.field, found.modulations, found.scale)
    azimuth, elevation, radius = (float(value) for value in found.camera)
    seen_from = {
        "azimuth_deg": float(np.degrees(azimuth)),
        "elevation_deg": float(np.degrees(elevation)),
        "radius": radius,
    }
    return Reconstruction(Field(shape, lambda: shape), found.scale * found.cloud.double().cpu().numpy(), seen_from)
