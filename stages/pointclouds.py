"""Reconstruct the test images of one category with all trained models: clouds, cameras, renders."""

from ddf.core import provenance, storage
from ddf.data import shapenet
from ddf.data.batches import category_data
from ddf.fields import model_files
from ddf.models import line_field, reconstruction_models, reconstruction_settings
from ddf.reconstruction import line_cameras, line_clouds, many_images, mask_descent, three_views
from ddf.training import training_loop
from ddf_lab.engine import stage
from ddf_lab.run import Run


@stage.main(category=True, seed=True)
def make(run: Run) -> None:
    """Read the models and the images of the category, write one file per model."""
    train = run.section(reconstruction_settings.TrainConfig)
    section = run.reseeded(reconstruction_settings.PointcloudsConfig)
    samples_dir = run.folder("samples")
    training_loop.prepare(train.loop)

    dataset = shapenet.Dataset.open(run.index)
    test, train_images = (
        category_data.read_images(dataset, run.category, category_data.available(samples_dir, views), train.image_size)
        for views in (
            category_data.test_views(dataset, run.category, section.test_views, section.public_views),
            dataset.views(run.category, "train"),
        )
    )
    shapes = category_data.read_shapes(samples_dir, test.ids)
    common = {"camera_true": test.cameras, **shapes.placements(test.shapes)}

    out = run.folder("pointclouds", seed=run.seed)
    for name in ("ddf", "pcsiren", "ddf_image"):
        folder = run.folder(f"train_{name}", seed=run.seed)
        sources = [run.index, folder / model_files.MODEL]
        record = provenance.record(
            [section, run.category, test.digest()],
            section.seed,
            sources,
            (many_images, line_clouds, line_cameras, three_views),
        )
        if name == "ddf":
            ddf = reconstruction_models.load_ddf(folder).network
            features = reconstruction_models.image_stages(ddf, train_images)[-1]
            given = (ddf, test, section, run.label, mask_descent.latent_deviation(ddf, features))
            tensors, facts = many_images.reconstruct_ddf(*given)
            tensors["train_features"] = features  # for the retrieval row
            several = three_views.of_latents(ddf, test, shapes, section)
        elif name == "pcsiren":
            pcsiren, _ = reconstruction_models.load_pcsiren(folder)
            tensors, facts = many_images.reconstruct_pcsiren(pcsiren, test, section)
            several = three_views.of_latents(pcsiren, test, shapes, section)
        else:
            image_model = line_field.load(folder).network
            tensors, facts = line_clouds.reconstruct(image_model, test, section)
            moved = line_cameras.reconstruct(image_model, test, section, tensors["camera_pred"])
            tensors, facts["seconds"]["camera_correction"] = tensors | moved[0], moved[1]
            several = three_views.of_features(image_model, test, section)
        names = {"images": test.names(), "train_images": train_images.names()}
        tensors, facts = common | tensors | several[0], facts | several[1]
        storage.save_tensors(out / f"{name}.safetensors", tensors, record | names | facts)
