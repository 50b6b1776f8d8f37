"""How usual an image is: quantiles of known distributions, and what a model's file keeps."""

import dataclasses
import math

import _models
import numpy as np
import torch

from ddf.core import storage
from ddf.data.batches import category_data
from ddf.fields import model_files
from ddf.models import out_of_distribution, reconstruction_models


def _features(count, seed, spread=1.0):
    scales = torch.tensor([3.0, 0.5, 1.0, 0.01])
    return spread * torch.randn(count, 4, generator=torch.Generator().manual_seed(seed)) * scales + 5


def test_images_like_those_of_training_are_spread_over_all_quantiles():
    known = out_of_distribution.TrainingStatistics.of([_features(600, 0), _features(600, 3)])
    assert known is not None
    alike = known.score(torch.cat([_features(2000, 1), _features(2000, 4)], dim=1))
    assert abs(np.median(alike) - 0.5) < 0.08 and 0.01 < (alike >= out_of_distribution.FAR).mean() < 0.12
    for spread in ((10.0, 1.0), (1.0, 10.0)):  # in either stage alone
        parts = [_features(200, 5 + i, spread=each) for i, each in enumerate(spread)]
        assert (known.score(torch.cat(parts, dim=1)) >= out_of_distribution.FAR).mean() > 0.8


def test_a_distance_is_that_of_the_widened_covariance():
    features = _features(500, 0).double()
    known = out_of_distribution.TrainingStatistics.of([features])
    assert known is not None
    variance = features.var(dim=0)
    inverse = torch.linalg.inv(torch.cov(features.T) + out_of_distribution.WIDENED * variance.mean() * torch.eye(4))
    apart = features - features.mean(dim=0)
    expected = torch.einsum("ni,ij,nj->n", apart, inverse, apart).sqrt()
    shares = known.score(features)
    order = expected.argsort()
    assert (np.diff(shares[order]) >= -1e-9).all()
    np.testing.assert_allclose(float(known.distances[-1]), float(expected.max()), rtol=1e-6)


def test_one_image_alone_is_no_measure_and_a_file_of_older_words_none():
    assert out_of_distribution.TrainingStatistics.of([_features(1, 0)]) is None
    same = out_of_distribution.TrainingStatistics.of([torch.ones(5, 3)])
    assert same is not None and same.score(torch.ones(1, 3)).shape == (1,)
    old = {"known.features": torch.zeros(3, 4), "known.mean": torch.zeros(4), "head.weight": torch.ones(2)}
    weights, known = out_of_distribution.parted(old)
    assert list(weights) == ["head.weight"] and known is None


def test_the_file_keeps_what_is_known_and_the_model_loads_with_it(tmp_path):
    folder = _models.write_model(tmp_path / "model")
    assert out_of_distribution.TrainingStatistics.read(folder) is None
    model, size, _ = reconstruction_models.load_ddf(folder)
    images = torch.randint(0, 255, (6, 4, size, size), dtype=torch.uint8)
    shown = category_data.ImageSet(["a", "b", "c"], [0] * 6, np.arange(6) // 2, images, torch.zeros(6, 3))
    before, record = storage.load_tensors(folder / model_files.MODEL)
    for _ in range(2):  # a second time changes nothing
        found = out_of_distribution.TrainingStatistics.of(reconstruction_models.image_stages(model.eval(), shown))
        assert found is not None
        found.add_to(folder)
    after, kept = storage.load_tensors(folder / model_files.MODEL)
    assert {**kept, "content": 0} == {**record, "content": 0} and kept["kind"] == "ddf"
    assert set(after) - set(before) == {f"known.{name}" for name in ("mean", "factor", "distances")}
    again = reconstruction_models.load_ddf(folder).network
    assert all(torch.equal(value, again.state_dict()[name]) for name, value in model.state_dict().items())


def test_what_tells_two_normal_kinds_apart_is_fishers_direction(tmp_path):
    spread, apart = torch.tensor([[1.0, 2.0, 0.5], [1.0, 2.0, 0.0]], dtype=torch.float64)
    noise = torch.randn(8000, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64) * spread
    own, others, unseen = noise[:3000] + apart, noise[3000:6000], noise[6000:7000] + apart
    direction, likeness = out_of_distribution.told_apart(own, others, [str(i // 5) for i in range(3000)])
    fisher = apart / spread**2
    assert torch.cosine_similarity(direction.double(), fisher, dim=0) > 0.98
    folder = _models.write_model(tmp_path / "model")
    known = out_of_distribution.TrainingStatistics.of([others])
    assert known is not None
    dataclasses.replace(known, direction=direction, likeness=likeness).add_to(folder)
    read = out_of_distribution.TrainingStatistics.read(folder)
    assert read is not None
    own_kind, other_kind = read.score(unseen), read.score(noise[7000:])
    assert abs((own_kind >= 0.9).mean() - 0.1) < 0.03 and abs(np.median(own_kind) - 0.5) < 0.05
    error = 0.5 * math.erfc((1.2816 - math.sqrt(2)) / math.sqrt(2))  # Mahalanobis's distance of the kinds is √2
    assert abs((other_kind >= 0.9).mean() - error) < 0.05
