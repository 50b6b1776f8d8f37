"""What trained models make: field, mesh and cloud of one picture, and new shapes."""

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float, UInt8

from ddf.api.field import Field
from ddf.core import checks, extras, shipped_models, storage
from ddf.geometry import mesh_io
from ddf.geometry.mesh_io import Mesh

if TYPE_CHECKING:
    from ddf.reconstruction import one_image, solid

FILES = CAMERA, CLOUD, PICTURE, GLB, PLY = "camera.json", "cloud.ply", "picture.png", "shape.glb", "shape.ply"
_SEEN = ("azimuth_deg", "elevation_deg", "radius", "unlike_training")
_TOLERANCE = 2e-3  # of half the longest side: patches come so near to the mesh, whose cells are ten times as large


class Reconstruction:
    """What a model makes of a picture, in the frame of ShapeNet's meshes (v1): Y up, box centred at 0, diagonal 1.

    Mesh and field are made when they are first asked for. points: (n, 3), the model's own cloud of the surface. camera:
      azimuth_deg, elevation_deg and radius from which the framed picture seems to be taken; radius in benchmark units,
      0.57 times those of the frame. cameras: of every picture, with `unlike_training`. view: the object, cut out.
    kind: what the model knows, by its name. unlike: the share of training images that are more usual than the
      picture; None where the model does not know. seconds: of each part that was made.
    """

    def __init__(self, found: "one_image.Reconstructed", n: int, kind: str) -> None:
        self._found, self.kind = found, kind
        self.points: Float[np.ndarray, "n 3"] = found.cloud[:n]
        self.view: UInt8[np.ndarray, "s s 4"] = found.view
        self.unlike, self.seconds = found.scores[0], found.seconds
        azimuth, elevation, radius = found.cameras[0].tolist()
        self._seen_from = (azimuth, elevation, radius)
        seen = zip(found.cameras.tolist(), found.scores, strict=True)
        self.cameras = [dict(zip(_SEEN, (*np.degrees(c[:2]).tolist(), c[2], x), strict=True)) for c, x in seen]
        self.camera = {name: self.cameras[0][name] for name in _SEEN[:3]}

    def __repr__(self) -> str:
        azimuth, elevation, radius = self.camera.values()
        seen = f"seen from {azimuth:.0f},{elevation:.0f},{radius:.2f}"
        return f"Reconstruction({self.kind}: {self.verdict}; {seen}; {len(self.points):,} points)"

    @cached_property
    def _solid(self) -> Mesh:
        from ddf.reconstruction import one_image, solid

        cloud, alpha = self._found.cloud[: one_image.WHOLE], self.view[..., 3]
        with one_image.timed(self.seconds, "mesh"):
            return solid.solid(self._found.shape, cloud, self._seen_from, alpha)

    @cached_property
    def field(self) -> Field:
        """Patches of the mesh."""
        from ddf.fields.grid import octree
        from ddf.fit import patch_fitting
        from ddf.reconstruction import one_image

        plain = self._solid
        with one_image.timed(self.seconds, "field"):
            shape = patch_fitting.patches(plain, octree.PatchConfig(_TOLERANCE))
        return Field(shape)

    @cached_property
    def mesh(self) -> Mesh:
        """Watertight, with normals, and the picture's colours where that sees a vertex or its mirror image."""
        from ddf.reconstruction import one_image

        plain, paint = self._solid, self.paint
        with one_image.timed(self.seconds, "colours"):
            colours, normals = paint.colours(plain.vertices), mesh_io.vertex_normals(plain)
        return Mesh(plain.vertices, plain.faces, colours=colours, normals=normals)

    @cached_property
    def normals(self) -> Float[np.ndarray, "n 3"]:
        """Of the points, outward: those of the nearest vertices."""
        from scipy import spatial

        near = spatial.cKDTree(self._solid.vertices).query(self.points)[1]
        return mesh_io.vertex_normals(self._solid)[near]

    @property
    def verdict(self) -> str:
        """How usual the picture is, in words."""
        from ddf.models import out_of_distribution

        return out_of_distribution.verdict(self.unlike, self.kind)

    @cached_property
    def overlaps(self) -> list[float]:
        """Of every picture: intersection over union of its silhouette and the field's, from its camera."""
        from ddf.reconstruction import several_images, solid

        views = self._found.views if isinstance(self._found, several_images.Reconstructed) else [self.view]
        pairs = zip(self._found.cameras.tolist(), views, strict=True)
        return [solid.Paint(self.field.framed, (a, e, r), view).overlap() for (a, e, r), view in pairs]

    @cached_property
    def paint(self) -> "solid.Paint":
        """The field in the picture's colours, seen from anywhere."""
        from ddf.reconstruction import solid

        return solid.Paint(self.field.framed, self._seen_from, self.view)

    def save(self, folder: str | Path) -> dict[str, Any]:
        """Write the field (`ddf.load` takes the folder), shape.glb and shape.ply, cloud.ply with normals, picture.png
        and camera.json; returns the content of the last.
        """
        from ddf.reconstruction import one_image

        out = Path(folder)
        field, mesh = self.field, self.mesh
        with one_image.timed(self.seconds, "picture"):
            sheet, overlaps = self.paint.sheet(), [round(each, 3) for each in self.overlaps]
        out.mkdir(parents=True, exist_ok=True)
        field.save(out)
        mesh.save(out / PLY)
        storage.write_bytes(out / GLB, self.paint.textured(mesh))
        storage.write_bytes(out / CLOUD, mesh_io.points_ply(self.points, self.normals))
        with storage.atomic_path(out / PICTURE) as temporary:
            sheet.save(temporary, "PNG")
        result = {
            "camera": self.camera,
            "cameras": [c | {"silhouette_iou": iou} for c, iou in zip(self.cameras, overlaps, strict=True)],
            "points": len(self.points),
            "faces": len(mesh.faces),
            "silhouette_iou": overlaps[0],
            "unlike_training": self.unlike,
            "verdict": self.verdict,
            "seconds": {name: round(value, 4) for name, value in self.seconds.items()},
        }
        storage.write_json(out / CAMERA, result)
        return result


