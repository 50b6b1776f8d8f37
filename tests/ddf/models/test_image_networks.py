"""The critic and the 2D generator."""

import torch
from _support import assert_close
from torch import nn
from torch.nn import functional

from ddf.fields import pddf
from ddf.models import image_networks


def test_the_paper_size_has_the_papers_parameters():
    with torch.device("meta"):
        assert pddf.count_parameters(image_networks.Critic()) == 10_141_441
        assert pddf.count_parameters(image_networks.Generator2D()) == 12_220_675


def test_sizes_of_narrow_networks():
    torch.manual_seed(0)
    images = image_networks.Generator2D(64, 8)(torch.randn(2, 8))
    assert images.shape == (2, 3, 64, 64) and float(images.detach().abs().max()) <= 1
    assert image_networks.Critic(64)(images).shape == (2,)


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
