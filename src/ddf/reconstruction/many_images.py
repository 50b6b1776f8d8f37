"""From trained models and images to clouds, cameras and renders: the artefact that the evaluation reads.

Clouds are in the field frame. `scale` maps the field to the v1 frame: the truth's from the data set, the prediction's
as 1 / (diagonal of its cloud's box), since v1 shapes have diagonal 1 ([DDF22] app. E).
"""

import functools
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import torch
import tqdm
from jaxtyping import Float
from torch import Tensor

from ddf.core import seeding
from ddf.data.batches import category_data
from ddf.fields import cloud_projection, field_outputs, model_files, rendering
from ddf.models import reconstruction_models, reconstruction_settings
from ddf.reconstruction import mask_descent

CORRECTION_BATCH = {"cpu": 16, "cuda": 64}  # a step of the correction keeps what its gradient needs of every pixel
EVEN_RATIOS = tuple(1.2207440846057596**-axis for axis in (1, 2, 3))  # of the root of x^4 = x + 1: see `cube_points`
ROUGH_POINTS = 500  # of the cloud that tells the scale of a shape before it is corrected
SCALE = "scale_pred"
ON_MASK = "mask"  # of the names of clouds: of shapes that agree with the silhouette

Result = TypeVar("Result")


def reconstruct_ddf(
    model: reconstruction_models.DDFModel,
    images: category_data.ImageSet,
    config: reconstruction_settings.PointcloudsConfig,
    describe: str,
    deviation: Float[Tensor, "z"] | None = None,
) -> tuple[dict[str, Tensor], dict]:
    """Clouds L and S after all cycles and after one, each with its scale; with `shape_correction` those of the shapes
    that agree with the silhouette too (`ON_MASK`); cameras, renders, and features for the retrieval row. And the facts.

    Args:
      deviation: of the latents of training images (`mask_descent.latent_deviation`), which a `shape_correction` needs.
    Returns:
      Tensors by name, and facts: `rendered` images, `seconds` of wall time that an image took, by part.
    """
    (features, latents, predicted), encoding = timed_encode(model, images)
    work = _Work(model, images, config, latents, predicted)
    modulations = work.modulations(latents)
    tensors, cloud = work.clouds(modulations, {config.cloud.cycles: _after_all(config.cloud), 1: "h1"}, describe)
    scale = tensors[SCALE]
    seconds = {"encoders": encoding, "cloud": cloud}
    corrected, seconds["camera_correction"] = work.correct_cameras(modulations, scale)
    if config.shape_correction is not None:
        if deviation is None:
            raise ValueError("pointclouds.shape_correction needs the deviation of the latents of training images")
        moved, seconds["shape_correction"] = work.correct_shapes(deviation, config.shape_correction)
        on_mask = {config.cloud.cycles: ON_MASK}
        tensors |= work.clouds(work.modulations(moved), on_mask, f"{describe}, on the mask")[0]
    rendered = spread(len(latents), config.rendered)
    tensors |= {"camera_pred": predicted, "features": features, "camera_corrected": corrected}
    render = functools.partial(work.render, modulations, scale, size=config.render_size)
    pictures = list(in_threads(render, rendered))
    tensors |= {
        f"render.{name}": torch.stack([p[name] for p in pictures]) for name in field_outputs.DEFAULT if pictures
    }
    overlaps = in_threads(functools.partial(work.silhouette_iou, modulations, scale), range(len(latents)))
    tensors["silhouette_iou"] = torch.tensor(list(overlaps))
    return on_cpu(tensors), {"rendered": rendered, "seconds": seconds}


