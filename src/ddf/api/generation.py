"""New shapes of a trained model."""

from pathlib import Path

from ddf.api.field import Field
from ddf.core import checks, extras, shipped_models


def generate(model: str | Path, n: int = 8, seed: int = 0) -> list[Field]:
    """New shapes, in the frame of ShapeNet's meshes (v1). Needs torch.

    Args:
      model: the name of a reconstruction model that `ddf models` lists, or a folder that stage train_ddf, train_vae or
        train_gan wrote.
      n: how many, 1 or more. seed: the same seed gives the same shapes, and more of them begin with those of less.
    Raises:
      FileNotFoundError: there is no such model.
      ValueError: n is below 1, the model is damaged or decodes no latents, or torch is not installed.

    Example:
      >>> import ddf
      >>> (chair,) = ddf.generate("chair", n=1)
      >>> chair.points(50).shape
      (50, 3)
    """
    checks.require_whole("n", n, 1)
    with extras.named():
        from ddf.models import generated_images
        from ddf.reconstruction import sampler
    path = shipped_models.require(model, "reconstruction")
    found = sampler.load(path.parent if path.is_file() else path)
    latents = generated_images.latents(n, found.features, seed, "samples")
    shapes = [found.decode(latent) for latent in latents]
    return [Field(shape, lambda shape=shape: shape) for shape in shapes]
