"""Train the image network whose features the scores are taken on, on images of the VAE's shapes."""

import functools
from pathlib import Path

from ddf.core import config, distributed, provenance
from ddf.models.generative import settings
from ddf.training import training_loop
from ddf.training.generative import image_features, shape_data
from ddf_lab.engine import stage


def run(config_path: Path, category: str) -> None:
    """Read images, train, write model and log."""
    section = config.load(config_path, settings.ScoresConfig).features
    index_path = config.artifact_dir(config_path, "dataset") / "index.json"
    samples_dir = config.artifact_dir(config_path, "samples", category)
    training_loop.prepare(section.loop, section.batch_size)

    images, sources = shape_data.read_sampled(index_path, samples_dir, category, section.views)
    model = image_features.FeatureNetwork(section, len(images.ids)).to(training_loop.device())
    fingerprint = provenance.fingerprint([section, category, images.digest()], sources, [image_features])
    training_loop.fit(
        model,
        model.parameter_groups(),
        functools.partial(image_features.step_loss, model, images),
        section.steps,
        section.loop,
        config.artifact_dir(config_path, "train_features", category),
        provenance.record(fingerprint, section.loop.seed, sources)
        | image_features.description(section, category, len(images.ids)),
        f"features {category}",
    )


if __name__ == "__main__":
    stage.main(distributed.shared(run), __doc__, category=True)
