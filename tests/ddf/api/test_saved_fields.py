"""What a field writes is the field again, of every kind and every time."""

import numpy as np
import pytest

import ddf


@pytest.mark.parametrize("again", [1, 2])
def test_a_saved_field_answers_the_same(tmp_path, again):
    own = found = ddf.load(ddf.load("rabbit").save(tmp_path / "own").parent)
    for number in range(again):
        found.save(tmp_path / str(number))
        found = ddf.load(tmp_path / str(number))
    seen, other = (field.render(size=32, outputs=("visibility", "depth", "normals")) for field in (own, found))
    assert all(np.array_equal(seen[name], other[name]) for name in seen) and (seen["visibility"] > 0.5).any()
    assert "parameters" in repr(found) and f"{own.box[0][0]:.3g}" in repr(found)
    assert repr(found).startswith(f"Field({tmp_path / str(again - 1)}; ")


def test_points_have_normals_and_a_page_is_written(tmp_path):
    rabbit = ddf.load("rabbit")
    points, normals = rabbit.points(50, normals=True)
    assert np.array_equal(points, rabbit.points(50))
    np.testing.assert_allclose(np.linalg.norm(normals[normals.any(axis=1)], axis=1), 1, atol=1e-5)
    assert normals.any(axis=1).mean() > 0.9
    assert rabbit.export(tmp_path / "rabbit.html").read_text(encoding="utf-8").startswith("<!")
    with pytest.raises(ValueError, match=r"must end in \.onnx or \.html"):
        rabbit.export(tmp_path / "rabbit.obj")
