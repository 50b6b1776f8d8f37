"""f_T, g_T and h_T."""

import typing

import pytest
import torch
from _support import assert_close

from ddf.fields import pddf
from ddf.models import translators


def _normals(size=16):
    """A sphere's normals in the middle, 0 around it."""
    y, x = torch.meshgrid(torch.linspace(-1.5, 1.5, size), torch.linspace(-1.5, 1.5, size), indexing="ij")
    z = (1 - x.square() - y.square()).clamp(min=0).sqrt()
    return (torch.stack((x, y, z)) * (z > 0))[None].repeat(2, 1, 1, 1)


@pytest.mark.parametrize("upsampling", typing.get_args(translators.Upsampling))
@pytest.mark.parametrize(("textures", "count"), [(64, 8_038_403), (0, 7_837_699)])
def test_the_paper_size_has_the_papers_parameters(textures, count, upsampling):
    with torch.device("meta"):
        assert pddf.count_parameters(translators.Translator(textures, upsampling=upsampling)) == count


def test_a_doubled_constant_image_is_constant_and_a_transposed_convolution_makes_dots_of_it():
    torch.manual_seed(0)
    for upsampling in typing.get_args(translators.Upsampling):
        doubled = translators._doubled(3, 2, upsampling)(torch.ones(1, 3, 8, 8)).detach()
        assert doubled.shape == (1, 2, 16, 16)
        spread = float(doubled[..., 2:-2, 2:-2].std(dim=(-1, -2)).max())
        assert (spread < 1e-6) == (upsampling == "nearest"), (upsampling, spread)


@pytest.mark.parametrize("upsampling", typing.get_args(translators.Upsampling))
def test_a_translated_image_is_as_large_as_its_input(upsampling):
    images = torch.rand(2, 3, 16, 16)
    found = translators.Translator(0, 4, upsampling=upsampling)(images).detach()
    assert found.shape == images.shape and float(found.abs().max()) <= 1


def test_the_texture_encoder_is_resnet_20():
    with torch.device("meta"):
        assert pddf.count_parameters(translators.TextureEncoder(64)) == 273_232
    assert translators.TextureEncoder(5, width=4)(torch.zeros(2, 3, 32, 32)).shape == (2, 5)


@pytest.mark.parametrize("texture_at", ["object", "everywhere"])
def test_the_first_layer_is_that_of_the_concatenated_images(texture_at):
    torch.manual_seed(0)
    network = translators.Translator(6, 4, texture_at).double()
    normals, textures = _normals().double(), torch.randn(2, 6).double()
    seen = normals.ne(0).any(dim=1, keepdim=True)
    where = seen.double() if texture_at == "object" else torch.ones_like(normals[:, :1])
    joined = torch.cat((normals, where * textures[:, :, None, None]), dim=1)
    plain = network.body(network.first(torch.nn.functional.pad(joined, (3, 3, 3, 3), mode="reflect")))
    assert_close(network(normals, textures), plain)
    assert plain.shape == normals.shape and float(plain.detach().abs().max()) <= 1


def test_a_texture_at_every_pixel_is_normalised_away_and_one_on_the_object_is_not():
    torch.manual_seed(0)
    normals, textures = _normals().double(), torch.randn(2, 6).double()
    for texture_at in typing.get_args(translators.TextureAt):
        network = translators.Translator(6, 4, texture_at).double()
        with torch.no_grad():
            network.first.weight.mul_(20)  # the normalisation's epsilon counts less
        change = float((network(normals, textures) - network(normals, -textures)).detach().abs().max())
        assert (change > 1e-4) == (texture_at == "object"), (texture_at, change)


def test_a_shortcut_keeps_its_channels_between_zeros():
    block = translators._TextureBlock(4, 8, 2)
    for parameter in block.residual[4].parameters():
        torch.nn.init.zeros_(parameter)
    images = torch.rand(1, 4, 6, 6)
    found = block(images).detach()
    assert_close(found[:, 2:6], images[:, :, ::2, ::2])
    assert float(found[:, :2].abs().max()) == float(found[:, 6:].abs().max()) == 0
