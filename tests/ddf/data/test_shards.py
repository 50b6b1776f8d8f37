"""Raw meshes to packs, packs to samples and clouds: contents, failures, silhouettes, independence of the sharding."""

import dataclasses
import json

import numpy as np
import pytest
import torch
from _shapes import cube, icosphere, joined, moved
from _support import assert_close, damage

from ddf.core import checks, parallel, storage
from ddf.data import mesh_preparation, mesh_shards, mesh_topology, packing, sample_shards, shapenet
from ddf.data.samples import extraction, sample_types
from ddf.data.synthetic import write
from ddf.geometry import mesh_io, raycast, transforms

MESHES = mesh_preparation.MeshesConfig(faces=600, alpha=0.05, offset=0.004, measure_points=500)
SAMPLES = extraction.SamplesConfig(
    counts={"U": 200, "A": 200, "B": 100, "S": 100, "T": 100, "O": 100}, cloud_points=300
)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    """Three shapes in the v1 frame, the second one broken."""
    root = tmp_path_factory.mktemp("data")
    parts = joined(moved(cube(), 0.5, (0.3, 0.1, 0)), moved(icosphere(2), 0.5, (-0.3, 0, 0)))
    shapes = {"a": icosphere(2), "broken": None, "c": parts}
    for name, mesh in shapes.items():
        folder = root / "ShapeNetCore.v1" / "007" / name
        folder.mkdir(parents=True)
        data = b"v 0 0 0\nf 1 2 3\n"
        if mesh is not None:
            unit = moved(mesh, 1 / mesh.diagonal(), (0, 0, 0))
            lower, upper = unit.box()
            data = mesh_io.export_bytes(moved(unit, 1.0, tuple(-(lower + upper) / 2)), ".obj")
        (folder / "model.obj").write_bytes(data)
    listing = [{"id": name, "train_views": [0], "test_views": []} for name in shapes]
    index = {"root": root.as_posix(), "categories": {"thing": {"synset": "007", "shapes": listing}}}
    (root / "index.json").write_text(json.dumps(index))
    return root


@pytest.fixture(scope="module")
def packs(dataset, tmp_path_factory):
    out = tmp_path_factory.mktemp("meshes")
    shapes = mesh_shards.raw_shapes(dataset / "index.json", "thing")
    result = mesh_shards.prepare(MESHES, "thing", shapes, parallel.Shard(out, 0, "f"))
    return out, shapes, result


def test_pack_holds_closed_meshes_with_measures_and_failures(packs):
    out, shapes, result = packs
    assert [failure.id for failure in result.failures] == ["broken"]
    assert "broken" in result.failures[0].reason and result.files == [out / f"000{mesh_shards.SUFFIX}"]
    pack = mesh_shards.read_pack(out / f"000{mesh_shards.SUFFIX}")
    raw = pack.field_from_raw["a"].apply(mesh_io.load(shapes[0].path).vertices)
    assert raycast.Scene(pack.meshes["a"]).distance(raw).max() < 1e-6
    assert list(pack.meshes) == ["a", "c"] == [row["id"] for row in pack.measures]
    for row, mesh in zip(pack.measures, pack.meshes.values(), strict=True):
        assert mesh_topology.is_watertight(mesh) and len(mesh.faces) == int(row["faces"]) <= 600
        assert set(row) == set(mesh_shards.MEASURES) and float(row["hausdorff_seen"]) < 0.1
        lower, upper = mesh.box()
        assert_close((upper - lower).max(), np.array(2.0), atol=1e-6)


def test_a_shape_that_is_not_in_the_frame_of_v1_is_told(tmp_path, caplog):
    """Off the origin, or of another size: predictions are placed as if it were v1's."""
    ball, paths = icosphere(2), {}
    unit = 1 / ball.diagonal()
    for name, scale, shift in (("good", unit, 0.0), ("off", unit, 0.2), ("large", 1.0, 0.0)):
        paths[name] = tmp_path / f"{name}.obj"
        paths[name].write_bytes(mesh_io.export_bytes(moved(ball, scale, (shift, 0, 0)), ".obj"))
    shapes = [mesh_shards.RawShape(name, path.as_posix(), "x") for name, path in paths.items()]
    mesh_shards.prepare(MESHES, "thing", shapes, parallel.Shard(tmp_path, 0, "f"))
    told = [record.getMessage() for record in caplog.records if "v1's are centred" in record.getMessage()]
    assert [message.partition(":")[0] for message in told] == [str(paths["off"]), str(paths["large"])]
    assert "0.2 off the origin with diagonal 1;" in told[0]
    rows = {row["id"]: row for row in mesh_shards.read_pack(tmp_path / f"000{mesh_shards.SUFFIX}").measures}
    assert float(rows["off"]["off_centre"]) == pytest.approx(0.2, abs=1e-5) and float(rows["good"]["off_centre"]) < 1e-5
    assert float(rows["large"]["diagonal"]) == pytest.approx(ball.diagonal(), abs=1e-5)


