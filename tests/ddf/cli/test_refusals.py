"""What every command refuses: one line that says what is wrong, exit code 2, and no file written."""

import shlex
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from _support import damage
from PIL import Image

from ddf.core import shipped_models, storage
from ddf.geometry import mesh_io

SCENE = "objects: [{field: rabbit}]"
FILES = {  # beside those of the fixture `work`
    "empty.obj": "v 0 0 0\n",
    "scene.yaml": SCENE,
    "object.json": "{}",
    "broken.json": "{",
    "list.json": "[1]",
    "number.json": '{"03001627": ["a", 7]}',
    "twice.json": '{"03001627": ["a", "a"]}',
    "keys.json": '{"03001627": ["a"], "02691156": ["b"], "03001627": ["c"]}',
}


@pytest.fixture(scope="module")
def _place(work, fitted):
    for name, text in FILES.items():
        (work / name).write_text(text)
    ranges = np.where(np.arange(64) % 2, 2.0, np.inf)
    along = np.tile([0.0, 0, -1], (64, 1))
    starts = np.column_stack([np.random.default_rng(0).uniform(-0.3, 0.3, (64, 2)), np.full(64, 2.0)])
    np.savez(work / "far.npz", positions=1e200 * starts, directions=along)
    np.savez(work / "scan_of_one.npz", positions=starts[0])
    np.savez(work / "scan.npz", positions=starts, directions=along, ranges=ranges)
    (work / "none.ply").write_bytes(mesh_io.points_ply(np.zeros((0, 3))))
    (work / "one.ply").write_bytes(mesh_io.points_ply(np.ones((3, 3))))
    noise = np.random.default_rng(0).integers(1, 255, (60, 90, 3), dtype=np.uint8)
    Image.fromarray(noise).save(work / "noise.png")
    damage(shutil.copytree(fitted[0], work / "damaged") / "model.safetensors", -5)
    storage.save_tensors(work / "other" / "model.safetensors", {"x": np.zeros(1)}, {"kind": "other"})
    return work


SAMPLE = shipped_models.ROOT / "chair" / "sample_0.png"
WHOLE = "must be a whole number, "
NO_FIELD = "no such file or folder, and no field of that name; there are rabbit, "
LINES = [
    ("nothing", "'nothing'; there are mesh, cast, "),
    ("--nothing", "arguments are required: COMMAND"),
    ("info tiny.yaml", "pipeline.yaml is not here"),
    ("fit --minuts 3 a b", "(did you mean --minutes?) (see ddf fit --help)"),
    ("fit torus.ply out --steps 0", "steps must be >= 1; got 0"),
    ("fit torus.ply out --seed -1", f"{WHOLE}0 to 9223372036854775807; got '-1'"),
    ("query field --rays none.npz --out field/model.safetensors", "is read and would be replaced by the output"),
    ("surface field out.ply --truth empty.obj", "empty.obj"),
    ("fit torus.ply out --config none.yaml", "none.yaml: no such file, nor the name of one"),
    ("fit torus.ply out --kind patches --minutes 1", "--minutes is of --kind sine"),
    ("fit none.obj out", "none.obj: no such file"),
    ("fit empty.obj out", "empty.obj"),
    ("fit torus.ply tiny.yaml", "tiny.yaml: is a file; give a folder to write"),
    ("query field --rays none.npz --out out.npz --outputs ,", "--outputs: must be among visibility, "),
    ("fit one.ply field --force", "one.ply: 3 hits: too few for a surface, which takes 50 or more"),
    ("points rabbit out.obj", "out.obj: must end in .ply"),
    ("surface rabbit out.xyz", "mesh files must end in one of .obj, .ply, .stl, .off, .glb; got .xyz"),
    ("udf rabbit --points none.npz --out out.npz", "No such file"),
    ("udf rabbit --points scan_of_one.npz --out out.npz", "positions must be numbers of shape (N, 3)"),
    ("render field out.png --camera 1,2,-1", "error: --camera: the distance must be 0 or more; got -1"),
    ("render rabbit out.png --output normals_2", "has no normals_2; patches have one component, networks two; it has "),
    ("render field out.png --output depth,normals", "a picture shows one output, .npz and .exr hold 2"),
    ("render field out.png --bits 16 --output normals", "--bits 16 is for the depth in a .png"),
    ("render field out.jpg", "out.jpg: must end in one of .png, .webp, .npz, .exr"),
    ("render damaged out.png", "is damaged"),
    ("render none out.png --camera 1", "must be two or three numbers az,el[,r]; got '1'"),
    ("render none out.png --size 0", f"{WHOLE}1 to 8192; got '0'"),
    ("render none out.png", f"none: {NO_FIELD}"),
    ("render rabbit out.png --camera 30,100", "the elevation must be in -90..90 degrees; got 100"),
    ("render scene.yaml out.png --fly 3 --output shaded", "--fly shows outputs"),
    ("render scene.yaml out.exr --fly 3", "out.exr: holds one frame; the numbers of --fly go to .npz"),
    ("render rabbit out.npz --fly 3", "rabbit: --fly goes through a scene file; around one field goes --turn"),
    ("surface scene.yaml out.ply", "scene.yaml: scene files are for ddf render, ddf view and ddf.read_scene alone"),
    ("view rabbit out.png", "out.png: no such field; a file to write must end in .html"),
    ("view rabbit noise.png out.html", "noise.png: a picture stands before the model"),
    ("view rabbit scene.yaml out.html", "scene.yaml: a scene file is shown alone"),
    ("export rabbit out.html", "must end in .onnx; a page is made by ddf view"),
    ("export other out.onnx", "holds no DDF"),
    ("export . out.onnx", "does not exist"),
    ("export chair out.onnx --outputs depth", "--outputs is of the graph field, this one is rays"),
    ("export chair out.onnx --graph field", "--graph must be one of rays, encode for"),
    ("complete scan.npz chair out --fixed", "--fixed needs --pose"),
    ("complete scan.npz chair out --noise -1", "noise must be 0 or more"),
    ("complete scan.npz chair out --pose object.json", "object.json: the pose must be a 4x4 matrix of numbers"),
    ("reconstruct noise.png chair out", "no object stands out from the background"),
    ("reconstruct none.png chair out", "no such image"),
    (f"reconstruct {SAMPLE} other out", "holds no DDF model"),
    ("reconstruct noise.png other.png chair out --cameras a.json", "--cameras is of one picture or, with --together"),
    ("points rabbit out.ply --seed 9223372036854775808", f"{WHOLE}0 to 9223372036854775807; got '92233"),
    ("reconstruct noise.png noise.png chair out", "two images are called 'noise'"),
    ("generate other out", "no shape VAE, image GAN or reconstruction model"),
    ("models get nothing out", "no model is called 'nothing'; there are rabbit, rabbit-network, nested"),
    ("mesh field out.ply", "not a file"),
    ("mesh soup.ply out.ply --faces 1", "faces must be >= 4"),
    ("cast soup.ply --rays far.npz --out out.npz", "positions must be within 1e+100"),
    ("cast soup.ply --rays soup.ply --out out.npz", "not a readable NPZ"),
    ("compare one.ply none.ply", "none.ply"),
    ("compare one.ply one.ply --tau-sq 0", "tau_sq"),
    ("split none.json --out out", "no such file or folder"),
    ("split broken.json --out out", "not valid JSON"),
    ("split list.json --out out", "one JSON object"),
    ("split number.json --out out", "letters, digits"),
    ("split twice.json --out out", "listed twice"),
    ("split keys.json --out out", "'03001627' is given twice"),
]


