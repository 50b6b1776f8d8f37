"""Numbers of the figures against closed forms, and recipes of their fits."""

import numpy as np
import torch

from ddf.data.synthetic import showcase
from ddf.fields import scene_field, udf
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


def test_soft_distances_are_the_papers_means():
    """Two candidates: Σ w d and the unit vector along Σ w v, w by softmax of ξ / (η (ε + d))."""
    ways = torch.tensor([[[1.0, 0, 0], [0, 1.0, 0]]])
    seen, far = torch.tensor([[0.9, 0.4]]), torch.tensor([[0.5, 0.2]])
    blend, at = scene_field.Blend(0.5, 0.05), torch.zeros(1, 3)
    found = distance_figure.from_candidates(lambda *_: udf.Answer(seen, far), at, ways, blend)
    weights = torch.softmax(seen / 0.5 / (0.05 + far), dim=-1)[0]
    torch.testing.assert_close(found.distances, (weights * far[0]).sum()[None])
    torch.testing.assert_close(found.directions[0, :2], weights / weights.norm())
    hard = distance_figure.from_candidates(lambda *_: udf.Answer(seen, far), at, ways, None)
    assert hard.distances.item() == 0.5  # the nearer one is not seen
