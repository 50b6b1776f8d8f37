"""Training of the model with image features that goes on from a trained one, whose sizes it keeps."""

import dataclasses
from dataclasses import dataclass
from pathlib import Path

import torch

from ddf.core import checks, shipped_models
from ddf.core.schema import setting
from ddf.fields import model_files
from ddf.models import line_field, out_of_distribution, reconstruction_models, reconstruction_settings

_SIZES = ("encoder", "encoder_width", "latent_features", "decoder", "azimuth", "told")  # of `train`


@dataclass(frozen=True)
class ImageTrainConfig(line_field.LineFieldConfig):
    """Section `ddf_image`: the model, and what its training starts from."""

    start: str = setting("", "trained model to start from: shipped (that of the category's name), a name or a folder")

    def started(
        self, train: reconstruction_settings.TrainConfig, category: str
    ) -> tuple[reconstruction_settings.TrainConfig, line_field.LineFieldConfig, Path | None]:
        """Both sections with the sizes of the model to start from, and its file; None where training starts afresh.

        Raises:
          FileNotFoundError: no such model. InputError: it is damaged, of another kind or takes images of another size.
        """
        own = {each.name: getattr(self, each.name) for each in dataclasses.fields(line_field.LineFieldConfig)}
        if not self.start:
            return train, line_field.LineFieldConfig(**own), None
        given = category if self.start == "shipped" else Path(self.start).expanduser()
        place = shipped_models.require(given, "reconstruction")
        folder, theirs, section = reconstruction_models.recorded(place, line_field.KIND)
        if train.image_size != theirs.image_size:
            raise checks.InputError(f"train.image_size must be {theirs.image_size}, for ddf_image.start is {folder}")
        train = dataclasses.replace(train, **{name: getattr(theirs, name) for name in _SIZES})
        own |= {"places": section["places"], "width": section["width"]}
        return train, line_field.LineFieldConfig(**own), folder / model_files.MODEL


def start_from(model: line_field.ImageDDFModel, file: Path) -> None:
    """Take the weights of a trained model; the model's box and range of cameras grow to hold the other's."""
    decoder, head = model.decoder, model.camera_head
    upper, lowest, highest = (each.clone() for each in (decoder.upper, head.lowest, head.highest))
    model_files.load_model(model, file.parent, out_of_distribution.PREFIX)
    decoder.upper.copy_(torch.maximum(decoder.upper, upper))
    decoder.lower.copy_(-decoder.upper)
    head.lowest.copy_(torch.minimum(head.lowest, lowest))
    head.highest.copy_(torch.maximum(head.highest, highest))
