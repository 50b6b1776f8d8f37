"""A conditional field rendered: each output alone, depth from the camera."""

import torch

from ddf.fields import pddf, rendering
from ddf.geometry import cameras, transforms

FIELD = pddf.PDDFConfig((16, 16), 2.0, 1.0, "softplus", 10.0)


def _field():
    torch.manual_seed(0)
    return pddf.PDDF(FIELD)


def _camera():
    return torch.tensor([0.9, 0.45, 0.8]), torch.tensor(2.6)


def test_each_output_is_that_of_all_together_and_nothing_else():
    field, (camera, scale) = _field(), _camera()
    together, queries = rendering.render(field, None, camera, scale, 24)
    assert set(together) == {"visibility", "depth", "normals"}
    for name, expected in together.items():
        alone, same = rendering.render(field, None, camera, scale, 24, [name])
        assert same == queries
        assert set(alone) == {name}
        torch.testing.assert_close(alone[name], expected)


def test_depth_is_measured_from_the_camera():
    field, (camera, scale) = _field(), _camera()
    images, _ = rendering.render(field, None, camera, scale, 32, ["depth"])
    directions = cameras.pixel_directions(32, camera).reshape(-1, 3)
    entry, world, distance, meets = rendering.field_rays(camera, scale, directions)
    expected = field.depth(field(entry[meets], world[meets])) + distance[meets]
    torch.testing.assert_close(images["depth"].reshape(-1)[meets], expected)
    origin = cameras.position(camera[0], camera[1], camera[2]) * scale / transforms.BENCHMARK_FROM_V1
    torch.testing.assert_close(origin + distance[meets, None] * world[meets], entry[meets], rtol=0, atol=1e-5)
    shift = torch.tensor([-0.3, 0.0, 0.2])  # of a shape off the origin of v1
    entry, world, distance, meets = rendering.field_rays(camera, scale, directions, shift)
    torch.testing.assert_close((origin + shift + distance[:, None] * world)[meets], entry[meets], rtol=0, atol=1e-5)
