"""How usual an image is: quantiles of known distributions, and what a model's file keeps."""

import _models
import numpy as np
import torch

from ddf.core import storage
from ddf.reconstruction import category_data, familiarity, one_image, trained
from ddf.training import training_loop


def _features(count, seed, spread=1.0):
    scales = torch.tensor([3.0, 0.5, 1.0, 0.01])
    return spread * torch.randn(count, 4, generator=torch.Generator().manual_seed(seed)) * scales + 5


def test_images_like_those_of_training_are_spread_over_all_quantiles():
    known = familiarity.measure(_features(600, 0), np.arange(600) // 3)
    alike = familiarity.quantile(known, _features(2000, 1))
    assert abs(np.median(alike) - 0.5) < 0.08 and 0.002 < (alike >= familiarity.FAR).mean() < 0.03
    far = familiarity.quantile(known, _features(200, 2, spread=10.0))
    assert (far >= familiarity.FAR).mean() > 0.9


def test_views_of_one_shape_are_no_measure_of_each_other():
    twins = _features(100, 0).repeat_interleave(2, dim=0)
    known = familiarity.measure(twins, np.arange(200) // 2)
    assert float(known["known.distances"].min()) > 0
    assert familiarity.measure(twins, np.zeros(200, dtype=int)) == {}


def test_the_file_keeps_what_is_known_and_the_model_loads_with_it(tmp_path):
    folder = _models.write_model(tmp_path / "model")
    assert trained.known(folder) == {}
    model, size = one_image.load(folder)
    images = [torch.randint(0, 255, (4, size, size), dtype=torch.uint8) for _ in range(6)]
    shown = category_data.ImageSet(["a", "b", "c"], [0] * 6, np.arange(6) // 2, images, torch.zeros(6, 3))
    before, record = storage.load_tensors(folder / training_loop.MODEL)
    for _ in range(2):  # a second time changes nothing
        trained.add_known(model, shown, folder)
    after, kept = storage.load_tensors(folder / training_loop.MODEL)
    assert {**kept, "content": 0} == {**record, "content": 0} and kept["kind"] == "ddf"
    assert set(after) - set(before) == {f"known.{name}" for name in ("mean", "factor", "features", "distances")}
    again, _ = one_image.load(folder)
    assert all(torch.equal(value, again.state_dict()[name]) for name, value in model.state_dict().items())
