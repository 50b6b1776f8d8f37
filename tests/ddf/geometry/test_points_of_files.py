"""PLY clouds: every encoding gives the same points, and broken files are refused in one line."""

import numpy as np
import open3d as o3d
import pytest

from ddf.core import checks
from ddf.geometry import mesh_io

_POINTS = np.random.default_rng(0).normal(size=(37, 3))


def _header(form, count):
    columns = "".join(f"property double {axis}\n" for axis in "xyz")
    return f"ply\nformat {form} 1.0\ncomment x\nelement vertex {count}\n{columns}"


@pytest.mark.parametrize(("form", "order"), [("binary_little_endian", "<"), ("binary_big_endian", ">"), ("ascii", "")])
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_all_encodings_give_the_points(tmp_path, form, order, newline):
    header = (_header(form, len(_POINTS)) + "end_header\n").replace("\n", newline).encode()
    rows = [" ".join(map(repr, row)) for row in _POINTS.tolist()]
    body = _POINTS.astype(f"{order}f8").tobytes() if order else "\n".join(rows).encode()
    path = tmp_path / "a.ply"
    path.write_bytes(header + body)
    np.testing.assert_array_equal(mesh_io.read_points(path), _POINTS)


@pytest.mark.parametrize("ascii_form", [False, True])
def test_reads_what_open3d_writes_and_writes_what_open3d_reads(tmp_path, ascii_form):
    path = str(tmp_path / "a.ply")
    o3d.io.write_point_cloud(path, o3d.geometry.PointCloud(o3d.utility.Vector3dVector(_POINTS)), write_ascii=ascii_form)
    np.testing.assert_allclose(mesh_io.read_points(path), _POINTS, atol=1e-5)
    (tmp_path / "b.ply").write_bytes(mesh_io.points_ply(_POINTS))
    read = np.asarray(o3d.io.read_point_cloud(str(tmp_path / "b.ply")).points)
    np.testing.assert_array_equal(read, _POINTS)
    np.testing.assert_array_equal(mesh_io.read_points(tmp_path / "b.ply"), _POINTS)


def test_a_cloud_of_no_points_is_refused_by_name(tmp_path):
    path = tmp_path / "none.ply"
    path.write_text(_header("ascii", 0) + "end_header\n")
    with pytest.raises(checks.InputError, match=r"none\.ply: the cloud has no points"):
        mesh_io.read_points(path)
