"""Train the image GAN on one category: normals of the VAE's shapes to colours, against images of other shapes."""

import dataclasses

from ddf.core import provenance
from ddf.fields import model_files
from ddf.models import generated_images, generative_models, generative_settings
from ddf.training import generative_steps, shape_data, training_loop
from ddf_lab.engine import stage
from ddf_lab.run import Run


@stage.main(category=True)
def make(run: Run) -> None:
    gan = run.section(generative_settings.GANConfig)
    vae_dir = run.folder("train_vae")
    training_loop.prepare(gan.loop)

    images, sources = shape_data.read_pictured(run.index, run.folder("samples"), run.category)
    normals, shards = generated_images.read_normals(run.folder("normals"))
    sources += [*shards, vae_dir / model_files.MODEL]
    vae = generative_models.load_vae(vae_dir)
    model = generative_models.ImageGAN(vae.config, gan)
    model.decoder.load_state_dict(vae.decoder.state_dict())
    model.field_scale.copy_(vae.field_scale)
    model.to(model_files.device())
    record = provenance.record([gan, run.category, images.digest()], gan.loop.seed, sources, generative_steps)
    record |= {"kind": generative_models.GAN, "category": run.category}
    record |= {"gan": dataclasses.asdict(gan), "vae": dataclasses.asdict(vae.config)}
    updates, out_dir = generative_steps.image_updates(model, images, normals), run.folder("train_gan")
    groups, label = model.parameter_groups(), f"gan {run.category}"
    training_loop.fit(model, groups, updates, gan.steps, gan.loop, out_dir, record, label)
