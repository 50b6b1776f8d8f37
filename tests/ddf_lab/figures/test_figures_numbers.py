"""Numbers of the figures against closed forms, and recipes of their fits."""

import numpy as np

from ddf.data.synthetic import showcase
from ddf.geometry import raycast
from ddf_lab.figures import distance_figure, figure_fields

POSITIONS = np.random.default_rng(0).uniform(-1, 1, (400, 3))


def test_closest_points_on_the_spheres_are_those_of_the_mesh():
    mesh = showcase.two_spheres()
    closest = distance_figure.exact("two_spheres", mesh)(POSITIONS)
    distances = np.linalg.norm(closest - POSITIONS, axis=1)
    np.testing.assert_allclose(distances, raycast.Scene(mesh).distance(POSITIONS), atol=2e-3)


def test_paper_udf_trains_g_v_as_the_paper_does():
    """[DDF22] app. D: 5 x 128, K_c = 5, 1e4 iterations of 4,096 points, Adam at 1e-4."""
    found = distance_figure.candidate_recipe(figure_fields.FiguresConfig(paper_candidates=True))
    assert (found.hidden, found.steps, found.points) == ((128,) * 5, 10_000, 4096)
    assert (found.loop.learning_rate, found.loop.schedule) == (1e-4, "constant")
