"""Commands that show fields: pictures of one field or of a scene, and the page that renders them live."""

import argparse
import dataclasses
import importlib.util
import tempfile
import time
import webbrowser
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple, cast

from ddf.cli import arguments, results
from ddf.cli.arguments import CameraOption, PictureOutputs, ShownPath
from ddf.cli.declare import Arg, command
from ddf.core import errors, shipped_models
from ddf.fields import field_outputs

if TYPE_CHECKING:
    import numpy as np

    from ddf.fields import framed_field, scene_field
    from ddf.io import viewer_page

_FRAME_MS = 80
_MOST_PIXELS = 2**26  # of all frames
_PAGE = ".html"
_NAMED = 4  # fields of a title
_MODELS = ("ddf", "ddf_image")  # kinds of files of models that make a field of a picture
_TAKEN = (".png", ".webp", ".jpg", ".jpeg", ".gif", ".bmp")  # pictures
_SAMPLE = "sample_0.png"  # beside a model
_OF_TWO = ("weight_1", "normals_1", "normals_2")  # outputs of two components


@command("field", api="queries:render")
def render(
    field: ShownPath,
    out: Annotated[Path, Arg("OUT", writes="file")],
    *,
    camera: CameraOption = arguments.FirstCamera,
    size: Annotated[int, Arg("N", parse=arguments.whole_number(1, 8192))] = 256,
    outputs: PictureOutputs = None,
    turn: Annotated[int | None, Arg("N", parse=arguments.whole_number(2, 360), group="path")] = None,
    fly: Annotated[int | None, Arg("N", parse=arguments.whole_number(2, 1000), group="path")] = None,
    bits: Literal[8, 16] = 8,
    ao: Annotated[int | None, Arg("N", parse=arguments.whole_number(1, 1024))] = None,
    up: arguments.Up | None = None,
) -> dict[str, Any]:
    """A picture, or the arrays, of what a camera sees of a field or of a scene.

    The file's suffix says what is written.

    | file | holds |
    | --- | --- |
    | `.png`, `.webp` | a shaded picture, or one output by `--output`; `--turn 36`: one that turns |
    | `.png` with `--bits 16` | depth = value × step, 0 where nothing is seen; the step is printed and in the file |
    | `.npz`, `.exr` | the arrays of all outputs that `--output` names; in EXR float32 channels |

    A [scene file](formats.md#scene-files) lists fields; each is asked for the rays that meet its box alone. Arrays of
    `--turn` and `--fly` have an axis of frames. Shadows are asked of the field. Most pixels take two rays at most;
    outlines, creases and edges of shadows up to 18; finding the window, some 20,000. `--ao N` adds N to each sample on
    the object. `evaluated`: rays asked; `saved`: those of all samples, of every field, less these.
    Without a distance a shaded picture frames what is seen of the object (`window`: left, top, side, of the camera's
    frame); with `--camera 35,25,0.7` it has the camera's frame, as outputs have.

    Args:
      out: .png, .webp, .npz, .exr: a picture of one output, or the numbers of several (npz, exr).
      turn: so many frames, once around.
      fly: of a scene: so many frames of outputs along the waypoints of its file, or straight in.
      bits: 16: a PNG of depth holds the numbers, depth = value x step, 0 where nothing is seen (default 8: colours).
      ao: of a shaded picture: ambient occlusion by so many rays, 32 say.
      up: axis that points up (default: what `ddf fit --up` or the scene file was told, else y).

    Examples:
      ddf render rabbit rabbit.png
      ddf render rabbit turn.webp --turn 36
      ddf render armchair armchair.png --ao 32
      ddf render rabbit normals.webp --output normals --camera -30,20 --size 512
      ddf render rabbit seen.npz --output visibility,depth,normals
      ddf render rabbit depth16.png --bits 16
      ddf render scene.yaml scene.png
      ddf render scene.yaml flight.webp --output normals --fly 48
    """
    import numpy as np

    from ddf.fields import framed_field
    from ddf.geometry import rays

    suffix = out.suffix.lower()
    if (camera[2] or 0) < 0:
        raise errors.InputError(f"--camera: the distance must be 0 or more; got {camera[2]:g}")
    if outputs is None:
        numbers = suffix not in results.PICTURES or bits == 16 or fly is not None
        outputs = ("depth",) if numbers else (arguments.SHADED,)
    _require_holds(out, suffix, outputs, {"fly": fly, "turn": turn}, ao, bits)
    if (pixels := size**2 * (fly or turn or 1)) > _MOST_PIXELS:
        raise errors.InputError(f"{out}: {pixels:,} pixels of all frames; at most {_MOST_PIXELS:,}")
    shown, shaded = _opened(field, up), outputs == (arguments.SHADED,)
    needed, there = ("depth", "normals") if shaded else outputs, shown.shape.outputs
    if lacking := [name for name in needed if name not in there]:
        components = "; patches have one component, networks two" * (lacking[0] in _OF_TWO)
        raise errors.InputError(f"{field}: has no {', '.join(lacking)}{components}; it has {', '.join(there)}")
    if shaded:
        return _shaded(shown, out, camera, size, turn, ao or 0)
    started, names = time.monotonic(), {"visibility", *outputs}
    around = _around(shown, camera, turn)
    frames = [] if fly else [framed_field.render(shown.shape, each, size, names, shown.up)[0] for each in around]
    for look in _flight(field, shown, around[0], camera, fly) if fly else ():
        found, _ = framed_field.query(shown.shape, rays.OrientedPoints(*look.rays(size, shown.up)), names)
        frames.append({name: values.reshape(size, size, *values.shape[1:]) for name, values in found.items()})
    seconds = time.monotonic() - started
    images = {name: np.stack([frame[name] for frame in frames]) for name in names}
    drawn = {name: images[name] for name in outputs}
    seen = images["visibility"] >= framed_field.SEEN
    ranges = {name: _range(values, seen) | {"unit": _unit(shown, name)} for name, values in drawn.items()}
    step = _write(out, suffix, bits, drawn if turn or fly else {name: each[0] for name, each in drawn.items()}, frames)
    found = _told(shown, out, size, len(frames), None if shown.fly and fly else around[0], seen.mean(), 1, seconds)
    if step is not None:
        found["depth_step"] = step
        found["verdict"] += f"; depth = value x {step:.6g}, 0 where nothing is seen"
    rows = [(name, *found.values()) for name, found in ranges.items()]
    table = results.grid(("output", "least", "largest", "unit"), rows)
    return {"output": ",".join(outputs), "range": ranges, **found, "table": table}


