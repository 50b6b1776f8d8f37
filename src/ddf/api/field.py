"""Fields of one shape: loading them, and what they can be asked for."""

import contextlib
import dataclasses
import importlib
import importlib.util
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast, overload

import numpy as np
import numpy.typing as npt
from jaxtyping import Bool, Float

from ddf.api import queries
from ddf.core import checks, config, extras, shipped_models, storage
from ddf.fields import framed_field
from ddf.geometry.mesh_io import Mesh

if TYPE_CHECKING:
    from ddf.fields import shape_field
    from ddf.fields.grid import patch_field
    from ddf.fit import fit_settings

    Weights = shape_field.ShapeField | patch_field.PatchField


class Field(queries.Queried):
    """A trained field of one shape. Everything is in the frame and the unit of the mesh that it was fitted to."""

    def __init__(self, framed: framed_field.FramedField, path: Path | None = None) -> None:
        super().__init__(framed)
        self.path = path  # its file or folder; None where there is none
        self.up = "y" if path is None else up_of(path)

    @property
    def weights(self) -> "Weights":
        """The patches or the network, which `points` needs."""
        if not hasattr(self.framed, "points"):
            raise checks.InputError("this needs the weights of the field; an ONNX file alone does not give them")
        return cast("Weights", self.framed)

    def __repr__(self) -> str:
        box = ", ".join(f"{low:.3g} to {high:.3g}" for low, high in zip(*self.box, strict=True))
        count = getattr(self.framed, "parameters", None)
        size = "" if count is None else f"; {count:,} parameters"
        place = "" if self.path is None else f"{self.path}; "
        return f"Field({place}{type(self.framed).__name__}; box {box}{size}; {', '.join(self.outputs)})"

    @overload
    def points(self, n: int, seed: int = 0, normals: Literal[False] = False) -> Float[np.ndarray, "n 3"]: ...

    @overload
    def points(
        self, n: int, seed: int = 0, *, normals: Literal[True]
    ) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]]: ...

    def points(self, n: int, seed: int = 0, normals: bool = False) -> Any:
        """A cloud of evenly spread points on the surface; of a network it needs torch.

        Args:
          n: how many points, 1 or more.
          seed: the same seed gives the same points.
          normals: whether these are wanted too.
        Returns:
          (n, 3), float64, in the frame and the unit of the mesh; with `normals` a pair, the second outward and unit, 0
          where the field sees nothing.
        Raises:
          ValueError: n is below 1, torch is not installed, or the field came from an ONNX file alone.

        Example:
          >>> import ddf
          >>> ddf.load("rabbit").points(100).shape
          (100, 3)
        """
        from ddf.fit import surfaces

        found = self.weights.points(checks.require_whole("n", n, 1), seed)
        return (found, surfaces.normals_at(self.framed, found)) if normals else found

    def seen(self, positions: npt.ArrayLike, directions: npt.ArrayLike) -> Bool[np.ndarray, "n"]:
        """Of a field that was fitted to rays: whether these saw all the way up to its answer, and what it meets.

        Args:
          positions, directions: as of `query`.
        Raises:
          ValueError: a wrong shape, or the field was not fitted to rays.
        """
        asked, own = queries.require_oriented_points(positions, directions), getattr(self.weights, "seen", None)
        if own is None:
            raise checks.InputError("only patches that were fitted to rays know what was seen")
        return own(asked.positions, asked.directions)

    def save(self, folder: str | Path) -> Path:
        """Write the field into a folder, which `ddf.load` and every command take; of a network it needs torch.

        Returns:
          Its file.
        Raises:
          ValueError: the field came from an ONNX file alone, or torch is not installed.
        """
        return self.weights.save(Path(folder))

    def export(self, path: str | Path) -> Path:
        """Write an ONNX file (.onnx) as `ddf export` does, or a page that renders the field live (.html) as `ddf view`.

        ONNX, and a network, need torch.

        Raises:
          ValueError: another suffix.
        """
        path = Path(path)
        if path.suffix.lower() not in (".onnx", ".html"):
            raise checks.InputError(f"{path}: must end in .onnx or .html")
        with tempfile.TemporaryDirectory() as folder:
            self.save(Path(folder) / path.stem)
            if path.suffix.lower() == ".html":
                from ddf.io import viewer_page

                shape = viewer_page.field(Path(folder) / path.stem)
                viewer_page.write(path, viewer_page.field_page(shape, path.stem, self.up))
            else:
                with extras.named():
                    from ddf.io import onnx_file
                graphs, source = onnx_file.load_graphs(Path(folder) / path.stem, None)
                onnx_file.export(graphs["field"], "field", path, source, onnx_file.ExportConfig())
        return path

    def view(self) -> Path:
        """Open a page that renders the field live in the browser; its file, which is temporary."""
        import webbrowser

        path = self.export(Path(tempfile.mkdtemp(prefix="ddf-view-")) / "field.html")
        webbrowser.open(path.as_uri())
        return path

    def surface(self, n: int = 5000, method: Literal["udf", "closed", "poisson"] = "udf", resolution: int = 64) -> Mesh:
        """A triangle mesh of the surface. `poisson` needs Open3D.

        Args:
          n: points with normals that `poisson` goes through; they are some of those that `udf` measures to.
          method: `udf`, surface nets of unsigned distances, keeps open and inner sheets; `closed` is what looks
            from all sides leave, watertight, hollows full; `poisson`, screened Poisson, is smooth and wants an outer
            side.
          resolution: cells of `closed` and `udf` along the longest side of the box.
        Returns:
          `.vertices` (k, 3) float64 in the frame and the unit of the mesh, `.faces` (m, 3), `.save(path)`; open where
          the field has no points, but with `closed`.
        Raises:
          ValueError: the field sees no surface, the method is another word, or Open3D is not installed.

        Example:
          >>> import ddf
          >>> mesh = ddf.load("rabbit").surface(resolution=32)
          >>> mesh.vertices.shape[1], len(mesh.faces) > 100
          (3, True)
        """
        from ddf.fit import surfaces

        if method not in surfaces.METHODS:
            raise checks.InputError(f"method must be one of {', '.join(surfaces.METHODS)}; got {method!r}")
        sizes = checks.require_whole("n", n, 1), checks.require_whole("resolution", resolution, 2)
        if method == "closed":
            return surfaces.closed(self.framed, sizes[1])
        with extras.named():
            if method == "poisson":
                importlib.import_module("open3d")  # before the cloud is drawn, which takes seconds
            return surfaces.extract(self.framed, self.cloud, method, *sizes)


