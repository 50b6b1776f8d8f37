"""Commands that show fields: pictures of one field or of a scene, and the page that renders them live."""

import argparse
import dataclasses
import tempfile
import time
import webbrowser
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, cast

from ddf.cli import arguments, results
from ddf.cli.arguments import CameraOption, FieldPath, ImageOutputs, PictureOutputs
from ddf.cli.declare import Arg, command
from ddf.core import errors, shipped_models
from ddf.fields import field_outputs

if TYPE_CHECKING:
    import numpy as np

    from ddf.api import scene as scenes
    from ddf.fields import scene_field
    from ddf.io import viewer_page

_FRAME_MS = 80
_PAGE = ".html"
_NAMED = 4  # fields of a title
_MODELS = ("ddf", "ddf_image")  # kinds of files of models that make a field of a picture
_TAKEN = (".png", ".webp", ".jpg", ".jpeg", ".gif")  # pictures
_SAMPLE = "sample_0.png"  # beside a model


@command("field", api="queries:render")
def render(
    field: FieldPath,
    out: Annotated[Path, Arg("OUT", writes="file")],
    *,
    camera: CameraOption = arguments.FirstCamera,
    size: Annotated[int, Arg("N", parse=arguments.whole_number(1, 8192))] = 256,
    outputs: PictureOutputs = None,
    turn: Annotated[int | None, Arg("N", parse=arguments.whole_number(2, 360))] = None,
    bits: Literal[8, 16] = 8,
    ao: Annotated[int | None, Arg("N", parse=arguments.whole_number(1, 1024))] = None,
    up: arguments.Up | None = None,
) -> dict[str, Any]:
    """A picture, or the arrays, of what a camera sees of a field.

    The file's suffix says what is written.

    | file | holds |
    | --- | --- |
    | `.png`, `.webp` | a shaded picture, or one output by `--output`; `--turn 36`: a shaded one that turns |
    | `.png` with `--bits 16` | depth = value × step, 0 where nothing is seen; the step is printed and in the file |
    | `.npz`, `.exr` | the arrays of all outputs that `--output` names; in EXR float32 channels |

    Shadows are asked of the field. Most pixels take two rays at most; outlines, creases and edges of shadows up to 20.
    `--ao N` adds N to each sample on the object. `evaluated`: rays asked; `saved`: those of all samples less these.
    Without a distance a shaded picture frames the object and its shadow (`window`: left, top, side, of the camera's
    frame); with `--camera 35,25,0.7` it has the camera's frame, as outputs have.

    Args:
      out: .png, .webp, .npz, .exr: a picture of one output, or the numbers of several (npz, exr).
      turn: a shaded picture that moves: N around the field.
      bits: 16: a PNG of depth holds the numbers, depth = value x step, 0 where nothing is seen (default 8: colours).
      ao: of a shaded picture: ambient occlusion by so many rays, 32 say.
      up: axis that points up (default: what `ddf fit --up` was told, else y).

    Examples:
      ddf render rabbit rabbit.png
      ddf render rabbit turn.webp --turn 36
      ddf render armchair armchair.png --ao 32
      ddf render rabbit normals.webp --output normals --camera -30,20 --size 512
      ddf render rabbit seen.npz --output visibility,depth,normals
      ddf render rabbit depth16.png --bits 16
    """
    suffix = out.suffix.lower()
    if (camera[2] or 0) < 0:
        raise errors.InputError(f"--camera: the distance must be 0 or more; got {camera[2]:g}")
    if outputs is None:
        numbers = suffix not in results.PICTURES or bits == 16
        outputs = ("depth",) if numbers else (arguments.SHADED,)
    _require_holds(out, suffix, outputs, {"turn": turn, "ao": ao}, bits)
    up = up or _up_of(field)
    if outputs == (arguments.SHADED,):
        return _shaded(field, out, camera, size, turn, ao or 0, up)
    from ddf.api import field as fields
    from ddf.fields import framed_field

    shape = fields.load(field).framed
    if lacking := ", ".join(name for name in outputs if name not in shape.outputs):
        components = "patches have one component, networks two: weight_1, normals_1, normals_2"
        raise errors.InputError(f"{field}: has no {lacking} ({components}); it has {', '.join(shape.outputs)}")
    azimuth, elevation, radius = camera
    if radius is None:
        radius = framed_field.framing_radius(shape, azimuth, elevation, up)
    started = time.monotonic()
    images, evaluated = framed_field.render(shape, (azimuth, elevation, radius), size, {"visibility", *outputs}, up)
    seconds = time.monotonic() - started
    drawn = {name: images[name] for name in outputs}
    seen = images["visibility"] >= framed_field.SEEN
    ranges = {name: _range(values, seen) | {"unit": field_outputs.OUTPUTS[name].unit} for name, values in drawn.items()}
    step = _write(out, suffix, bits, drawn, images)
    found = _told(out, f"{size} x {size}", (azimuth, elevation, radius), size**2, seen.mean(), evaluated, seconds)
    if step is not None:
        found["depth_step"] = step
        found["verdict"] += f"; depth = value x {step:.6g}, 0 where nothing is seen"
    rows = [(name, *found.values()) for name, found in ranges.items()]
    table = results.grid(("output", "least", "largest", "unit"), rows)
    return {"output": ",".join(outputs), "range": ranges, "saved": size**2 - evaluated, **found, "table": table}


