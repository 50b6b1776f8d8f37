"""A mesh that does not belong to its render is refused with the likely cause; one that does is not."""

import numpy as np
import pytest

from ddf.core import checks, parallel
from ddf.data import mesh_config, mesh_shards, shapenet, silhouette_check
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
    name = write.shape_id(3, "chair", index)
    camera = shapenet.read_cameras(shapenet.rendering_dir(root, SYNSET, name))[0]
    path = shapenet.model_path(root, SYNSET, name)
    return path, silhouette_check.View(str(shapenet.image_path(root, SYNSET, name, 0)), *camera.tolist())


def test_a_mesh_agrees_with_its_render(root):
    for index in range(2):
        path, view = _shape(root, index)
        assert silhouette_check.require(mesh_io.load(path), view) > 0.999


WRONG = {
    r"turned by (90|270) degrees about Y: ShapeNetCore\.v2": lambda v: v[:, [2, 1, 0]] * [1, 1, -1],
    r"turned by (90|270) degrees about X: another axis points up": lambda v: v[:, [0, 2, 1]] * [1, 1, -1],
    "once it is centred, with a diagonal of 1": lambda v: 100 * v,
}
OVERLAP = r"overlaps that of .*00\.png by 0\.\d\d, not 0\.95: it fits .*"


@pytest.mark.parametrize("cause", WRONG)
def test_meshes_of_other_roots_are_refused_with_the_cause(root, cause):
    path, view = _shape(root, 0)
    mesh = mesh_io.load(path)
    with pytest.raises(checks.InputError, match=OVERLAP + cause):
        silhouette_check.require(mesh_io.Mesh(WRONG[cause](mesh.vertices), mesh.faces), view)


def test_other_shapes_and_radians_are_refused(root):
    path, view = _shape(root, 0)
    with pytest.raises(checks.InputError, match="perhaps mesh and image are of different shapes"):
        silhouette_check.require(mesh_io.load(_shape(root, 1)[0]), view)
    in_radians = view._replace(**{name: np.radians(getattr(view, name)) for name in ("azimuth_deg", "elevation_deg")})
    with pytest.raises(checks.InputError, match="angles read as radians: the metadata must be in degrees"):
        silhouette_check.require(mesh_io.load(path), in_radians)


def test_shards_leave_out_what_does_not_agree(root, tmp_path):
    (path, view), (other, _) = _shape(root, 0), _shape(root, 1)
    shapes = [mesh_shards.RawShape(p.parent.name, str(p), "", view) for p in (path, other)]
    made = mesh_shards.prepare(mesh_config.MeshesConfig(faces=5000), "chair", shapes, parallel.Shard(tmp_path, 0, "x"))
    assert [failure.id for failure in made.failures] == [other.parent.name] and "silhouette" in made.failures[0].reason
    assert list(mesh_shards.read_pack(made.files[0]).meshes) == [path.parent.name]
