import dataclasses

import pytest
import torch

from ddf.core import checks, config
from ddf.fields import pddf

CONFIG = pddf.PDDFConfig((16, 12), 3.0, 1.0, "softplus", 100.0)


def test_direction_scale_narrows_the_first_weights_of_directions_alone():
    networks = []
    for scale in (1.0, 0.25):
        torch.manual_seed(0)
        networks.append(pddf.PDDF(dataclasses.replace(CONFIG, direction_scale=scale)).state_dict())
    plain, scaled = networks
    first = "network.layers.0.weight"
    assert torch.equal(scaled[first][:, :3], plain[first][:, :3])
    assert torch.equal(scaled[first][:, 3:], 0.25 * plain[first][:, 3:])
    assert all(torch.equal(scaled[name], plain[name]) for name in plain if name != first)


@pytest.mark.parametrize(("axis", "mirror"), list(enumerate(pddf.AXES)))
def test_mirrored_field_says_of_mirror_images_what_it_says_of_rays_until_told_apart(axis, mirror):
    torch.manual_seed(0)
    field = pddf.PDDF(dataclasses.replace(CONFIG, mirror=mirror)).requires_grad_(False)
    positions, directions = torch.randn(2, 40, 3, generator=torch.Generator().manual_seed(1)).unbind()
    flip = torch.ones(3)
    flip[axis] = -1.0
    image = positions * flip, directions * flip
    behind = directions[:, axis] < 0
    assert 0 < int(behind.sum()) < 40
    asked = field.inputs(positions, directions)
    assert torch.equal(asked[~behind], torch.cat((positions, directions, torch.ones(40, 1)), dim=-1)[~behind])
    assert torch.equal(asked[behind], torch.cat((*image, -torch.ones(40, 1)), dim=-1)[behind])
    assert torch.equal(field(positions, directions), field(*image))
    assert not torch.isclose(field(positions, directions), field(positions, image[1])).all(dim=-1).any()
    field.network.layers[0].weight[:, pddf.SIDE] = 0.3
    assert not torch.isclose(field(positions, directions), field(*image)).all(dim=-1).any()
    directions[:, axis] = torch.tensor([0.0, -0.0]).repeat(20)  # in the plane: nothing is turned
    assert torch.equal(field.inputs(positions, directions)[:, :3], positions)


def test_impossible_mirror_is_refused():
    with pytest.raises(checks.InputError, match=r"ddf\.field\.mirror must be one of x, y, z; got 'w'"):
        config.parse(dataclasses.asdict(CONFIG) | {"hidden": [4], "mirror": "w"}, pddf.PDDFConfig, "ddf.field")


@pytest.mark.parametrize("scale", [0.0, -1.0, float("inf"), float("nan")])
def test_impossible_direction_scale_is_refused(scale):
    with pytest.raises(checks.InputError, match="direction_scale must be > 0 and finite"):
        dataclasses.replace(CONFIG, direction_scale=scale)