def _up_of(field: Path) -> arguments.Up:
    """What `ddf fit --up` was told."""
    from ddf.core import storage
    from ddf.fit import fit_folder

    file = field / fit_folder.METRICS
    return "z" if file.is_file() and storage.read_json(file).get("up") == "z" else "y"


def _told(
    out: Path, size: str, camera: arguments.Camera, pixels: int, seen: float, evaluated: int, seconds: float
) -> dict[str, Any]:
    """What is said of pictures of a field; `seen`: the share of pixels."""
    azimuth, elevation, radius = camera
    hint = "" if seen else "; NOTHING is seen: give another --camera, or none"
    return {
        "camera": {"azimuth_deg": azimuth, "elevation_deg": elevation, "radius": radius},
        "pixels": pixels,
        "evaluated": evaluated,
        "seen": round(seen * pixels),
        "seconds": round(seconds, 4),
        "verdict": f"{out}: {size} pixels, {seen:.0%} of them see the object from {azimuth:g},{elevation:g},"
        f"{radius:.6g}; {evaluated:,} rays in {seconds:.2f} s{hint}",
    }


def _require_holds(out: Path, suffix: str, outputs: tuple[str, ...], of_shaded: Mapping[str, Any], bits: int) -> None:
    pictures, shaded = results.PICTURES, outputs == (arguments.SHADED,)
    if suffix not in (*pictures, *results.ARRAYS):
        raise errors.InputError(f"{out}: must end in one of {', '.join((*pictures, *results.ARRAYS))}")
    if shaded and suffix not in pictures:
        raise errors.InputError(f"{out}: {arguments.SHADED} is a picture: {', '.join(pictures)}")
    wrong = [name for name, value in of_shaded.items() if value is not None and not shaded]
    if wrong:
        raise errors.InputError(f"--{wrong[0]} goes with --output {arguments.SHADED}; got {','.join(outputs)}")
    if suffix in pictures and len(outputs) > 1:
        raise errors.InputError(f"{out}: a picture shows one output, .npz and .exr hold {len(outputs)}")
    if bits == 16 and (suffix != ".png" or outputs != ("depth",)):
        raise errors.InputError("--bits 16 is for the depth in a .png; .npz and .exr hold numbers of any output")