def up_of(path: Path) -> Literal["y", "z"]:
    """The axis that points up, as `ddf fit --up` was told for the field in a file or a folder; else y."""
    from ddf.fit import fit_folder

    file = (path if path.is_dir() else path.parent) / fit_folder.METRICS
    return "z" if file.is_file() and storage.read_json(file).get("up") == "z" else "y"


def load(path_or_name: str | Path) -> Field:
    """A trained field.

    Args:
      path_or_name: the folder that `ddf fit` wrote, or its model.safetensors (a network needs torch); an ONNX file that
        `ddf export` wrote, which needs onnxruntime; or the name of a field that `ddf models` lists.
    Returns:
      The field; it answers in the frame of the mesh that it was fitted to.
    Raises:
      FileNotFoundError: there is no such file, folder or name.
      ValueError: the file is damaged, holds something else, or needs a package that is not installed.

    Example:
      >>> import ddf
      >>> ddf.load("rabbit").outputs[:3]
      ('visibility', 'depth', 'normals')
    """
    from ddf.fields import stored_fields

    path = shipped_models.require(path_or_name, "field")
    if path.suffix == ".onnx" and path.is_file():
        if importlib.util.find_spec("onnxruntime") is None:
            raise checks.InputError(f"{path}: an ONNX file needs onnxruntime: {extras.command('onnx')}")
        from ddf.io import onnx_field

        return Field(onnx_field.load(path), path)
    if path.is_file() and path.suffix != ".safetensors":
        raise checks.InputError(
            f"{path}: is no field: give a folder that ddf fit wrote, its model.safetensors, or .onnx"
        )
    with extras.named():
        return Field(stored_fields.load(path), path)


