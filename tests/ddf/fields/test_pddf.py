import dataclasses

import pytest
import torch

from ddf.core import checks
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


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("direction_scale", each) for each in (0.0, -1.0, float("inf"), float("nan"))),
        ("components", 0),
        ("components", 5),
    ],
)
def test_impossible_settings_are_refused(name, value):
    with pytest.raises(checks.InputError, match=name):
        dataclasses.replace(CONFIG, **{name: value})


def test_three_components_give_the_depth_of_the_heaviest_and_one_needs_no_weights():
    three, one = (pddf.PDDF(dataclasses.replace(CONFIG, depth_activation="relu", components=k)) for k in (3, 1))
    half = float(torch.log(torch.tensor(2.0)))
    raw = torch.tensor([[1.0, 2.0, 4.0, half, 0.0, 9.0], [1.0, 2.0, 4.0, -1.0, -half, -9.0]])
    torch.testing.assert_close(three.depth(raw), torch.tensor([1.0, 4.0]))
    assert pddf.heavier_rows(raw).tolist() == [[1, 0, 0], [0, 0, 1]]
    torch.testing.assert_close(pddf.weights(raw)[0], torch.tensor([0.5, 0.25, 0.25]))
    torch.testing.assert_close(pddf.margin(raw), torch.tensor([half, half]))
    assert bool((pddf.visibility(raw) > 0.5).tolist() == [True, False])
    raw = torch.tensor([[3.0, 9.0]])
    assert (one.depth(raw).item(), pddf.heavier_rows(raw).item(), pddf.weights(raw).item()) == (3, 1, 1)
    assert pddf.margin(raw).item() == float("inf")
    assert [part.network.head.out_features for part in (one, three)] == [2, 6]