class _Opened(NamedTuple):
    """A field or a scene of so many members, its fields, which count rays, the axis that points up, and waypoints."""

    shape: "framed_field.FramedField"
    counted: "Sequence[scene_field.Counted]"
    members: int
    up: arguments.Up
    fly: "Sequence[scene_field.LookAt]" = ()


def _opened(path: Path, up: arguments.Up | None) -> _Opened:
    from ddf.api import field as fields
    from ddf.api import scene as scenes
    from ddf.fields import scene_field

    if not arguments.is_scene(path):
        field = fields.load(path)
        shape = scene_field.Counted(field.framed)
        return _Opened(shape, [shape], 1, up or field.up)
    content = scenes.read_content(path)
    whole = scenes.build(content, path).framed
    assert isinstance(whole, scene_field.SceneField)
    counted = {id(each): scene_field.Counted(each) for each in whole.fields}
    shape = dataclasses.replace(whole, fields=tuple(counted[id(each)] for each in whole.fields))
    waypoints = [stop.look_at() for stop in content.fly]
    return _Opened(shape, list(counted.values()), len(whole.fields), up or content.up, waypoints)


def _around(shown: _Opened, camera: arguments.Camera, turn: int | None) -> list[tuple[float, float, float]]:
    """The camera, or so many once around; without a distance the box stays within every picture."""
    from ddf.fields import framed_field

    azimuth, elevation, radius = camera
    turned = [azimuth + 360.0 * i / (turn or 1) for i in range(turn or 1)]
    if radius is None:
        radius = max(framed_field.framing_radius(shown.shape, each, elevation, shown.up) for each in turned)
    return [(each, elevation, radius) for each in turned]


