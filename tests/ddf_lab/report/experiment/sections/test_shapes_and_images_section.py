"""Points of the scatter plots."""

import pytest

from ddf_lab.report.experiment import stage_results
from ddf_lab.report.experiment.sections import shapes_and_images


def test_shapes_are_means_over_their_images(reported):
    results = stage_results.read_results(reported[1])
    images, shapes = (shapes_and_images.chamfer_pairs(results, "plane", by) for by in (["id", "view"], ["id"]))
    assert len(images[0]) == 4 and len(shapes[0]) == 2
    for one, other in zip(images, shapes, strict=True):
        assert one.reshape(2, 2).mean(axis=1) == pytest.approx(other)
