"""Where the oriented points of a DDF's training come from, with their ground truth: stored, or cast while training."""

from dataclasses import dataclass
from pathlib import Path

from ddf.core import config
from ddf.data import sampling
from ddf.data.batches import category_data, host_samples, sources
from ddf.models.reconstruction import settings
from ddf.training.reconstruction import proposed_rays


@dataclass(frozen=True)
class Truth:
    """What a step of the DDF asks for its points, and what that depends on beside the stored samples.

    drawn: how fresh samples are drawn; None where none are. sources: files of the meshes, where rays are cast.
    """

    samples: sources.SampleSource
    propose: proposed_rays.Proposer | None
    drawn: sampling.SamplesConfig | None
    sources: list[Path]


def read(config_path: Path, category: str, shapes: category_data.ShapeSet, section: settings.DDFConfig) -> Truth:
    """As the section asks for it, of the given shapes, from the artefacts of `samples` and, for casting, `meshes`.

    Raises:
      InputError: a shape is in no shard, or a file is damaged; it is named.
    """
    scenes = (
        host_samples.Scenes(config.artifact_dir(config_path, "meshes", category), shapes.ids) if section.casts else None
    )
    drawn = config.load(config_path, sampling.SamplesConfig) if section.samples == "fresh" else None
    if scenes and drawn:
        samples = host_samples.FreshSamples(scenes, drawn)
    else:
        samples = category_data.read_samples(config.artifact_dir(config_path, "samples", category), shapes.ids)
    propose = None
    if scenes and section.proposals:
        propose = proposed_rays.Proposer(shapes, proposed_rays.HostCaster(scenes), section.proposals)
    return Truth(samples, propose, drawn, scenes.paths if scenes else [])
