"""An object placed in its picture as training images place theirs: the centre of its box in the middle (derived here).

Its box's centre and its distance are not known, so the model tells them. Places on a grid are tried; the mean is taken,
each place with the weight exp(-d²/2) of its crop, whose distance from the training images is d (`out_of_distribution`).
The shape that the model makes of it, seen from the training images' mean distance along the predicted angles, tells the
size; then places are tried again, on a finer grid too. A square picture in which the object stands free, as training
images have it, is left as it is: the search costs accuracy there.
"""

import dataclasses
import itertools

import numpy as np
import torch
from jaxtyping import Float, UInt8
from PIL import Image
from torch import Tensor

from ddf.fields import cloud_projection
from ddf.geometry import cameras, transforms
from ddf.models import line_field, reconstruction_models
from ddf.reconstruction import line_clouds, mask_descent

START = np.array([0.7, 0.0, 0.03])  # share of the diagonal, and of the centre's place, of the synthetic training images
_COARSE, _FINE, _EACH_WAY = 0.03, 0.01, 2  # steps of the grids of places
_POINTS = 400  # that tell how large the shape is seen
_LEAST, _MOST = np.array([0.3, -0.2, -0.2]), np.array([1.2, 0.2, 0.2])
_OPAQUE = 128

Frame = Float[np.ndarray, "3"]  # diagonal of the object's box, place of its centre, x right, y down; in picture sides


class Cutout:
    """An RGBA picture and the box of its object. given: its frame where it stands as in training images, or is
    `framed`, else None.
    """

    def __init__(self, pixels: UInt8[np.ndarray, "h w 4"], framed: bool = False) -> None:
        rows, columns = (np.flatnonzero((pixels[..., 3] >= _OPAQUE).any(axis=axis)) for axis in (1, 0))
        lower, upper = np.array([columns[0], rows[0]]), np.array([columns[-1] + 1, rows[-1] + 1])
        self.diagonal = float(np.linalg.norm(upper - lower))
        sides = np.array(pixels.shape[1::-1])
        given = np.array([self.diagonal / sides[0], *((lower + upper) / 2 / sides - 0.5)])
        free = sides[0] == sides[1] and (lower > 0).all() and (upper < sides).all()
        free &= (given >= _LEAST).all() and (given <= _MOST).all()
        self.given = given if free or framed else None
        lower, upper = np.maximum(lower - 1, 0), upper + 1  # half transparent edges
        self._own = Image.fromarray(pixels[lower[1] : upper[1], lower[0] : upper[0]])
        self.centre = (columns[0] + columns[-1] + 1) / 2 - lower[0], (rows[0] + rows[-1] + 1) / 2 - lower[1]

    def crop(self, frame: Frame, size: int) -> UInt8[np.ndarray, "size size 4"]:
        """The object as it stands in a frame, on transparent pixels."""
        side = self.diagonal / frame[0]
        left, top = (middle - side * (0.5 + place) for middle, place in zip(self.centre, frame[1:], strict=True))
        near = np.floor([min(left, 0), min(top, 0)]).astype(int)
        far = np.ceil([max(left + side, self._own.width), max(top + side, self._own.height)]).astype(int)
        canvas = Image.new("RGBA", tuple(far - near))
        canvas.paste(self._own, tuple(-near))
        box = (left - near[0], top - near[1], left - near[0] + side, top - near[1] + side)
        found = np.array(canvas.resize((size, size), Image.Resampling.BILINEAR, box=box))
        found[found[..., 3] == 0] = 0
        return found


@torch.no_grad()
def frame(trained: reconstruction_models.TrainedDDF | line_field.TrainedImageDDF, cutout: Cutout) -> Frame:
    """Where the object stands in a picture that is like the model's training images."""
    if cutout.given is not None:
        return cutout.given
    model, size, statistics = trained
    if statistics is None:
        return np.clip(_by_shape(model, cutout.crop(START, size)), _LEAST, _MOST)

    def likeliest(around: Frame, step: float) -> Frame:
        steps = step * np.arange(-_EACH_WAY, _EACH_WAY + 1)
        frames = [around + np.array([0, x, y]) for x, y in itertools.product(steps, steps)]
        images = torch.cat([encoder_input(cutout.crop(each, size)) for each in frames])
        stages = model.shape_encoder.stages(images.to(model.camera_head.mean))
        squares = statistics.distance(torch.cat(stages, dim=1).double().cpu()).numpy() ** 2
        return np.average(frames, axis=0, weights=np.exp((squares.min() - squares) / 2))

    seen = _by_shape(model, cutout.crop(likeliest(START, _COARSE), size))
    sized = np.array([np.clip(seen[0], _LEAST[0], _MOST[0]), *START[1:]])
    return likeliest(likeliest(sized, _COARSE), _FINE)


def encoder_input(pixels: UInt8[np.ndarray, "h w 4"]) -> Float[Tensor, "1 4 h w"]:
    """As the encoders take it: in [0, 1]."""
    return torch.from_numpy(pixels).permute(2, 0, 1)[None].float() / 255


def _by_shape(
    model: reconstruction_models.DDFModel | line_field.ImageDDFModel, pixels: UInt8[np.ndarray, "h w 4"]
) -> Frame:
    """The frame of the shape that the model sees, from the mean distance."""
    mean, image = model.camera_head.mean, encoder_input(pixels)
    _, latent, camera = reconstruction_models.encode_batch(model, image.to(mean))
    generator = torch.Generator(mean.device).manual_seed(0)
    if isinstance(model, line_field.ImageDDFModel):
        views = model.views(image.to(mean), torch.cat((camera[:, :2], mean[None, 2:]), dim=1))
        cloud = line_clouds.draw(line_field.ImageField.of(model.decoder, views), _POINTS, generator)
    else:
        drawn = dataclasses.replace(cloud_projection.USUAL, cycles=1)
        own = [each[0] for each in model.modulations(latent)]
        cloud = cloud_projection.draw(model.field, own, _POINTS, drawn, generator)
    points = (transforms.BENCHMARK_FROM_V1 * mask_descent.scale_from_cloud(cloud) * cloud).double()
    column, row = cameras.project(
        points, *cameras.extrinsics(camera[0, 0].double(), camera[0, 1].double(), mean[2].double())
    )
    ends = torch.stack([torch.stack([line.min(), line.max()]) for line in (column, row)]) / cameras.IMAGE_SIZE
    diagonal, (x, y) = float((ends[:, 1] - ends[:, 0]).norm()), (ends.mean(dim=1) - 0.5).tolist()
    return np.array([diagonal, x, y])
