"""What the fields of one image say of what it does not show: real test shapes of an experiment, true camera.

`DDF` holds a latent of the image; the true scale and place are told. `DDF+image` asks image features along each ray.
`patches` are those of the closed surface that `ddf reconstruct` makes of it. Beside the prepared mesh, as `ddf fit`
tells of its own: median depth in per cent of the longest side, silhouettes and parts thinner than 2 % in per cent, and
normals in degrees, by two cameras of 256 x 256 pixels; and per cent of 20,000 rays from inside the box, any way, that
say other whether they end, or are off by more than 1 %. Means over the first image of each shape. Seconds are processor
time of all these rays, and of those of the mesh.
"""

import dataclasses
import time
import types
from collections.abc import Iterator
from typing import Any

import numpy as np
import torch

from bench.lib import measuring
from ddf.core import storage
from ddf.data import mesh_shards, shapenet
from ddf.data.batches import category_data
from ddf.fields import framed_field, pddf, shape_field
from ddf.fit import inspection, patch_fitting
from ddf.geometry import mesh_io, raycast
from ddf.models import line_field, reconstruction_models
from ddf.reconstruction import line_clouds, solid
from ddf_lab.evaluation import groups
from ddf_lab.run import Run

CLOUD, MARGIN = 2500, 0.02  # points; in v1, around the shape
Found = tuple[float, dict[str, float]]


def judged(field: Any, mesh: mesh_io.Mesh) -> Found:
    """Seconds and errors of a framed field, in the box of the mesh, whose frame is v1."""
    lower, upper = (field.field_from_mesh.apply(corner) for corner in np.add(mesh.box(), [[-MARGIN], [MARGIN]]))
    parts = {name: getattr(field, name) for name in ("field_from_mesh", "outputs", "evaluate")}
    asked: Any = types.SimpleNamespace(lower=lower, upper=upper, **parts)  # all from the same places
    asked.enters_its_box = getattr(field, "enters_its_box", False)
    truth = inspection.MeshField(raycast.Scene(mesh), lower, upper, field.field_from_mesh)
    began = time.process_time()
    errors = inspection.measure(asked, truth)
    return time.process_time() - began, {name: errors[name] for name in ("inside", *errors)}


def fields(run: Run, shapes: int) -> Iterator[tuple[str, framed_field.FramedField, mesh_io.Mesh]]:
    """What each model makes of an image of each shape of the run's category, and the mesh."""
    samples, dataset = run.folder("samples"), shapenet.Dataset.open(run.index)
    group = groups.of_shapes(storage.read_json(run.index), run.category, "test")
    views = category_data.test_views(dataset, run.category, 1, 1)
    shown = category_data.available(samples, [each for each in views if group[each[0]].startswith(groups.REAL)])
    packs = [mesh_shards.read_pack(path) for path in sorted(run.folder("meshes").glob(f"*{mesh_shards.SUFFIX}"))]
    latents, size, _ = reconstruction_models.load_ddf(run.folder("train_ddf", seed=0))
    asking = line_field.load(run.folder("train_ddf_image", seed=0)).network
    images = category_data.read_images(dataset, run.category, shown[:shapes], size)
    for row, (name, _) in enumerate(shown[:shapes]):
        pack, rows = next(pack for pack in packs if name in pack.meshes), np.array([row])
        place, mesh, image = pack.field_from_raw[name], pack.meshes[name], images.batch(rows)
        mesh = mesh_io.Mesh(place.inverse().apply(mesh.vertices), mesh.faces)
        latent = reconstruction_models.encode_batch(latents, image)[1]
        own = [each[0].detach() for each in latents.modulations(latent)]
        plain = shape_field.in_cube(pddf.baked(latents.field, own), 1 / place.scale)
        yield "DDF", dataclasses.replace(plain, field_from_mesh=place), mesh
        seen = line_field.ImageField.of(asking.decoder, line_clouds.views_of(asking, images, rows))
        yield "DDF+image", seen, mesh
        cloud = line_clouds.draw(seen, CLOUD, torch.Generator().manual_seed(0)).double().numpy()
        azimuth, elevation, radius = images.cameras[row].tolist()
        alpha, points = image[0, 3].mul(255).byte().numpy(), cloud / line_field.FIELD_FROM_V1
        yield "patches", patch_fitting.patches(solid.solid(seen, points, (azimuth, elevation, radius), alpha)), mesh


def main(*, run: str = "real", categories: list[str] = ["chair", "plane", "car"], shapes: int = 100) -> measuring.Rows:  # noqa: B006
    """All ways, each category in turn.

    Args:
      run: experiment whose models of seed 0 are trained.
      categories: their names.
      shapes: of a category at most.
    """
    for category in categories:
        found: dict[str, list[Found]] = {}
        for name, field, mesh in fields(Run.read(run, category), shapes):
            found.setdefault(name, []).append(judged(field, mesh))
        for name, each in found.items():
            means = {key: float(np.nanmean([errors[key] for _, errors in each])) for key in each[0][1]}
            yield measuring.row(f"{category}: {name}", {"shapes": len(each)}, [took for took, _ in each], means)
