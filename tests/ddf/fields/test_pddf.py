import dataclasses

import torch

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
