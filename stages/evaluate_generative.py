"""Measure the generative models: held-out shapes, samples of the prior, images."""

from ddf.core import provenance, storage
from ddf.fields import model_files
from ddf.models import generative_settings
from ddf.training import training_loop
from ddf_lab.engine import stage
from ddf_lab.evaluation import generative_scores
from ddf_lab.run import Run


@stage.main(category=True)
def make(run: Run) -> None:
    """Read models, shapes and images; write scores.json and pictures.safetensors."""
    section = run.section(generative_settings.ScoresConfig)
    training_loop.prepare(section.features.loop)
    results, pictures = generative_scores.measure(run, section)
    storage.write_json(run.folder("evaluate_generative") / "scores.json", results)
    sources = [run.folder(f"train_{name}") / model_files.MODEL for name in ("vae", "gan", "gan2d", "features")]
    record = provenance.record(section, section.seed, sources, generative_scores)
    storage.save_tensors(run.folder("evaluate_generative") / "pictures.safetensors", pictures, record)
