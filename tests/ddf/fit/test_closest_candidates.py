"""g_v of a fitted field: trained against it, resumed like every training, and better than where it began."""

import _models
import pytest
import torch
from _support import assert_close

from ddf.fields import shape_field, udf
from ddf.fit import closest_candidates
from ddf.models import loop_config

CONFIG = closest_candidates.CandidateConfig(
    loop_config.LoopConfig(3e-3, "constant", 0, None, 1, 0, 10, 0.0), steps=60, points=64, hidden=(16, 16)
)


@pytest.fixture(scope="module")
def shape(tmp_path_factory):
    return shape_field.load(_models.write_shape_field(tmp_path_factory.mktemp("field")))


def _loss(shape, network):
    lower, upper = (torch.from_numpy(side).float() for side in (shape.lower, shape.upper))
    positions = lower + torch.rand((500, 3), generator=torch.Generator().manual_seed(9)) * (upper - lower)
    with torch.no_grad():
        return float(udf.loss(closest_candidates.asked(shape.field), positions, network(positions)))


def test_training_lowers_the_loss_and_leaves_the_field_alone(shape, tmp_path):
    before = {name: value.clone() for name, value in shape.field.state_dict().items()}
    torch.manual_seed(0)
    start = _loss(shape, CONFIG.network())
    network = closest_candidates.fit(shape, CONFIG, tmp_path)
    assert _loss(shape, network) < start - 0.01
    for name, value in shape.field.state_dict().items():
        assert torch.equal(value, before[name])


def test_a_field_answers_for_any_leading_axes(shape):
    ask = closest_candidates.asked(shape.field)
    positions, directions = _models.points(12)
    flat, shaped = ask(positions, directions, True), ask(positions.view(3, 4, 3), directions.view(3, 4, 3), True)
    assert_close(shaped.depth.reshape(-1), flat.depth)
    assert flat.normals is not None and shaped.normals is not None
    assert_close(shaped.normals.reshape(-1, 3), flat.normals)
    assert ask(positions, directions, False).normals is None