def _shaded(
    field: Path, out: Path, camera: arguments.Camera, size: int, turn: int | None, ao: int, up: arguments.Up
) -> dict[str, Any]:
    import numpy as np

    from ddf.api import field as fields
    from ddf.core import storage
    from ddf.fields import framed_field, scene_field
    from ddf.pictures import shaded

    shape = scene_field.Counted(fields.load(field).framed)
    azimuth, elevation, radius = camera
    turned = [azimuth + 360.0 * i / (turn or 1) for i in range(turn or 1)]
    framed = radius is None
    far = max(framed_field.framing_radius(shape, each, elevation, up) for each in turned) if framed else radius
    started = time.monotonic()
    seen_by, standing = [(each, elevation, far) for each in turned], shaded.stand(shape, up)
    shown = shaded.window(standing, seen_by) if framed else shaded.WHOLE
    frames = [shaded.render(standing, each, size, shown, sky=ao) for each in seen_by]
    seconds = time.monotonic() - started
    pictures = [frame.picture for frame in frames]
    storage.write_bytes(out, results.encode(pictures, out.suffix.lower(), _FRAME_MS))
    pixels, seen = len(frames) * size**2, float(np.mean([frame.seen for frame in frames]))
    told = f"{len(frames)} x {size} x {size}" if turn else f"{size} x {size}"
    found = _told(out, told, (azimuth, elevation, far), pixels, seen, shape.queries, seconds)
    saved = max(0, (2 + ao) * shaded.MOST_SAMPLES * pixels - shape.queries)
    own = "the camera's own frame"
    around = f"around the object and its shadow; --camera {azimuth:g},{elevation:g},{far:.6g} gives {own}"
    table = {"picture": own if shown == shaded.WHOLE else around, "rays asked": shape.queries, "rays saved": saved}
    return {"output": arguments.SHADED, "frames": len(frames), "window": shown, "saved": saved, **found, "table": table}


def _range(values: "np.ndarray", seen: "np.ndarray") -> dict[str, float]:
    """Least and largest of what is seen; NaN where nothing is."""
    known = values[seen]
    if not known.size:
        return {"min": float("nan"), "max": float("nan")}
    return {"min": float(known.min()), "max": float(known.max())}


def _write(
    out: Path, suffix: str, bits: int, drawn: "Mapping[str, np.ndarray]", images: "dict[str, np.ndarray]"
) -> float | None:
    """Write the file; the step of a depth of 16 bits."""
    from ddf.core import storage

    if suffix == ".exr":
        results.write_exr(out, drawn)
    elif suffix == ".npz":
        storage.write_bytes(out, results.npz(drawn))
    elif bits == 16:
        data, step = results.depth_png(drawn["depth"])
        storage.write_bytes(out, data)
        return step
    else:
        from ddf.pictures import field_pictures

        (name,) = drawn
        storage.write_bytes(out, results.encode([field_pictures.picture(name, images)], suffix))
    return None


class _Shown(argparse.Action):
    """What is shown, and the file to write: a last word that ends in .html."""

    def __call__(self, _parser: Any, namespace: argparse.Namespace, values: Any, _option: str | None = None) -> None:
        *words, last = values
        namespace.out = Path(last) if words and Path(last).suffix.lower() == _PAGE else None
        namespace.what = [shipped_models.place(word) for word in (values if namespace.out is None else words)]


@command("field")
def view(
    what: Annotated[list[Path], Arg("FIELD_or_SCENE_or_MODEL", parse=str, action=_Shown)],
    *,
    out: Annotated[Path | None, Arg(writes="file", undeclared=True)] = None,
    up: arguments.Up | None = None,
) -> dict[str, Any]:
    """A page that renders a field live, as one file that any browser opens.

    It shows a field, fields side by side, a scene, or what a model makes of a picture: [the page](viewer.md).

    Args:
      what: folder that `ddf fit` or `make train` wrote, a name that `ddf models` lists, or a scene file; pictures stand
        before their model, which takes its own sample without; several fields stand side by side; last, OUT.html: file
        to write (without it a temporary one is written and opened in the browser).
      up: axis of fields that points up (default: what `ddf fit --up` was told of the first one, else y).

    Examples:
      ddf view rabbit rabbit.html
      ddf view rabbit
      ddf view rabbit armchair airliner row.html
      ddf view scene.yaml scene.html
      ddf view chair chair.html
      ddf view chair_model/sample_1.png chair page.html
    """
    from ddf.io import viewer_page

    page = page_of(what, up or _up_of(what[0]))
    path = out or Path(tempfile.mkdtemp(prefix="ddf-view-")) / f"{page.title}.html"
    size = viewer_page.write(path, page)
    opened = out is None and webbrowser.open(path.as_uri())
    hint = "opened in the browser" if opened else "open it in any browser; it needs no server and no network"
    return {
        "out": path.as_posix(),
        "bytes": size,
        "fields": [field.record["name"] for field in page.fields],
        "opened": opened,
        "verdict": f"{path}: {size:,} bytes; {hint}",
    }


