"""`ddf mesh`, `ddf samples` and `ddf cast` end to end."""

import numpy as np
import pytest
from _shapes import cube, moved, random_rays
from _support import assert_close

from ddf.core import storage
from ddf.data import mesh_topology
from ddf.geometry import mesh_io, transforms

MESH_KEYS = {"watertight", "faces", "hausdorff", "mean_distance", "seconds", "transform"}


def test_mesh_writes_a_closed_mesh_in_the_field_frame(work, tmp_path, answer):
    out = tmp_path / "closed.obj"
    found = answer("mesh", work / "soup.ply", out, "--faces", 500, "--alpha", 0.05)
    assert found.keys() >= MESH_KEYS and found["watertight"] is True and found["faces"] <= 500
    mesh = mesh_io.load(out)
    assert len(mesh.faces) == found["faces"] and mesh_topology.is_watertight(mesh)
    lower, upper = mesh.box()
    assert_close(np.stack([lower + upper]), np.zeros((1, 3)), atol=1e-12)
    assert_close((upper - lower).max(), np.array(2.0), atol=1e-12)
    transform = transforms.Similarity.from_dict(found["transform"])
    assert_close(transform.apply(np.array([[1e4, 0, -1e4]])), np.zeros((1, 3)), atol=0.2)
    assert 0 < found["mean_distance_seen"] < found["hausdorff_seen"] < 0.05
    assert found["hausdorff"] == pytest.approx(found["hausdorff_hidden"], rel=0.1)  # the ball inside is gone
    assert "hidden parts" in found["outcome"]


def test_samples_are_the_same_bytes_for_the_same_seed(work, tmp_path, answer):
    outs = [tmp_path / f"{i}.safetensors" for i in range(3)]
    for out, seed in zip(outs, (1, 1, 2), strict=True):
        found = answer("samples", work / "soup.ply", out, "--seed", seed, "--count", 400)
        assert found["counts"] == {"U": 400, "A": 400, "B": 200, "S": 200, "T": 200, "O": 200}
    assert outs[0].read_bytes() == outs[1].read_bytes() != outs[2].read_bytes()
    arrays, metadata = storage.load_tensors(outs[0])
    assert arrays["U.positions"].shape == (400, 3) and arrays["O.normals"].shape == (200, 2)
    assert metadata["seed"] == 1 and set(metadata["field_from_raw"]) == {"scale", "rotation", "translation"}


@pytest.mark.parametrize("count", [300, 0])
def test_cast_answers_in_the_frame_of_the_file(count, tmp_path, answer):
    shift = np.array([2.0**18, -(2.0**19), 2.0**17])
    path, rays_path, out = tmp_path / "cube.ply", tmp_path / "rays.npz", tmp_path / "hits.npz"
    path.write_bytes(mesh_io.export_bytes(moved(cube(), 4.0, tuple(shift)), ".ply"))
    directions = random_rays(count, seed=1).directions.numpy().astype(np.float32)
    np.savez(rays_path, positions=np.tile(shift, (count, 1)).astype(np.float32), directions=directions)
    assert answer("cast", path, "--rays", rays_path, "--out", out)["hits"] == count
    with np.load(out) as hits:
        assert set(hits.files) == {"depth", "visible", "normals"} and hits["visible"].all()
        assert_close(hits["depth"], 4.0 / np.abs(directions).max(axis=1), atol=1e-5)
        assert_close(np.abs(hits["normals"]).max(axis=1), np.ones(count))
        assert ((hits["normals"] * directions).sum(axis=1) < 0).all()
