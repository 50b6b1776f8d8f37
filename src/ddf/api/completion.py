"""From what a depth camera or a lidar saw of an object to the whole of it, and where it stands."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from jaxtyping import Bool, Float

from ddf.api import queries
from ddf.api.field import Field
from ddf.core import checks, extras, shipped_models
from ddf.geometry import scans, transforms

_UPS = {"y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0), "-y": (0.0, -1.0, 0.0)}
_EXPLAINED, _LIKELY = 0.5, 0.3  # under which a scan is warned of; chosen on validation scans


@dataclasses.dataclass(frozen=True)
class Completion:
    """The whole of an object, in the frame and the unit of its scan.

    points: (n, 3), on its surface. seen: (n), whether a hit of the scan is near; the rest is inferred. spread: (n),
    standard deviation of where the surface is. pose: (4, 4), from the frame of the model, where the shape fills the
    cube [-1, 1]³ with Y up, to that of the scan. residuals: of each ray of the scan, its range less that of the field,
    NaN where one of both met nothing. explained: share of the hits that the field is near to. likeness: the probability
    that the object is of the model's kind.
    """

    field: Field
    points: Float[np.ndarray, "n 3"]
    seen: Bool[np.ndarray, "n"]
    spread: Float[np.ndarray, "n"]
    pose: Float[np.ndarray, "4 4"]
    residuals: Float[np.ndarray, "m"]
    explained: float
    likeness: float
    _network: Any = dataclasses.field(repr=False)
    _found: Any = dataclasses.field(repr=False)

    @property
    def unlike(self) -> bool:
        """Whether a warning is due: perhaps the object is not of the model's kind, or its pose or unit is another."""
        return self.explained < _EXPLAINED or self.likeness < _LIKELY

    def save(self, folder: str | Path) -> None:
        """The field as a file of a folder that is made if needed: `ddf.load` reads it."""
        self.field.save(folder)

    def interval(
        self, positions: npt.ArrayLike, directions: npt.ArrayLike, share: float = 0.9
    ) -> tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n"]]:
        """Between which depths other rays meet the surface with that probability, if they meet it.

        Args:
          positions, directions: (n, 3), frame of the scan; directions of length 1. share: in (0, 1).
        Returns:
          Lower and upper depth, NaN where the ray misses the model's cube.
        Raises:
          ValueError: a wrong shape, or a share that is none.
        """
        from ddf.fit import completed_surface

        if not 0 < share < 1:
            raise checks.InputError(f"share must be in (0, 1); got {share}")
        asked = queries.require_oriented_points(positions, directions)
        return completed_surface.along_rays(self._network, self._found, asked.positions, asked.directions, share)