@dataclass(frozen=True)
class _Work:
    """A model, images, and what its encoders make of them."""

    model: reconstruction_models.DDFModel
    images: category_data.ImageSet
    config: reconstruction_settings.PointcloudsConfig
    latents: Float[Tensor, "n z"]
    predicted: Float[Tensor, "n 3"]

    def modulations(self, latents: Float[Tensor, "n z"]) -> list[Tensor]:
        return [each.detach() for each in self.model.modulations(latents)]

    def in_batches(self, make: Callable[[reconstruction_models.Rows], Tensor]) -> tuple[Tensor, float]:
        """What `make` gives of some rows at a time, for all images; and seconds an image."""
        started = time.monotonic()
        batches = reconstruction_models.row_batches(self.images, CORRECTION_BATCH[model_files.device().type])
        found = torch.cat(list(in_threads(make, batches)))
        return found, (time.monotonic() - started) / len(self.latents)

    def clouds(
        self, modulations: Sequence[Float[Tensor, "n 1 _"]], names: Mapping[int, str], describe: str
    ) -> tuple[dict[str, Tensor], float]:
        """Clouds L and S of all images, the scale that each L tells, and seconds an image; names by the number of
        cycles after which clouds are taken.
        """

        def draw(row: int) -> dict[str, Tensor]:
            own, generator, how = [m[row] for m in modulations], generator_of(self.config, row), self.config.cloud
            cycles = cloud_projection.sample(self.model.field, own, self.config.large, how, generator)
            found = {}
            for cycle, label in names.items():
                large, small = cloud_projection.select(cycles[:cycle], (self.config.large, self.config.small), how)
                scale = SCALE if label == _after_all(how) else f"{SCALE}.{label}"
                found |= {f"L.{label}": large, f"S.{label}": small}
                found[scale] = torch.tensor(mask_descent.scale_from_cloud(large))
            return on_cpu(found)

        started, bar = time.monotonic(), {"desc": f"clouds {describe}", "unit": "image", "mininterval": 2}
        drawn = list(tqdm.tqdm(in_threads(draw, range(len(self.latents))), total=len(self.latents), **bar))
        tensors = {key: torch.stack([clouds[key] for clouds in drawn]) for key in drawn[0]}
        return tensors, (time.monotonic() - started) / len(drawn)

    def correct_cameras(
        self, modulations: Sequence[Tensor], scale: Float[Tensor, "n"]
    ) -> tuple[Float[Tensor, "n 3"], float]:
        """Π̂_∇ of all images, and seconds an image."""
        config = self.config.correction

        def correct(rows: reconstruction_models.Rows) -> Tensor:
            alpha = self.images.alpha(rows, config.mask_size).to(self.predicted.device)
            index = torch.from_numpy(rows)
            own, camera = [m[index] for m in modulations], self.predicted[index]
            field_scale = (1 / scale[index]).to(self.predicted.device)
            return mask_descent.correct_camera(self.model, own, camera, field_scale, alpha, config)

        return self.in_batches(correct)

    def correct_shapes(
        self, deviation: Float[Tensor, "z"], how: reconstruction_settings.ShapeCorrectionConfig
    ) -> tuple[Float[Tensor, "n z"], float]:
        """Latents of all images, moved until the silhouettes agree, and seconds an image."""

        def correct(rows: reconstruction_models.Rows) -> Tensor:
            index = torch.from_numpy(rows)
            own, generators = self.latents[index], [generator_of(self.config, int(row)) for row in rows]
            field_scale = rough_field_scales(self.model, own, self.config.cloud, generators)
            alpha = self.images.alpha(rows, how.mask_size).to(own.device)
            camera = self.predicted[index]
            return mask_descent.correct_shapes(self.model, own, deviation, camera, field_scale, alpha, how)

        return self.in_batches(correct)

    def render(
        self,
        modulations: Sequence[Tensor],
        scale: Float[Tensor, "n"],
        image: int,
        size: int,
        outputs: Sequence[str] = field_outputs.DEFAULT,
    ) -> dict[str, Tensor]:
        """The picture of its own prediction: predicted camera, estimated scale."""
        own, camera = [m[image] for m in modulations], self.predicted[image]
        field_scale = (1 / scale[image]).to(camera.device)
        return rendering.render(self.model.field, own, camera, field_scale, size, outputs)[0]

    def silhouette_iou(self, modulations: Sequence[Tensor], scale: Float[Tensor, "n"], image: int) -> float:
        """Intersection over union of such a picture and the image's alpha channel, both cut at one half."""
        given = self.images.batch(np.array([image]))[0, 3].to(self.predicted.device) > 0.5
        own = self.render(modulations, scale, image, len(given), ("visibility",))["visibility"] > 0.5
        return float((own & given).sum() / (own | given).sum().clamp_min(1))


@torch.no_grad()
def rough_field_scales(
    model: reconstruction_models.DDFModel,
    latents: Float[Tensor, "b z"],
    cloud: cloud_projection.CloudConfig,
    generators: Sequence[torch.Generator],
) -> Float[Tensor, "b"]:
    """Field units per v1 unit of each shape, by a cloud of `ROUGH_POINTS`, one generator for each."""
    modulations, found = model.modulations(latents), []
    for row, generator in enumerate(generators):
        own = [m[row] for m in modulations]
        points = cloud_projection.draw(model.field, own, ROUGH_POINTS, cloud, generator)
        found.append(mask_descent.scale_from_cloud(points))
    return 1 / latents.new_tensor(found)