def reconstruct(
    image: str | Path | Sequence[str | Path],
    model: str | Path,
    n: int = 5000,
    seed: int = 0,
    mask: str | Path | None = None,
    background: str = "auto",
    cameras: str | Path | Sequence[Any] | Mapping[str, Any] | None = None,
) -> Reconstruction:
    """The object of a picture, or of several, by a trained model. Needs torch.

    Args:
      image: a PNG, WebP, JPEG, GIF or BMP file of any size; the object may stand anywhere in it. Several of one object,
        for a model of train_ddf_image; what is said of one picture is of the first.
      model: trained DDF: a name that `ddf models` lists (chair, plane, car), or a folder that `make train` wrote, such
        as artifacts/cpu/train_ddf/chair or artifacts/cpu/train_ddf_image/chair.
      n: points of the cloud, 2 or more; field and camera do not depend on it up to 5,000.
      seed: the same seed gives the same points.
      mask: a picture that is light on the object.
      background: what the object is cut out by where there is no mask: `auto`, the picture's alpha, or its rim where it
        has none; `white`; `border`, the rim; or a colour, #rrggbb.
      cameras: of the pictures, None to predict them: azimuth and elevation (degrees) and radius (benchmark units) of
        each, or a JSON file or its content (docs/formats.md).
    Raises:
      FileNotFoundError: there is no such model.
      ValueError: the picture or the model is damaged or of another kind, no object stands out, or torch is not
        installed.

    Example:
      >>> import ddf
      >>> from ddf.core import shipped_models
      >>> image = shipped_models.ROOT / "chair" / "sample_0.png"
      >>> found = ddf.reconstruct(image, "chair", n=200)
      >>> found.points.shape, sorted(found.camera)
      ((200, 3), ['azimuth_deg', 'elevation_deg', 'radius'])
    """
    images = [Path(each) for each in ([image] if isinstance(image, str | Path) else image)]
    return reconstructor(model)(images, n, seed, None if mask is None else Path(mask), background, cameras)


def reconstructor(model: str | Path) -> Callable[..., Reconstruction]:
    """As `reconstruct`, of a model that is loaded once."""
    with extras.named():
        from ddf.data import cutouts
        from ddf.models import line_field
        from ddf.reconstruction import given_cameras, one_image, several_images
    path = shipped_models.require(model, "reconstruction")
    path = path.parent if path.is_file() else path
    with one_image.timed({}, "model"):
        trained = line_field.load_any(path)

    def of(
        images: Sequence[Path],
        n: int,
        seed: int,
        mask: Path | None,
        background: str,
        cameras: str | Path | Sequence[Any] | Mapping[str, Any] | None = None,
    ) -> Reconstruction:
        checks.require_whole("n", n, 2)
        if not images or (mask is not None and len(images) > 1):
            raise checks.InputError(f"{'a mask is of one picture' if images else 'no picture is given'}; give one")
        pictures = [cutouts.read(image, mask, background) for image in images]
        if isinstance(trained, line_field.TrainedImageDDF):
            told = None if cameras is None else given_cameras.read(cameras, images)
            found = several_images.reconstruct(trained, pictures, n, seed, told)
        elif len(pictures) > 1 or cameras is not None:
            raise checks.InputError(f"{path}: only models of train_ddf_image take several pictures, or cameras")
        else:
            found = one_image.reconstruct(trained, pictures[0], n, seed)
        return Reconstruction(found, n, path.name)

    return of


def generate(model: str | Path, n: int = 8, seed: int = 0) -> list[Field]:
    """New shapes, in the frame of ShapeNet's meshes (v1). Needs torch.

    Args:
      model: the name of a reconstruction model that `ddf models` lists (chair, plane, car), or a folder that stage
        train_ddf, train_vae or train_gan wrote.
      n: how many shapes, 1 or more.
      seed: the same seed gives the same shapes, and more of them begin with those of less.
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
    return [Field(found.decode(latent)) for latent in latents]