def page_of(what: Sequence[Path], up: str = "y") -> "viewer_page.Page":
    """The page of a field, of a scene file, or of what a model makes of a picture; of several side by side. InputError
    where what must stand alone does not.
    """
    from ddf.api import field as fields
    from ddf.api import scene as scenes
    from ddf.fields import field_file
    from ddf.io import viewer_page

    files = [path for path in what if path.suffix in scenes.SUFFIXES]
    if files and len(what) == 1:
        return _scene_page(files[0])
    if files:
        raise errors.InputError(f"{files[0]}: a scene file is shown alone; it may name all fields")
    missing = next((path for path in what if len(what) > 1 and not path.exists()), None)
    if missing is not None:
        raise FileNotFoundError(f"{missing}: no such field; a file to write must end in .html")
    shown = list(_shown(what))
    if len(shown) > 1:
        title = ", ".join(name for name, _, _ in shown) if len(shown) <= _NAMED else f"{len(shown)} fields"
        return viewer_page.side_by_side(title, [(name, shape) for name, shape, _ in shown], up)
    ((name, shape, about),) = shown
    page = viewer_page.field_page(shape, name, up, about)
    framed = fields.load(shape.file).framed if isinstance(shape, field_file.FieldFile) else shape
    return dataclasses.replace(page, first=viewer_page.first(framed, page.azimuth, up))


def _shown(what: Sequence[Path]) -> "Iterator[tuple[str, viewer_page.Shape, str]]":
    """Name, field and a sentence of each; of a model what it makes of the pictures before it, or of its own sample."""
    from ddf.core import storage
    from ddf.fields import field_file
    from ddf.io import viewer_page

    known: dict[Path, viewer_page.Shape] = {}
    pictures: list[Path] = []
    for path in what:
        file = field_file.file_of(path)
        if path.suffix.lower() in _TAKEN:
            pictures.append(path)
        elif file.is_file() and storage.load_metadata(file).get("kind") in _MODELS:
            yield from (_reconstructed(picture, file.parent) for picture in pictures or [file.parent / _SAMPLE])
            pictures = []
        else:
            known[path] = known.get(path) or viewer_page.field(path)
            yield viewer_page.name_of(path), known[path], viewer_page.ABOUT
    if pictures:
        raise errors.InputError(f"{pictures[0]}: a picture stands before the model that makes a field of it")


def _reconstructed(picture: Path, model: Path) -> "tuple[str, viewer_page.Shape, str]":
    """The patches that a model makes of a picture."""
    from ddf.api import reconstruction

    if not picture.is_file():
        raise errors.InputError(f"{model}: has no {_SAMPLE}; give a picture before it: ddf view IMAGE.png {model}")
    found = reconstruction.reconstruct(picture, model)
    about = f"What the model {found.kind} makes of {picture.name}: {found.verdict}."
    name = found.kind if picture.parent == model else picture.stem
    return name, cast("viewer_page.Shape", found.field.framed), about


def _scene_page(file: Path) -> "viewer_page.Page":
    """The page of a scene file; a field that it names several times is in the page once."""
    from ddf.api import scene as scenes
    from ddf.io import viewer_page

    content = scenes.read_content(file)
    scene = scenes.build(content, file.parent).framed
    baked = {}
    for name in {placement.field for placement in content.objects}:
        folder = shipped_models.place(scenes.field_beside(file.parent, name))
        baked[name] = viewer_page.bake(viewer_page.field(folder), viewer_page.name_of(folder))
    fields = [viewer_page.placed(baked[placement.field], placement.similarity()) for placement in content.objects]
    page = viewer_page.scene_page(file.stem, fields, scene.lower, scene.upper, content.up, content.box is not None)
    if page.box is not None:  # the page cuts the box open
        return page
    return dataclasses.replace(page, first=viewer_page.first(scene, page.azimuth, content.up))


