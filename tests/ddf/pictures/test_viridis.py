import matplotlib  # noqa: TID251
import numpy as np

from ddf.pictures import field_pictures


def test_colours_are_those_of_matplotlib_in_bytes():
    levels = np.concatenate([np.linspace(0.0, 1.0, 1001), np.arange(257) / 256])
    expected = matplotlib.colormaps["viridis"](levels)[..., :3]
    assert np.array_equal(np.rint(field_pictures.colours(levels) * 255), np.rint(expected * 255))
    np.testing.assert_allclose(
        field_pictures.colours(np.array([0.0, 1.0])), [[0.267, 0.005, 0.329], [0.993, 0.906, 0.144]], atol=2e-3
    )
