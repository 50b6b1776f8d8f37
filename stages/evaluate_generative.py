"""Measure the generative models: held-out shapes, samples of the prior, images, and colours when the camera moves."""

from ddf.core import provenance, storage
from ddf.models.generative import settings
from ddf.training import training_loop
from ddf_lab.engine import stage
from ddf_lab.evaluation.generative import generative_results
from ddf_lab.run import Run


def make(run: Run) -> None:
    """Read models, shapes and images; write scores.json and pictures.safetensors."""
    section = run.section(settings.ScoresConfig)
    out_dir = run.folder("evaluate_generative")
    trained = {"vae": "train_vae", "gan": "train_gan", "gan2d": "train_gan2d", "features": "train_features"}
    folders = {name: run.folder(stage_name) for name, stage_name in trained.items()}
    places = generative_results.Places(
        index=run.index,
        samples=run.folder("samples"),
        out=out_dir,
        **folders,
    )
    training_loop.prepare(section.features.loop)
    results, pictures = generative_results.measure(places, run.category, section)
    storage.write_json(out_dir / "scores.json", results)
    sources = [folder / training_loop.MODEL for folder in folders.values()]
    record = provenance.record(section, section.seed, sources, generative_results)
    storage.save_tensors(out_dir / "pictures.safetensors", pictures, record)


if __name__ == "__main__":
    stage.main(make, __doc__, category=True)
