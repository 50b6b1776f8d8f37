"""What the bench of fields of one image says of patches, of their own mesh and of a smaller one."""

from _shapes import icosphere

from bench.reconstruction import one_view
from ddf.fit import patch_fitting


def test_errors_are_of_the_mesh_beside_the_field():
    own, smaller = (one_view.judged(patch_fitting.patches(icosphere(2)), icosphere(2, r))[1] for r in (1.0, 0.9))
    assert own["inside"] < 1 < 10 < smaller["inside"] and own["normals"] < 2
    assert own["depth"] < 0.1 and 5 < smaller["depth"] < 9  # 0.1 of 1.84, and more aslant