def _flight(
    file: Path, shown: _Opened, first: tuple[float, float, float], camera: arguments.Camera, frames: int
) -> "list[scene_field.LookAt]":
    """Along the waypoints of a scene; of one without, from the first camera to the middle."""
    from ddf.fields import scene_field

    if not isinstance(shown.shape, scene_field.SceneField):
        raise errors.InputError(f"{file}: --fly goes through a scene file; around one field goes --turn")
    if shown.fly and camera is not arguments.FirstCamera:
        raise errors.InputError(f"{file}: its waypoints tell where the camera is; leave --camera out")
    stops = shown.fly or scene_field.straight_in(shown.shape, scene_field.one(shown.shape, *first, shown.up))
    return scene_field.fly(stops, frames)


def _unit(shown: _Opened, name: str) -> str:
    """Of an output; a scene's are in its own frame."""
    unit = field_outputs.OUTPUTS[name].unit
    return unit if shown.members == 1 else unit.replace("mesh", "scene")


def _told(
    shown: _Opened,
    out: Path,
    size: int,
    frames: int,
    first: tuple[float, float, float] | None,
    seen: float,
    samples: int,
    seconds: float,
) -> dict[str, Any]:
    """What is said of pictures. first: camera, none of a flight; seen: share of pixels; samples: a pixel's, at most."""
    pixels, evaluated = frames * size**2, sum(field.queries for field in shown.counted)
    hint = "" if seen else "; NOTHING is seen: give another --camera, or none"
    azimuth, elevation, radius = first or (None, None, None)
    place = f"{azimuth:g},{elevation:g},{radius:.6g}" if first else "its waypoints"
    sizes = f"{size} x {size}" if frames == 1 else f"{frames} x {size} x {size}"
    return {
        "frames": frames,
        "camera": {"azimuth_deg": azimuth, "elevation_deg": elevation, "radius": radius},
        "pixels": pixels,
        "evaluated": evaluated,
        "saved": max(0, samples * pixels * shown.members - evaluated),
        "seen": round(seen * pixels),
        "seconds": round(seconds, 4),
        "verdict": f"{out}: {sizes} pixels, {seen:.0%} of them see the object from {place}; "
        f"{evaluated:,} rays in {seconds:.2f} s{hint}",
    }


def _require_holds(
    out: Path, suffix: str, outputs: tuple[str, ...], path: Mapping[str, int | None], ao: int | None, bits: int
) -> None:
    pictures, shaded = results.PICTURES, outputs == (arguments.SHADED,)
    if suffix not in (*pictures, *results.ARRAYS):
        raise errors.InputError(f"{out}: must end in one of {', '.join((*pictures, *results.ARRAYS))}")
    if suffix == ".exr" and importlib.util.find_spec("OpenEXR") is None:
        raise errors.InputError(f"{out}: .exr needs the package OpenEXR: pip install openexr")
    if shaded and suffix not in pictures:
        raise errors.InputError(f"{out}: {arguments.SHADED} is a picture: {', '.join(pictures)}")
    if ao is not None and not shaded:
        raise errors.InputError(f"--ao goes with --output {arguments.SHADED}; got {','.join(outputs)}")
    if path["fly"] is not None and shaded:
        raise errors.InputError("--fly shows outputs: --output depth, say; --turn goes with shaded pictures")
    if suffix in pictures and len(outputs) > 1:
        raise errors.InputError(f"{out}: a picture shows one output, .npz and .exr hold {len(outputs)}")
    if bits == 16 and (suffix != ".png" or outputs != ("depth",)):
        raise errors.InputError("--bits 16 is for the depth in a .png; .npz and .exr hold numbers of any output")
    moving = next((name for name, frames in path.items() if frames is not None), None)
    if moving and (bits == 16 or suffix == ".exr"):
        raise errors.InputError(f"{out}: holds one frame; the numbers of --{moving} go to .npz")


def _shaded(
    shown: _Opened, out: Path, camera: arguments.Camera, size: int, turn: int | None, ao: int
) -> dict[str, Any]:
    import numpy as np

    from ddf.core import storage
    from ddf.pictures import shaded

    started, around = time.monotonic(), _around(shown, camera, turn)
    standing = shaded.stand(shown.shape, shown.up)
    part = shaded.window(standing, around) if camera[2] is None else shaded.WHOLE
    frames = [shaded.render(standing, each, size, part, sky=ao) for each in around]
    seconds = time.monotonic() - started
    pictures = [frame.picture for frame in frames]
    storage.write_bytes(out, results.encode(pictures, out.suffix.lower(), _FRAME_MS))
    seen = float(np.mean([frame.seen for frame in frames]))
    found = _told(shown, out, size, len(frames), around[0], seen, (2 + ao) * shaded.MOST_SAMPLES, seconds)
    own, (azimuth, elevation, radius) = "the camera's own frame", around[0]
    framed = f"around the object; --camera {azimuth:g},{elevation:g},{radius:.6g} gives {own}"
    place = own if part == shaded.WHOLE else framed
    table = {"picture": place, "rays asked": found["evaluated"], "rays saved": found["saved"]}
    return {"output": arguments.SHADED, "window": part, **found, "table": table}


