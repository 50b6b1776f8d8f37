"""Train the 2D GAN that the image GAN is compared with: noise to colours, the same critic and images."""

from ddf.core import distributed, provenance
from ddf.fields import model_files
from ddf.models import generative_settings, image_gans
from ddf.training import gan_steps, shape_data, training_loop
from ddf_lab.engine import stage
from ddf_lab.run import Run


@stage.main(category=True)
@distributed.shared
def make(run: Run) -> None:
    """Read images, train, write model and log."""
    gan = run.section(generative_settings.GANConfig)
    training_loop.prepare(gan.loop, gan.batch_size)

    images, sources = shape_data.read_pictured(run.index, run.folder("samples"), run.category)
    model = image_gans.NoiseGAN(gan).to(model_files.device())
    record = provenance.record([gan, run.category, images.digest()], gan.loop.seed, sources, gan_steps)
    training_loop.fit(
        model,
        model.parameter_groups(),
        gan_steps.noise_updates(model, images),
        gan.steps,
        gan.loop,
        run.folder("train_gan2d"),
        record | gan_steps.record(gan, image_gans.KIND_2D, run.category),
        f"2D gan {run.category}",
    )