def fit(
    mesh: Any = None,
    minutes: int | float | None = None,
    steps: int | None = None,
    out: str | Path | None = None,
    kind: Literal["patches", "sine"] | None = None,
    tolerance: float | None = None,
    rays: Any = None,
) -> Field:
    """Fit a field to a mesh, or to what a sensor saw, as `ddf fit` does; a network needs torch.

    Args:
      mesh: what `read_mesh` gives, a path, or anything with `vertices` (n, 3) and `faces` (m, 3).
      kind: `patches`, small curved pieces in an octree, in seconds; `sine`, the paper's network, the default where an
        option of it is given.
      minutes: of sine: wall time of sampling and training, which the schedule follows; 2 if nothing is said.
      steps: of sine: number of steps instead, the reproducible way.
      out: folder that keeps the field, its log and its errors; a stopped fit goes on there. None keeps no files.
      tolerance: of patches: wanted distance to the mesh, of half its longest side; 3e-4 if nothing is said, more of
        noisy rays.
      rays: in place of a mesh: a scan, such as `depth_camera` gives, or a path as of `ddf fit`, or a list of them.
        `Field.seen` of patches says what they saw.
    Returns:
      The field, in the frame and the unit of the mesh; its `path` is `out`.
    Raises:
      ValueError: the mesh has no triangle with an area, budgets contradict each other or the kind, or a package is not
        installed.

    Example:
      >>> import ddf, types
      >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
      >>> faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
      >>> field = ddf.fit(types.SimpleNamespace(vertices=corners, faces=faces))  # doctest: +SKIP
    """
    if kind not in ("patches", "sine", None):
        raise checks.InputError(f"kind must be patches or sine; got {kind!r}")
    network = kind == "sine" or (minutes, steps) != (None, None)
    if network and tolerance is not None:
        raise checks.InputError("tolerance is of kind patches")
    if kind == "patches" and network:
        raise checks.InputError("patches take neither minutes nor steps; they are of kind sine")
    if steps is not None:
        checks.require_whole("steps", steps, 1)
    if minutes is not None and steps is not None:
        raise checks.InputError(f"a fit takes minutes or steps; got both, {minutes} and {steps}")
    from ddf.api import meshes
    from ddf.fields import stored_fields
    from ddf.fields.grid import octree
    from ddf.fit import fit_folder, patch_fitting
    from ddf.geometry import posed_depth, scans

    given = [] if rays is None else list(rays) if isinstance(rays, list | tuple) else [rays]
    if (mesh is None) == (not given):
        raise checks.InputError("a field is fitted to a mesh or to rays")
    with tempfile.TemporaryDirectory() if out is None else contextlib.nullcontext(out) as folder:
        read = [
            posed_depth.Sensed(each, "a scan", 1) if isinstance(each, scans.Scan) else posed_depth.read(Path(each))
            for each in given
        ]
        found = posed_depth.together(read) if read else None
        if network:
            settings = network_settings(minutes, steps)
            from ddf.fit import fitting

            if found is not None:
                found.require_sensed()
            fitting.fit(meshes.as_mesh(mesh) if found is None else found.scan, settings, Path(folder))
        elif found is not None:
            patch_fitting.fit_rays(found.scan, tolerance, Path(folder), sensed=found.sensed)
        else:
            patches = octree.PatchConfig.within(None if tolerance is None else float(tolerance))
            patch_fitting.fit(meshes.as_mesh(mesh), patches, Path(folder))
        if out is not None and given and not any(isinstance(each, scans.Scan) for each in given):
            told = Path(out) / fit_folder.METRICS  # as `ddf fit` does, for --onto
            paths = posed_depth.seen_from(Path(out), [Path(each) for each in given])
            storage.write_json(told, storage.read_json(told) | {"rays": paths})
        shape = stored_fields.load(Path(folder))
    return Field(shape, None if out is None else Path(out))


def network_settings(
    minutes: float | None, steps: int | None, config_file: str | None = None
) -> "fit_settings.FitConfig":
    """Settings of `sine`, of a file or its name where one is given, with another budget."""
    with extras.named():
        from ddf.fit import fit_settings
    settings = fit_settings.FitConfig()
    if config_file is not None:
        settings = config.load(config.found_file(config_file), "fit", fit_settings.FitConfig)
    if minutes is not None:
        return dataclasses.replace(settings, minutes=float(minutes), steps=None)
    return settings if steps is None else dataclasses.replace(settings, steps=int(steps), minutes=None)