@pytest.mark.parametrize(("line", "said"), LINES)
def test_a_line_that_asks_for_what_cannot_be(line, said, _place, refusal, monkeypatch):
    monkeypatch.chdir(_place)
    before = sorted(Path().rglob("*"))
    assert said in refusal(*shlex.split(line))
    assert sorted(Path().rglob("*")) == before


def test_exr_without_its_package_is_refused_before_anything_is_read(refusal, monkeypatch):
    monkeypatch.setitem(sys.modules, "OpenEXR", None)
    monkeypatch.setattr("ddf.api.field.load", None)
    assert "out.exr: .exr needs the package OpenEXR" in refusal("render", "rabbit", "out.exr")


RAYS = {"positions": np.zeros((2, 3)), "directions": np.array([[0, 0, 1.0], [0, 0, 1]])}
ARRAYS = [
    ({"directions": None}, "has no array 'directions'"),
    ({"directions": np.zeros((2, 2))}, "shape"),
    ({"directions": np.array([[0, 0, 1.0], [0, 0, 2]])}, "must be unit length (tol 0.0001); got 2 at index"),
    ({"positions": np.full((2, 3), np.nan)}, "positions must be finite"),
    ({"positions": np.zeros((1, 3))}, "1 positions but 2 directions"),
    ({"positions": np.array(["a", "b"])}, "numbers"),
    ({"positions": np.zeros((3_000_000, 3), np.int8)}, "claims 9,000,000 numbers"),
]


@pytest.mark.parametrize(("arrays", "said"), ARRAYS)
@pytest.mark.parametrize("command", ["query field", "cast soup.ply"])
def test_rays_that_are_none(command, arrays, said, _place, tmp_path, refusal, monkeypatch):
    monkeypatch.chdir(_place)
    given = {name: array for name, array in (RAYS | arrays).items() if array is not None}
    np.savez_compressed(tmp_path / "rays.npz", **given)
    line = refusal(*command.split(), "--rays", tmp_path / "rays.npz", "--out", tmp_path / "out.npz")
    assert said in line and "rays.npz" in line and not (tmp_path / "out.npz").exists()
