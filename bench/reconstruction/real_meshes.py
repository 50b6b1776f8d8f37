"""Real meshes, our renderer: what trained models make of shapes that nobody here designed, none of them trained on.

A car, two chairs and an airliner of other people (folder `shared/meshes` beside the project, or `--meshes DIR`) are
turned into the frame of ShapeNet v1 and rendered as synthetic shapes are, from cameras and under lights drawn likewise,
in one paint all over, as their files hold no colours: shape alone must tell front from rear. Cameras are judged on all
images, clouds and silhouettes on the first of them. Models are those that come with the package, or the trainings in
`--models DIR`, a folder for each category.

Errors: D_C and F(τ) at the true camera and scale with 5,000 points, as in the reference table but without a correction;
azimuth error of the predicted camera, median and share over 90 degrees (turned round); IoU of the silhouette, from the
predicted camera at the predicted scale, with the image's.
"""

import argparse
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from PIL import Image
from torch import Tensor

from bench.lib import display, measuring
from ddf.core import checks, seeding, shipped_models
from ddf.data import shapenet, true_clouds
from ddf.data.synthetic import assemble, palette, parts, render, write
from ddf.fields import rendering
from ddf.geometry import mesh_io, transforms
from ddf.metrics import camera_errors, cloud_scores
from ddf.models.reconstruction import inference, one_image, reconstruction_models

ON_DEMAND = "python -m bench real_meshes, with the meshes"
NAME = "real_meshes"
SEED, THREADS = 0, 1
CLOUD_POINTS, TRUTH_POINTS = 5_000, 8_000
TURNED_DEG = 90.0


@dataclass(frozen=True)
class RealMesh:
    """A file, what it shows, and its axes, as signs and letters, that are X (ahead), Y (up) and Z of ShapeNet v1."""

    file: str
    category: str
    axes: tuple[str, str, str]

    def vertices(self, mesh: mesh_io.Mesh) -> Float[np.ndarray, "n 3"]:
        """In the v1 frame: box centred at 0, diagonal 1."""
        columns = [(-1 if axis[0] == "-" else 1) * mesh.vertices[:, "xyz".index(axis[-1])] for axis in self.axes]
        return assemble.normalise(np.stack(columns, axis=1))


MESHES = (
    RealMesh("car_kaykit_sedan.obj", "car", ("z", "y", "-x")),
    RealMesh("chair_aws_A.ply", "chair", ("-x", "z", "y")),
    RealMesh("chair_kaykit_A.obj", "chair", ("z", "y", "-x")),
    RealMesh("airplane_airliner.obj", "plane", ("x", "z", "-y")),
)


@dataclass(frozen=True)
class Renders:
    """Images of one mesh in a folder, their cameras, and its cloud in benchmark units.

    cameras: azimuth and elevation in radians, radius.
    """

    images: list[Path]
    cameras: Float[np.ndarray, "n 3"]
    truth: Float[np.ndarray, "m 3"]


def renders(real: RealMesh, folder: Path, out: Path, views: int) -> Renders:
    """Render a mesh as `write.write_shape` renders synthetic ones, each view in another colour."""
    mesh = mesh_io.load(folder / real.file)
    placed = mesh_io.Mesh(real.vertices(mesh), mesh.faces)
    random, images = seeding.generator(SEED, real.file), []
    drawn = write.make_views(SEED, real.category, 0, views)
    for number, view in enumerate(drawn):
        part = parts.Part(placed.vertices, placed.faces, _paint(real.category, random))
        images.append(out / f"{Path(real.file).stem}_{number:02d}.png")
        Image.fromarray(render.Renderer(assemble.shape([part], random)).render(view)).save(images[-1])
    poses = [(np.radians(view.azimuth_deg), np.radians(view.elevation_deg), view.ratio) for view in drawn]
    cloud, _ = true_clouds.poisson_disk(placed, TRUTH_POINTS, random)
    return Renders(images, np.array(poses), cloud * transforms.BENCHMARK_FROM_V1)


def _paint(category: str, random: np.random.Generator) -> parts.Paint:
    if category == "chair":
        return palette.chair(random, is_metal=False)[0]
    return palette.car(random) if category == "car" else palette.plane(random)[0]


def seen_from(model: reconstruction_models.DDFModel, size: int, images: Sequence[Path]) -> Float[np.ndarray, "n 3"]:
    """Predicted cameras of images."""
    pixels = torch.stack([shapenet.read_image(path, size) for path in images])
    with torch.no_grad():
        return inference.encode_batch(model, pixels)[2].numpy().astype(np.float64)


