"""PointNet and the posterior of a shape latent."""

import pytest
import torch
from _support import assert_close

from ddf.fields import pddf
from ddf.models import point_encoder


def _cloud(count=50):
    generator = torch.Generator().manual_seed(0)
    return torch.randn((2, count, 3), generator=generator), torch.randn((2, count, 3), generator=generator)


def test_the_paper_size_has_the_papers_parameters():
    with torch.device("meta"):
        posterior = point_encoder.Posterior(400)
    encoder = pddf.count_parameters(posterior.encoder)
    assert (encoder, pddf.count_parameters(posterior) - encoder) == (1_347_488, 641_600)


def test_the_order_of_the_points_does_not_count_and_normals_do():
    torch.manual_seed(0)
    posterior = point_encoder.Posterior(8, width=16).eval()
    positions, normals = _cloud()
    turned = torch.randperm(50)
    mean, log_variance = posterior(positions, normals)
    assert_close(posterior(positions[:, turned], normals[:, turned])[0], mean)
    assert float((posterior(positions, -normals)[0] - mean).detach().abs().max()) > 1e-3
    assert mean.shape == log_variance.shape == (2, 8)


def test_divergence_has_its_closed_form_and_agrees_with_torch():
    assert_close(point_encoder.divergence(torch.zeros(1, 3), torch.zeros(1, 3)), torch.zeros(1, 3))
    assert float(point_encoder.divergence(torch.tensor([[2.0]]), torch.zeros(1, 1))) == pytest.approx(2.0)
    mean, log_variance = torch.tensor([[0.3, -1.2]]), torch.tensor([[-0.7, 0.4]])
    own = torch.distributions.Normal(mean, (0.5 * log_variance).exp())
    wanted = torch.distributions.kl_divergence(own, torch.distributions.Normal(0.0, 1.0))
    assert_close(point_encoder.divergence(mean, log_variance), wanted)