def reconstruct_pcsiren(
    model: reconstruction_models.PCSirenModel,
    images: category_data.ImageSet,
    config: reconstruction_settings.PointcloudsConfig,
) -> tuple[dict[str, Tensor], dict]:
    """Clouds L and S (the first points of L, which are spread as all are), cameras, scales; and the facts."""
    (_, latents, predicted), encoding = timed_encode(model, images)
    started = time.monotonic()

    def draw(image: int) -> Tensor:
        return pcsiren_cloud(model, latents[image : image + 1], config, generator_of(config, image))

    large = list(in_threads(draw, range(len(latents))))
    seconds = {"encoders": encoding, "cloud": (time.monotonic() - started) / len(latents)}
    tensors = {
        "L": torch.stack(large),
        "S": torch.stack([points[: config.small] for points in large]),
        "camera_pred": predicted,
        SCALE: torch.tensor([mask_descent.scale_from_cloud(points) for points in large]),
    }
    return on_cpu(tensors), {"seconds": seconds}


@torch.no_grad()
def pcsiren_cloud(
    model: reconstruction_models.PCSirenModel,
    latent: Float[Tensor, "1 z"],
    config: reconstruction_settings.PointcloudsConfig,
    generator: torch.Generator,
) -> Float[Tensor, "n 3"]:
    """The cloud L of one latent, field frame."""
    chosen = config.pcsiren_inputs == "farthest"
    inputs = cube_points(config.large * (1 + chosen), config.pcsiren_inputs, generator)
    points = model.decoder(inputs[None], latent)[0]
    return points[cloud_projection.farthest_point_order(points, config.large)] if chosen else points


def cube_points(
    count: int, how: reconstruction_settings.CubePoints, generator: torch.Generator
) -> Float[Tensor, "count 3"]:
    """Points of the cube [-1, 1]^3 for PC-SIREN's decoder: `random`, each for itself, or else a random shift of the
    sequence k (g^-1, g^-2, g^-3) mod 1 with g^4 = g + 1, of which any first part fills the cube without gaps or crowds.

    Source of the sequence: Roberts 2018, "The unreasonable effectiveness of quasirandom sequences".
    """
    place = generator.device
    if how == "random":
        return torch.rand((count, 3), generator=generator, device=place) * 2 - 1
    # float64, for only the fractions of products up to `count` are kept
    ratios = torch.tensor(EVEN_RATIOS, dtype=torch.float64, device=place)
    shift = torch.rand(3, generator=generator, dtype=torch.float64, device=place)
    turns = torch.arange(count, dtype=torch.float64, device=place)[:, None] * ratios + shift
    return (turns % 1).float() * 2 - 1


def spread(total: int, count: int) -> list[int]:
    """`count` indices spread evenly over range(total)."""
    count = min(count, total)
    return [int(i) for i in np.linspace(0, total - 1, count).round()] if count else []


def timed_encode(
    model: reconstruction_models.ReconstructionModel, images: category_data.ImageSet
) -> tuple[tuple[Tensor, Tensor, Tensor], float]:
    """Features, latents and cameras; and seconds an image."""
    started = time.monotonic()
    found = reconstruction_models.encode(model, images)
    return found, (time.monotonic() - started) / len(images.shapes)


def _after_all(cloud: cloud_projection.CloudConfig) -> str:
    """Name of the clouds after all cycles, whose scale is `SCALE`; each other cloud has `SCALE`.<its name>."""
    return f"h{cloud.cycles}"


def generator_of(config: reconstruction_settings.PointcloudsConfig, image: int) -> torch.Generator:
    """Each image has its own random stream, so that a subset of images gives the same clouds."""
    return torch.Generator(model_files.device()).manual_seed(seeding.numbered(config.seed, image))


def in_threads(function: Callable[[Any], Result], items: Sequence[Any]) -> Iterator[Result]:
    """`map`, in order, of as many items at a time as this process may use cores; on a GPU one after the other."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    threads = max(1, cores // torch.get_num_threads()) if model_files.device().type == "cpu" else 1
    with ThreadPoolExecutor(threads) as pool:
        yield from pool.map(function, items)


def on_cpu(tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    """Tensors as files keep them: float32, on the CPU."""
    return {name: value.detach().cpu().float().contiguous() for name, value in tensors.items()}