def silhouette_iou(
    model: reconstruction_models.DDFModel, found: one_image.Reconstructed, alpha: Float[Tensor, "s s"]
) -> float:
    """Intersection over union of the predicted visibility and an alpha channel, both cut at one half."""
    scale = torch.tensor(1 / found.scale)
    images, _ = rendering.render(model.field, found.modulations, found.camera, scale, alpha.shape[-1], ("visibility",))
    own, given = images["visibility"] > 0.5, alpha > 0.5
    return float((own & given).sum() / (own | given).sum().clamp_min(1))


def measure(real: RealMesh, model_dir: Path, folder: Path, views: int, clouds: int) -> dict[str, Any]:
    """The row of one mesh and one model."""
    model, size = one_image.load(model_dir)
    with tempfile.TemporaryDirectory() as out:
        made = renders(real, folder, Path(out), views)
        cameras = seen_from(model, size, made.images)
        azimuth = camera_errors.angle_difference_deg(cameras[:, 0], made.cameras[:, 0])
        scores, overlaps, seconds = [], [], []
        for image in made.images[:clouds]:
            started = time.perf_counter()
            found = one_image.reconstruct(model, size, image, CLOUD_POINTS, SEED)
            seconds.append(time.perf_counter() - started)
            scores.append(cloud_scores.compare_clouds(_placed(found.cloud, real, folder), made.truth))
            overlaps.append(silhouette_iou(model, found, shapenet.read_image(image, size)[3]))
    errors = {
        "chamfer_l2_sq_x1000": 1e3 * float(np.mean([score.chamfer_l2_sq for score in scores])),
        "f_score_tau_x100": 100 * float(np.mean([score.f_score_tau for score in scores])),
        "azimuth_error_deg_median": float(np.median(azimuth)),
        "azimuth_turned_x100": 100 * float((azimuth > TURNED_DEG).mean()),
        "silhouette_iou": float(np.mean(overlaps)),
    }
    size_of = {"category": real.category, "views": views, "clouds": clouds, "points": CLOUD_POINTS}
    return measuring.row(f"real meshes, our renderer: {Path(real.file).stem}", size_of, seconds, errors)


def _placed(cloud: Float[Tensor, "n 3"], real: RealMesh, folder: Path) -> Float[np.ndarray, "n 3"]:
    """A cloud of the field frame, whose longest side is 2, in benchmark units, at the true scale."""
    vertices = real.vertices(mesh_io.load(folder / real.file))
    v1_from_field = np.ptp(vertices, axis=0).max() / 2
    return cloud.numpy().astype(np.float64) * (v1_from_field * transforms.BENCHMARK_FROM_V1)


def model_of(category: str, models: Path | None) -> Path:
    """The folder of a category's DDF: of the trainings given, or the one that comes with the package."""
    return shipped_models.place(category) if models is None else models / category


SECTION = display.Section(views=())


def main(arguments: Sequence[str]) -> None:
    """Measure every mesh that is there, with every model that is there, and write the rows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--meshes", type=Path, default=measuring.REAL_MESHES, help="their folder")
    parser.add_argument("--models", type=Path, help="folder of trainings by category, such as artifacts/cpu/train_ddf")
    parser.add_argument("--views", type=int, default=24, help="of each mesh (default %(default)s)")
    parser.add_argument("--clouds", type=int, default=8, help="of the views (default %(default)s)")
    args = parser.parse_args(arguments)
    if not 1 <= args.clouds <= args.views:
        raise checks.InputError(f"--clouds must be in 1..--views; got {args.clouds} of {args.views}")
    there = [real for real in MESHES if (args.meshes / real.file).is_file()]
    if not there:
        print(f"{NAME}: skipped, {args.meshes} holds none of {', '.join(real.file for real in MESHES)}")
        return
    torch.set_num_threads(THREADS)
    rows = []
    for real in there:
        folder = model_of(real.category, args.models)
        if folder.is_dir():
            rows.append(measure(real, folder, args.meshes, args.views, args.clouds))
            told = ", ".join(f"{name} {value:.3g}" for name, value in rows[-1]["error"].items())
            print(f"{rows[-1]['what']}: {told}", flush=True)
    measuring.write(NAME, THREADS, rows)