@command("field", api="queries:render")
def scene(
    scene: Annotated[Path, Arg("SCENE.yaml")],
    out: Annotated[Path, Arg("OUT", writes="file")],
    *,
    camera: CameraOption = arguments.FirstCamera,
    path: Literal["orbit", "fly"] | None = None,
    frames: Annotated[int, Arg("N", parse=arguments.whole_number(2, 1000))] = 24,
    size: Annotated[int, Arg("N", parse=arguments.whole_number(1, 2048))] = 256,
    outputs: ImageOutputs = ("depth",),
) -> dict[str, Any]:
    """Several fields in one scene, from one camera or along a path.

    The [scene file](formats.md#scene-files) lists them. A field is asked for the rays that meet its box alone. A path
    gives moving pictures, or arrays with an axis of frames.

    Args:
      scene: fields and where they stand: docs/formats.md.
      out: .png, .webp, .npz: pictures of one output, moving on a path; or the numbers.
      path: orbit: once around the box; fly: along the waypoints of the file, or straight in.
      frames: of a path.

    Examples:
      ddf scene scene.yaml scene.png
      ddf scene scene.yaml normals.webp --output normals --path fly --frames 48
      ddf scene scene.yaml around.npz --output visibility,depth,normals --path orbit --frames 8
    """
    import numpy as np

    from ddf.api import scene as scenes
    from ddf.core import storage
    from ddf.fields import framed_field, scene_field
    from ddf.geometry import rays

    suffix, known = out.suffix.lower(), (*results.PICTURES, ".npz")
    if suffix not in known:
        raise errors.InputError(f"{out}: must end in one of {', '.join(known)}")
    if suffix in results.PICTURES and len(outputs) > 1:
        raise errors.InputError(f"{out}: pictures show one output, .npz holds {len(outputs)}")
    content = scenes.read_content(scene)
    whole = scenes.build(content, scene.parent).framed
    assert isinstance(whole, scene_field.SceneField)
    counted = {id(each): scene_field.Counted(each) for each in whole.fields}
    shown = dataclasses.replace(whole, fields=tuple(counted[id(each)] for each in whole.fields))
    looks = _cameras(shown, content, camera, path, frames)
    started = time.monotonic()
    seen: list[dict[str, np.ndarray]] = []
    for look in looks:
        asked = rays.OrientedPoints(*look.rays(size, content.up))
        found, _ = framed_field.query(shown, asked, {"visibility", *outputs})
        seen.append({name: values.reshape(size, size, *values.shape[1:]) for name, values in found.items()})
    seconds = time.monotonic() - started
    stacked = {name: np.stack([frame[name] for frame in seen]) for name in seen[0]}
    if suffix == ".npz":
        arrays = {name: stacked[name] if path else stacked[name][0] for name in outputs}
        storage.write_bytes(out, results.npz(arrays))
    else:
        storage.write_bytes(out, results.encode(_pictures(next(iter(outputs)), stacked), suffix, _FRAME_MS))
    pixels, queries = size**2 * len(looks), sum(field.queries for field in counted.values())
    saved = pixels * len(whole.fields) - queries  # of every object asked once for every pixel
    return {
        "objects": len(whole.fields),
        "frames": len(looks),
        "pixels": pixels,
        "queries": queries,
        "queries_per_pixel": queries / pixels,
        "saved": saved,
        "seen": float((stacked["visibility"] >= 0.5).mean()),
        "seconds": round(seconds, 4),
        "verdict": f"{out}: {len(looks)} x {size} x {size} pixels of {len(whole.fields)} objects; "
        f"{queries / pixels:.3g} queries a pixel; the boxes saved {saved:,} of {saved + queries:,}",
    }


def _cameras(
    field: "scene_field.SceneField",
    content: "scenes.SceneFile",
    camera: arguments.Camera,
    path: str | None,
    frames: int,
) -> "list[scene_field.LookAt]":
    from ddf.fields import framed_field, scene_field

    azimuth, elevation, radius = camera
    if path == "orbit":
        return scene_field.orbit(field, azimuth, elevation, radius, frames, content.up)
    if path == "fly" and content.fly:
        return scene_field.fly([waypoint.look_at() for waypoint in content.fly], frames)
    if radius is None:
        radius = framed_field.framing_radius(field, azimuth, elevation, content.up)
    first = scene_field.one(field, azimuth, elevation, radius, content.up)
    return scene_field.fly(scene_field.straight_in(field, first), frames) if path == "fly" else [first]


def _pictures(name: str, stacked: "dict[str, np.ndarray]") -> "list[np.ndarray]":
    from ddf.pictures import field_pictures

    if name == "depth":
        return field_pictures.depth_pictures(*stacked["depth"])
    frames = range(len(stacked["visibility"]))
    return [field_pictures.picture(name, {key: values[i] for key, values in stacked.items()}) for i in frames]
