"""PointNet on points with normals, and the posterior of a shape latent. [DDF22] app. genmodel; Qi et al. 2017.

Widths are shares of the paper's, so that narrow networks have its form.
"""

import itertools

from jaxtyping import Float
from torch import Tensor, nn

POINT_WIDTHS = (64, 64, 128, 1024)  # of the layers that see every point by itself
CLOUD_WIDTHS = (512, 512)  # of those that see their largest values
DROPOUT = 0.1
POINT_FEATURES = 6  # position and normal


class PointEncoder(nn.Module):
    """Points with normals to features of the cloud, whatever the order of the points; no point transformers.

    width: of the first layer; 64 is the paper's, the others keep their ratio to it. Dropout is in front of the last
    layer, as in PointNet's classifier; the paper gives its probability alone.
    """

    def __init__(self, out_features: int, width: int = POINT_WIDTHS[0]) -> None:
        super().__init__()
        per_point = [POINT_FEATURES, *(share * width // POINT_WIDTHS[0] for share in POINT_WIDTHS)]
        of_cloud = [per_point[-1], *(share * width // POINT_WIDTHS[0] for share in CLOUD_WIDTHS)]
        self.points = nn.Sequential(
            *(
                nn.Sequential(nn.Conv1d(a, b, kernel_size=1), nn.BatchNorm1d(b), nn.ReLU(inplace=True))
                for a, b in itertools.pairwise(per_point)
            )
        )
        self.cloud = nn.Sequential(
            *(
                nn.Sequential(nn.Linear(a, b), nn.BatchNorm1d(b), nn.ReLU(inplace=True))
                for a, b in itertools.pairwise(of_cloud)
            ),
            nn.Dropout(DROPOUT),
            nn.Linear(of_cloud[-1], out_features),
        )

    def forward(
        self, positions: Float[Tensor, "b n 3"], normals: Float[Tensor, "b n 3"]
    ) -> Float[Tensor, "b features"]:
        """Features of clouds of the field frame."""
        joined = nn.functional.pad(positions, (0, 3)) + nn.functional.pad(normals, (3, 0))
        return self.cloud(self.points(joined.transpose(1, 2)).amax(dim=-1))


class Posterior(nn.Module):
    """q(z_s | P, N): mean and logarithm of the variance of a normal distribution, one network for each half."""

    def __init__(self, latent_features: int, width: int = POINT_WIDTHS[0]) -> None:
        super().__init__()
        self.encoder = PointEncoder(2 * latent_features, width)
        self.mean, self.log_variance = (
            nn.Sequential(
                nn.Linear(latent_features, latent_features),
                nn.ReLU(inplace=True),
                nn.Linear(latent_features, latent_features),
            )
            for _ in range(2)
        )

    def forward(
        self, positions: Float[Tensor, "b n 3"], normals: Float[Tensor, "b n 3"]
    ) -> tuple[Float[Tensor, "b z"], Float[Tensor, "b z"]]:
        """Mean and log-variance of z_s."""
        first, second = self.encoder(positions, normals).chunk(2, dim=-1)
        return self.mean(first), self.log_variance(second)


def divergence(mean: Float[Tensor, "b z"], log_variance: Float[Tensor, "b z"]) -> Float[Tensor, "b z"]:
    """KL(q ‖ N(0, I)) of every dimension, nats: (μ² + σ² - ln σ² - 1)/2. Source: Kingma and Welling 2014, app. B."""
    return 0.5 * (mean.square() + log_variance.exp() - log_variance - 1)
