"""What the package's models call none of their kind, of shapes that they have not seen."""

import pytest
import torch

from ddf.core import shipped_models
from ddf.data import shapenet
from ddf.data.synthetic import write
from ddf.models import line_field, out_of_distribution
from ddf_lab.evaluation import card_scores


@pytest.mark.parametrize(("kind", "other"), [("chair", "car"), ("car", "chair")])
def test_a_model_tells_its_kind_from_another(tmp_path, kind, other):
    trained, far = line_field.load(shipped_models.place(kind)), {}
    assert trained.statistics is not None and trained.statistics.direction is not None
    for category in (kind, other):
        found = []
        for index in range(4):
            write.write_shape(tmp_path, 3, category, index, 3, wide=True)
            name = write.shape_id(3, category, index)
            folder = shapenet.rendering_dir(tmp_path, shapenet.synset(category), name)
            found.append(card_scores._features(trained, folder))
        far[category] = (trained.statistics.score(torch.cat(found)) >= out_of_distribution.FAR).mean()
    assert far[kind] <= 0.25 and far[other] >= 0.75
