"""A mesh that does not belong to its render is refused with the likely cause; one that does is not."""

import numpy as np
import pytest

from ddf.core import checks, parallel
from ddf.data import mesh_config, mesh_preparation, mesh_shards, shapenet
from ddf.data.synthetic import write
from ddf.geometry import mesh_io

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
    made = mesh_shards.prepare(mesh_config.MeshesConfig(faces=5000), "chair", shapes, parallel.Shard(tmp_path, 0, "x"))
    assert [failure.id for failure in made.failures] == [other.parent.name] and "silhouette" in made.failures[0].reason
    assert list(mesh_shards.read_pack(made.files[0]).meshes) == [path.parent.name]