def _range(values: "np.ndarray", seen: "np.ndarray") -> dict[str, float]:
    """Least and largest of what is seen; NaN where nothing is."""
    known = values[seen]
    if not known.size:
        return {"min": float("nan"), "max": float("nan")}
    return {"min": float(known.min()), "max": float(known.max())}


def _write(
    out: Path,
    suffix: str,
    bits: int,
    drawn: "Mapping[str, np.ndarray]",
    frames: "Sequence[dict[str, np.ndarray]]",
) -> float | None:
    """Write the arrays, or a picture of each of the frames; the step of a depth of 16 bits."""
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
        if name == "depth":
            pictures = field_pictures.depth_pictures(*(frame[name] for frame in frames))
        else:
            pictures = [field_pictures.picture(name, frame) for frame in frames]
        storage.write_bytes(out, results.encode(pictures, suffix, _FRAME_MS))
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

    page = page_of(what, up)
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


def page_of(what: Sequence[Path], up: arguments.Up | None = None) -> "viewer_page.Page":
    """The page of a field, of a scene file, or of what a model makes of a picture; of several side by side. InputError
    where what must stand alone does not.
    """
    from ddf.api import field as fields
    from ddf.fields import field_file
    from ddf.io import viewer_page

    files = [path for path in what if arguments.is_scene(path)]
    if files and len(what) == 1:
        return _scene_page(files[0], up)
    if files:
        raise errors.InputError(f"{files[0]}: a scene file is shown alone; it may name all fields")
    missing = next((path for path in what if len(what) > 1 and not path.exists()), None)
    if missing is not None:
        raise FileNotFoundError(f"{missing}: no such field; a file to write must end in .html")
    shown, up = list(_shown(what)), up or fields.up_of(what[0])
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
            yield from _reconstructed(pictures or [file.parent / _SAMPLE], file.parent)
            pictures = []
        else:
            shipped_models.require(path, "field", "reconstruction")
            known[path] = known.get(path) or viewer_page.field(path)
            yield viewer_page.name_of(path), known[path], viewer_page.ABOUT
    if pictures:
        raise errors.InputError(f"{pictures[0]}: a picture stands before the model that makes a field of it")


def _reconstructed(pictures: Sequence[Path], model: Path) -> "Iterator[tuple[str, viewer_page.Shape, str]]":
    """The patches that a model makes of pictures."""
    from ddf.api import reconstruction

    if not all(picture.is_file() for picture in pictures):
        raise errors.InputError(f"{model}: has no {_SAMPLE}; give a picture before it: ddf view IMAGE.png {model}")
    of = reconstruction.reconstructor(model)
    for picture in pictures:
        found = of([picture], 2, 0, None, "auto")
        about = f"What the model {found.kind} makes of {picture.name}: {found.verdict}."
        name = found.kind if picture.parent == model else picture.stem
        yield name, cast("viewer_page.Shape", found.field.framed), about


def _scene_page(file: Path, up: arguments.Up | None) -> "viewer_page.Page":
    """The page of a scene file; a field that it names several times is in the page once."""
    from ddf.api import scene as scenes
    from ddf.io import viewer_page

    content = scenes.read_content(file)
    scene, up = scenes.build(content, file).framed, up or content.up
    baked = {}
    for name in {placement.field for placement in content.objects}:
        folder = scenes.field_beside(file.parent, name)
        baked[name] = viewer_page.bake(viewer_page.field(folder), viewer_page.name_of(folder))
    fields = [viewer_page.placed(baked[placement.field], placement.similarity()) for placement in content.objects]
    page = viewer_page.scene_page(file.stem, fields, scene.lower, scene.upper, up, content.box is not None)
    if page.box is not None:  # the page cuts the box open
        return page
    return dataclasses.replace(page, first=viewer_page.first(scene, page.azimuth, up))
