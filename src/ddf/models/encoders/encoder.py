"""What reconstruction reads of an encoder, whatever network it is."""

from jaxtyping import Float
from torch import Tensor, nn

IMAGE_CHANNELS = 4


class Encoder(nn.Module):
    """RGBA images in [0, 1] to a latent or to camera scores.

    A kind of encoder is made with (out_features, width) and has `stages` and `fc`, the linear layer at the end.
    """

    fc: nn.Linear

    def stages(self, images: Float[Tensor, "b 4 h w"]) -> tuple[Float[Tensor, "b _"], ...]:
        """Pooled features of one stage or more. `fc` takes the last; all tell how usual an image is (`familiarity`)."""
        raise NotImplementedError

    def features(self, images: Float[Tensor, "b 4 h w"]) -> Float[Tensor, "b features"]:
        """Pooled features, before the last linear layer."""
        return self.stages(images)[-1]

    def forward(self, images: Float[Tensor, "b 4 h w"]) -> Float[Tensor, "b out"]:
        """Latent or camera scores of each image."""
        return self.fc(self.features(images))
