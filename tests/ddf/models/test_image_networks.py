"""The critic, the 2D generator, f_T, g_T and h_T."""

import typing

import torch
from _support import assert_close
from torch import nn
from torch.nn import functional

from ddf.fields import pddf
from ddf.models import image_networks


def test_sizes_of_narrow_networks():
    torch.manual_seed(0)
    images = image_networks.Generator2D(64, 8)(torch.randn(2, 8))
    assert images.shape == (2, 3, 64, 64) and float(images.detach().abs().max()) <= 1
    assert image_networks.Critic(64)(images).shape == (2,)
    for upsampling in typing.get_args(image_networks.Upsampling):
        network = image_networks.Translator(0, 4, upsampling=upsampling)
        assert pddf.count_parameters(network) == pddf.count_parameters(image_networks.Translator(0, 4))
        found = network(images).detach()
        assert found.shape == images.shape and float(found.abs().max()) <= 1
    assert image_networks.TextureEncoder(5, width=4)(torch.zeros(2, 3, 32, 32)).shape == (2, 5)


def test_a_block_is_mimicrys_with_its_shortcut_in_the_other_order():
    torch.manual_seed(0)
    down, images = image_networks._Down(4, 6).double(), torch.randn(2, 4, 8, 8).double()
    shortcut = functional.avg_pool2d(down.shortcut(images), 2)
    assert_close(down(images), functional.avg_pool2d(down.residual[:-1](images), 2) + shortcut)
    up = image_networks._Up(4, 6).double().eval()
    wide = functional.interpolate(images, scale_factor=2, mode="bilinear", align_corners=False)
    conv = up.shortcut[0]
    assert isinstance(conv, nn.Conv2d)
    assert_close(up(images), up.residual(images) + conv(wide))


def test_the_critic_sums_over_the_last_pixels():
    torch.manual_seed(0)
    critic = image_networks.Critic(32)
    nn.init.ones_(critic.head.weight)
    with torch.no_grad():
        critic.head.bias.fill_(0.25)
        hidden = torch.relu(critic.blocks(critic.first(torch.ones(1, 3, 64, 64))))
        assert hidden.shape[-2:] == (2, 2)
        assert_close(critic(torch.ones(1, 3, 64, 64)), hidden.sum(dim=(1, 2, 3)) + 0.25)


def _normals(size=16):
    """A sphere's normals in the middle, 0 around it."""
    y, x = torch.meshgrid(torch.linspace(-1.5, 1.5, size), torch.linspace(-1.5, 1.5, size), indexing="ij")
    z = (1 - x.square() - y.square()).clamp(min=0).sqrt()
    return (torch.stack((x, y, z)) * (z > 0))[None].repeat(2, 1, 1, 1)


def test_a_doubled_constant_image_is_constant_and_a_transposed_convolution_makes_dots_of_it():
    torch.manual_seed(0)
    for upsampling in typing.get_args(image_networks.Upsampling):
        doubled = image_networks._doubled(3, 2, upsampling)(torch.ones(1, 3, 8, 8)).detach()
        assert doubled.shape == (1, 2, 16, 16)
        spread = float(doubled[..., 2:-2, 2:-2].std(dim=(-1, -2)).max())
        assert (spread < 1e-6) == (upsampling == "nearest"), (upsampling, spread)


def _concatenated(network, normals, textures):
    """The network on [normals, z_T], z_T at the pixels that see the object."""
    where = normals.ne(0).any(dim=1, keepdim=True).to(normals)
    joined = torch.cat((normals, where * textures[:, :, None, None]), dim=1)
    return network.body(network.first(functional.pad(joined, (3, 3, 3, 3), mode="reflect")))


def test_the_first_layer_is_that_of_the_concatenated_images():
    torch.manual_seed(0)
    network = image_networks.Translator(6, 4).double()
    normals, textures = _normals().double(), torch.randn(2, 6).double()
    found = network(normals, textures)
    assert_close(found, _concatenated(network, normals, textures))
    assert found.shape == normals.shape and float(found.detach().abs().max()) <= 1


def test_a_shortcut_keeps_its_channels_between_zeros():
    block = image_networks._TextureBlock(4, 8, 2)
    for parameter in block.residual[4].parameters():
        torch.nn.init.zeros_(parameter)
    images = torch.rand(1, 4, 6, 6)
    found = block(images).detach()
    assert_close(found[:, 2:6], images[:, :, ::2, ::2])
    assert float(found[:, :2].abs().max()) == float(found[:, 6:].abs().max()) == 0
