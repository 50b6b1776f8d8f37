"""Measure the generative models: held-out shapes, samples of the prior, images, and colours when the camera moves."""

from pathlib import Path

from ddf.core import config, provenance, storage
from ddf.models.generative import settings
from ddf.training import training_loop
from ddf_lab.engine import stage
from ddf_lab.evaluation.generative import generative_results


def run(config_path: Path, category: str) -> None:
    """Read models, shapes and images; write scores.json and pictures.safetensors."""
    section = config.load(config_path, settings.ScoresConfig)
    out_dir = config.artifact_dir(config_path, "evaluate_generative", category)
    trained = {"vae": "train_vae", "gan": "train_gan", "gan2d": "train_gan2d", "features": "train_features"}
    folders = {name: config.artifact_dir(config_path, stage_name, category) for name, stage_name in trained.items()}
    places = generative_results.Places(
        index=config.artifact_dir(config_path, "dataset") / "index.json",
        samples=config.artifact_dir(config_path, "samples", category),
        out=out_dir,
        **folders,
    )
    training_loop.prepare(section.features.loop)
    results, pictures = generative_results.measure(places, category, section)
    storage.write_json(out_dir / "scores.json", results)
    sources = [folder / training_loop.MODEL for folder in folders.values()]
    fingerprint = provenance.fingerprint(section, sources, [generative_results])
    record = provenance.record(fingerprint, section.seed, sources)
    storage.save_tensors(out_dir / "pictures.safetensors", pictures, record)


if __name__ == "__main__":
    stage.main(run, __doc__, category=True)