def test_same_shapes_give_the_same_bytes_and_damaged_ones_are_refused_by_name(packs, tmp_path):
    out, shapes, _ = packs
    mesh_shards.prepare(MESHES, "thing", shapes, parallel.Shard(tmp_path, 0, "f"))
    data = (tmp_path / f"000{mesh_shards.SUFFIX}").read_bytes()
    assert (out / f"000{mesh_shards.SUFFIX}").read_bytes() == data
    damage(tmp_path / f"000{mesh_shards.SUFFIX}", len(data) // 2)
    with pytest.raises(checks.InputError, match=r"000\.meshes"):
        mesh_shards.read_pack(tmp_path / f"000{mesh_shards.SUFFIX}")


def test_samples_and_clouds_do_not_depend_on_the_sharding(packs, tmp_path):
    out, raw, _ = packs
    shapes = sample_shards.prepared_shapes(out, raw)
    assert [shape.id for shape in shapes] == ["a", "c"]
    whole = sample_shards.extract(SAMPLES, "thing", shapes, parallel.Shard(tmp_path, 0, "f"))
    single = sample_shards.extract(SAMPLES, "thing", shapes[1:], parallel.Shard(tmp_path, 1, "f"))
    assert [path.name for path in whole.files] == ["000.samples.safetensors", "000.clouds.safetensors"]
    assert not whole.failures and not single.failures
    both, metadata = storage.load_tensors(whole.files[0])
    one, _ = storage.load_tensors(single.files[0])
    assert metadata["ids"] == ["a", "c"]
    assert set(both) == {f"{kind}.{name}" for kind in sample_types.KINDS for name in packing.FIELDS}
    assert all((both[name][1] == one[name][0]).all() for name in both)
    clouds, info = storage.load_tensors(whole.files[1])
    alone, _ = storage.load_tensors(single.files[1])
    start, stop = clouds["offsets"][1:3]
    assert (clouds["points"][start:stop] == alone["points"]).all() and len(clouds["hidden"]) == stop
    assert info["hidden_share"]["a"] == 0 and info["hidden_share"]["c"] > 0.05


def test_stored_samples_see_the_stored_mesh(packs, tmp_path):
    out, raw, _ = packs
    shapes = sample_shards.prepared_shapes(out, raw)[:1]
    result = sample_shards.extract(SAMPLES, "thing", shapes, parallel.Shard(tmp_path, 0, "f"))
    tensors, metadata = storage.load_tensors(result.files[0], framework="torch")
    samples = packing.decode({name: value[0] for name, value in tensors.items()}, "A")
    seen = samples["visible"]
    q = samples["positions"][seen] + samples["depth"][seen, None] * samples["directions"][seen]
    assert seen.float().mean() > 0.95
    field_from_raw = transforms.Similarity.from_dict(metadata["field_from_raw"]["a"])
    surface = mesh_io.Mesh(field_from_raw.apply(mesh_io.load(raw[0].path).vertices), mesh_io.load(raw[0].path).faces)
    assert raycast.Scene(surface).distance(q.double().numpy()).max() < 1e-4
    assert ((samples["normals"] * samples["directions"]).sum(-1)[seen] < 0.02).all()
    assert torch.isinf(samples["depth"][~seen]).all()


def test_unknown_category_and_missing_packs_are_named(dataset, tmp_path):
    with pytest.raises(checks.InputError, match="no category 'sofa'; it has thing"):
        mesh_shards.raw_shapes(dataset / "index.json", "sofa")
    with pytest.raises(FileNotFoundError, match="run stage meshes first"):
        sample_shards.prepared_shapes(tmp_path, [])


def test_as_many_shapes_as_the_config_says_are_chosen_in_their_order():
    shapes = [mesh_shards.RawShape(f"{i:02d}", "", "") for i in range(20)]
    few = mesh_shards.chosen(shapes, dataclasses.replace(MESHES, shapes=6), "car")
    assert len(few) == 6 and few == sorted(few, key=lambda shape: shape.id) != shapes[:6]
    assert few == mesh_shards.chosen(shapes, dataclasses.replace(MESHES, shapes=6), "car")
    assert mesh_shards.chosen(shapes, MESHES, "car") == shapes


SYNSET = shapenet.SYNSETS["chair"]


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    folder = tmp_path_factory.mktemp("root")
    for index in range(2):
        write.write_shape(folder, 3, "chair", index, 1)
    return folder


def _shape(root, index):
    shape = root, SYNSET, write.shape_id(3, "chair", index)
    (camera,) = shapenet.read_cameras(shapenet.rendering_dir(*shape))
    return shapenet.model_path(*shape), (str(shapenet.image_path(*shape, 0)), *camera.tolist())


def test_a_mesh_agrees_with_its_render(root):
    for path, view in (_shape(root, 0), _shape(root, 1)):
        assert mesh_preparation.require_silhouette(mesh_io.load(path), *view) > 0.999


WRONG = {
    "v2": lambda mesh, view: (mesh_io.Mesh(mesh.vertices[:, [2, 1, 0]] * [1, 1, -1], mesh.faces), view),
    "size": lambda mesh, view: (mesh_io.Mesh(100 * mesh.vertices, mesh.faces), view),
    "radians": lambda mesh, view: (mesh, (view[0], np.radians(view[1]), *view[2:])),
}


@pytest.mark.parametrize("cause", [*WRONG, "shape"])
def test_meshes_of_other_roots_and_shapes_are_refused(root, cause):
    path, view = _shape(root, 0)
    mesh = mesh_io.load(path if cause in WRONG else _shape(root, 1)[0])
    with pytest.raises(checks.InputError, match=r"overlaps that of .*00\.png by 0\.\d\d, not 0\.95"):
        wrong, seen = WRONG.get(cause, lambda *same: same)(mesh, view)
        mesh_preparation.require_silhouette(wrong, *seen)


def test_shards_leave_out_what_does_not_agree(root, tmp_path):
    (path, view), (other, _) = _shape(root, 0), _shape(root, 1)
    shapes = [mesh_shards.RawShape(p.parent.name, str(p), "", view) for p in (path, other)]
    config = mesh_preparation.MeshesConfig(faces=5000)
    made = mesh_shards.prepare(config, "chair", shapes, parallel.Shard(tmp_path, 0, "x"))
    assert [failure.id for failure in made.failures] == [other.parent.name] and "silhouette" in made.failures[0].reason
    assert list(mesh_shards.read_pack(made.files[0]).meshes) == [path.parent.name]
