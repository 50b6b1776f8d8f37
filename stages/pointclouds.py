"""Reconstruct the test images of one category with both trained models: clouds, cameras, renders.

A run that was killed goes on from the images it had finished.
"""

from pathlib import Path

from ddf.core import config, provenance, resume, storage
from ddf.data import shapenet
from ddf.data.batches import category_data
from ddf.models.reconstruction import inference, settings, silhouettes, trained
from ddf.training import training_loop
from ddf_lab.engine import stage


def run(config_path: Path, category: str, seed: int = 0) -> None:
    """Read both models and the images of the category, write one file per model."""
    train = config.load(config_path, settings.TrainConfig)
    section = config.reseeded(config.load(config_path, settings.PointcloudsConfig), seed)
    index_path = config.artifact_dir(config_path, "dataset") / "index.json"
    samples_dir = config.artifact_dir(config_path, "samples", category)
    training_loop.prepare(train.loop)

    dataset = shapenet.Dataset.open(index_path)
    test, train_images = (
        category_data.read_images(dataset, category, category_data.available(samples_dir, views), train.image_size)
        for views in (
            category_data.test_views(dataset, category, section.test_views),
            dataset.train(category),
        )
    )
    common = {"camera_true": test.cameras, **category_data.read_shapes(samples_dir, test.ids).placements(test.shapes)}

    out = config.artifact_dir(config_path, "pointclouds", category, seed)
    for name in ("ddf", "pcsiren"):
        folder = config.artifact_dir(config_path, f"train_{name}", category, seed)
        sources = [index_path, folder / training_loop.MODEL]
        key = provenance.fingerprint([section, category, test.digest()], sources, inference)
        kept = resume.Kept(out, key)
        built = storage.load_metadata(folder / training_loop.MODEL)
        if name == "ddf":
            ddf, _ = trained.ddf(folder, built)
            features = inference.image_features(ddf, train_images)
            given = (ddf, test, section, stage.label(category, seed), silhouettes.deviation(ddf, features), kept)
            tensors, facts = inference.reconstruct_ddf(*given)
            tensors["train_features"] = features  # for the retrieval row
        else:
            pcsiren, _ = trained.pcsiren(folder, built)
            tensors, facts = inference.reconstruct_pcsiren(pcsiren, test, section)
        names = {"images": test.names(), "train_images": train_images.names()}
        record = provenance.record(key, section.seed, sources) | names | facts
        storage.save_tensors(out / f"{name}.safetensors", tensors | common, record)
        kept.clear()


if __name__ == "__main__":
    stage.main(run, __doc__, category=True, seed=True)
