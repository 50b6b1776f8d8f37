"""Reconstruct the test images of one category with both trained models: clouds, cameras, renders.

A run that was killed goes on from the images it had finished.
"""

from pathlib import Path

from ddf import (
    config,
    portions,
    provenance,
    shapenet,
    si3dr_data,
    si3dr_inference,
    si3dr_training,
    silhouettes,
    stage,
    storage,
    training,
)


def run(config_path: Path, category: str, seed: int = 0) -> None:
    """Read both models and the images of the category, write one file per model."""
    train = config.load(config_path, "train", si3dr_training.TrainConfig)
    section = config.reseeded(config.load(config_path, "pointclouds", si3dr_inference.PointcloudsConfig), seed)
    index_path = config.artifact_dir(config_path, "dataset") / "index.json"
    samples_dir = config.artifact_dir(config_path, "samples", category)
    training.prepare(train.loop)

    dataset = shapenet.Dataset.open(index_path)
    test, trained = (
        si3dr_data.read_images(dataset, category, si3dr_data.available(samples_dir, views), train.image_size)
        for views in (
            si3dr_data.test_views(dataset, category, section.test_views),
            dataset.train(category),
        )
    )
    scales = si3dr_data.read_shapes(samples_dir, test.ids).field_scales(test.shapes)
    common = {"camera_true": test.cameras, "scale_true": 1 / scales}

    ddf = si3dr_training.ddf_model(train, config.load(config_path, "ddf", si3dr_training.DDFConfig))
    pcsiren = si3dr_training.pcsiren_model(train, config.load(config_path, "pcsiren", si3dr_training.PCSirenConfig))
    out = config.artifact_dir(config_path, "pointclouds", category, seed)
    for name, model in (("ddf", ddf), ("pcsiren", pcsiren)):
        folder = config.artifact_dir(config_path, f"train_{name}", category, seed)
        training.load_model(model, folder)
        sources = [index_path, folder / training.MODEL]
        key = provenance.fingerprint([section, category, test.digest()], sources, si3dr_inference)
        kept = portions.Kept(out, key)
        if name == "ddf":
            features = si3dr_inference.image_features(ddf, trained)
            given = (ddf, test, section, stage.label(category, seed), silhouettes.deviation(ddf, features), kept)
            tensors, facts = si3dr_inference.reconstruct_ddf(*given)
            tensors["train_features"] = features  # for the retrieval row
        else:
            tensors, facts = si3dr_inference.reconstruct_pcsiren(pcsiren, test, section)
        names = {"images": test.names(), "train_images": trained.names()}
        record = provenance.record(key, section.seed, sources) | names | facts
        storage.save_tensors(out / f"{name}.safetensors", tensors | common, record)
        kept.clear()


if __name__ == "__main__":
    stage.main(run, __doc__, category=True, seed=True)