def complete(
    scan: str | Path | scans.Scan,
    model: str | Path,
    pose: npt.ArrayLike | None = None,
    *,
    refine: bool = True,
    up: str | None = None,
    noise: float = 0.0,
    image: str | Path | None = None,
    n: int = 5000,
    seed: int = 0,
) -> Completion:
    """The whole object of a scan, by the field of a trained model: shape and, where it is not known, pose. Needs torch.

    Args:
      scan: an NPZ file of rays with ranges, a depth image or points with their sensors, or a depth image as PNG
        (docs/complete.md), or what `ddf.lidar` and `ddf.depth_camera` give.
      model: trained DDF, as of `reconstruct`: the category of the object.
      pose: 4x4, where its box lies: turns the model's axes (X ahead, Y up) to the scan's, scales by half the longest
        side, moves to the middle. None: all hits are of the object, which stands upright.
      refine: whether the pose may move, which is then off by 15 degrees and a tenth of half the longest side
        (deviations); without a pose it always may.
      up: without a pose, the axis of the scan's frame that points up: y, z or -y. None: y, or of a depth image in its
        camera's own frame what is up before a camera that looks level or down.
      noise: standard deviation of a range, unit of the scan.
      image: an RGBA picture of the object, from any side, that starts the search too.
      n: points of the cloud, 2 or more.
      seed: the same seed gives the same shape.
    Raises:
      FileNotFoundError: there is no such file.
      ValueError: the scan, the pose or the model is of another kind, too few rays end in the box, or torch is not
        installed.

    Example:
      >>> import ddf
      >>> from ddf.core import shipped_models
      >>> image = shipped_models.ROOT / "chair" / "sample_0.png"
      >>> chair = ddf.reconstruct(image, "chair", n=100).field
      >>> scan = ddf.depth_camera(chair, size=32)
      >>> found = ddf.complete(scan, "chair", n=100)
      >>> found.points.shape, found.pose.shape
      ((100, 3), (4, 4))
    """
    given = scan if isinstance(scan, scans.Scan) else scans.read(Path(scan))
    if checks.require_whole("n", n, 2) and not 0 <= noise < np.inf:
        raise checks.InputError(f"noise must be 0 or more, in the unit of the scan; got {noise}")
    if up is not None and up not in _UPS:
        raise checks.InputError(f"up must be one of {', '.join(_UPS)}; got {up!r}")
    place = None if pose is None else transforms.Similarity.of_matrix("pose", pose)
    with extras.named():
        from ddf.data import cutouts
        from ddf.fit import completed_surface, completion, latent_prior
        from ddf.reconstruction import one_image
    folder = shipped_models.require(model, "reconstruction")
    folder = folder if folder.is_dir() else folder.parent
    decoder, prior, encoder = latent_prior.load(folder)
    latent = None
    if image is not None:
        if encoder is None:
            raise checks.InputError(f"{image}: {folder} has no encoder of shape latents; complete the scan without it")
        latent = one_image.latent(encoder, cutouts.read(Path(image)))
    config = completion.CompletionConfig()
    doubt = completion.Doubt() if refine else None
    if place is None:
        looked_at = up is None and given.of_camera
        doubt = completion.LOOKED_AT if looked_at else completion.UPRIGHT
        place = completion.guess(given, None if looked_at else np.array(_UPS[up or "y"]))
    found = completion.complete(decoder, prior.widest(config.axes), given, place, doubt, noise, config, latent, seed)
    cloud = completed_surface.cloud(decoder.field, found, given, n, seed)
    shape = completed_surface.field(decoder.field, found)
    return Completion(
        Field(shape),
        cloud.points,
        cloud.seen,
        cloud.spread,
        found.scan_from_field.to_matrix(),
        found.residuals,
        found.explained,
        found.likeness,
        decoder.field,
        found,
    )


def recover_pose(
    field: Field,
    scan: str | Path | scans.Scan,
    start: npt.ArrayLike,
    *,
    resize: bool = False,
    noise: float = 0.0,
    seed: int = 0,
) -> Float[np.ndarray, "*k 4 4"]:
    """Where an object stands in a scan, by descent through its field from a rough pose. Needs torch.

    Args:
      field: of the object, by its own file: an ONNX file alone has no gradients.
      scan: as of `complete`. Hits far from the object are left out.
      start: 4x4, from the frame of the field to that of the scan; (k, 4, 4) of as many such objects in it.
      resize: whether the scale may change too.
      noise: standard deviation of a range, unit of the scan.
      seed: the same seed gives the same pose.
    Returns:
      4x4, from the frame of the field to that of the scan, or (k, 4, 4).
    Raises:
      FileNotFoundError: there is no such scan.
      ValueError: the scan, the start or the field is of another kind, or too few rays end near the object.

    Example:
      >>> import ddf, numpy as np
      >>> rabbit = ddf.load("rabbit")
      >>> start = np.eye(4)
      >>> start[0, 3] = 0.1
      >>> found = ddf.recover_pose(rabbit, ddf.depth_camera(rabbit, size=32), start)
      >>> bool(abs(found - np.eye(4)).max() < 0.02)
      True
    """
    if not 0 <= noise < np.inf:
        raise checks.InputError(f"noise must be 0 or more, in the unit of the scan; got {noise}")
    given = scan if isinstance(scan, scans.Scan) else scans.read(Path(scan))
    places = queries.require_poses("start", start)
    with extras.named():
        from ddf.fit import completion
    shape = field.weights
    doubt = completion.Doubt(growth=completion.Doubt.growth if resize else 0.0, anyhow=True)
    several = [place.compose(shape.field_from_mesh.inverse()) for place in places]
    found = completion.find(shape, given, several, doubt, noise, seed)
    matrices = np.stack([each.compose(shape.field_from_mesh).to_matrix() for each in found])
    return matrices if np.ndim(start) == 3 else matrices[0]
