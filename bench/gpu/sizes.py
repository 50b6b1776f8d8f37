"""What the GPU check measures on: the sizes of configs/paper.yaml, or tiny ones that try the check itself."""

import dataclasses
from dataclasses import dataclass

from ddf.fields import cloud_projection
from ddf.models import reconstruction_settings

DIRECTIONS, CYCLES = 16, 3  # n_v and N_H of the timed cloud
EVENLY = {"jitter": 0.2, "recheck": (0.1,), "spread": 0.75, "crowding": 1.0, "least_confidence": 0.1, "aimed": 0.5}
PROPOSALS = reconstruction_settings.ProposalConfig()


@dataclass(frozen=True)
class Sizes:
    """Sections of an experiment, and how much of everything is measured.

    fields: hidden layers of the fields whose rays are timed, by name. rays: of a timed query. cloud_points: of the
    timed cloud. repeats: timed calls of each kind. corrected_images: whose cameras are corrected together.
    compared_images: of the step that is made on the CPU too. proposals: of the steps that have some; as in
    configs/cpu.yaml. cast_meshes, cast_rays, cast_triangles: of a timed cast, rays and triangles of each mesh.
    """

    train: reconstruction_settings.TrainConfig
    ddf: reconstruction_settings.DDFConfig
    pcsiren: reconstruction_settings.PCSirenConfig
    cloud: cloud_projection.CloudConfig
    correction: reconstruction_settings.CorrectionConfig
    fields: dict[str, tuple[int, ...]]
    rays: int = 2**20
    cloud_points: int = 5000
    repeats: int = 8
    corrected_images: int = 64
    compared_images: int = 2
    proposals: reconstruction_settings.ProposalConfig = PROPOSALS
    cast_meshes: int = 32
    cast_rays: int = 4600
    cast_triangles: int = 10_000

    @property
    def sections(self) -> dict[str, reconstruction_settings.DDFConfig | reconstruction_settings.PCSirenConfig]:
        """Of both models by name."""
        return {"ddf": self.ddf, "pcsiren": self.pcsiren}


def full() -> Sizes:
    """Of configs/paper.yaml, with a cloud of fewer directions."""
    train, clouds = reconstruction_settings.TrainConfig(), reconstruction_settings.PointcloudsConfig()
    return Sizes(
        train,
        reconstruction_settings.DDFConfig(),
        reconstruction_settings.PCSirenConfig(),
        dataclasses.replace(clouds.cloud, num_directions=DIRECTIONS, cycles=CYCLES),
        clouds.correction,
        {"paper's widths": train.decoder.hidden, "4 x 192": (192,) * 4},
    )


def tiny() -> Sizes:
    """The same in seconds on a CPU; its figures say nothing."""
    whole, hidden = full(), (16, 12)
    loop = dataclasses.replace(whole.train.loop, threads=1)
    decoder = dataclasses.replace(whole.train.decoder, hidden=hidden)
    counts = dict.fromkeys(whole.ddf.counts, 6)
    return Sizes(
        dataclasses.replace(
            whole.train, image_size=32, encoder_width=4, latent_features=6, batch_size=2, decoder=decoder, loop=loop
        ),
        dataclasses.replace(whole.ddf, counts=counts, mask_size=8),
        dataclasses.replace(whole.pcsiren, points=20, truth_points=20),
        dataclasses.replace(whole.cloud, num_directions=4, cycles=2),
        dataclasses.replace(whole.correction, steps=2, mask_size=8),
        {"tiny": hidden},
        rays=256,
        cloud_points=50,
        repeats=2,
        corrected_images=2,
        proposals=dataclasses.replace(PROPOSALS, points=6),
        cast_meshes=2,
        cast_rays=20,
        cast_triangles=200,
    )
