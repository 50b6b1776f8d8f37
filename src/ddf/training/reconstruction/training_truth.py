"""Where the oriented points of a DDF's training come from, with their ground truth: stored, or cast while training."""

from dataclasses import dataclass
from pathlib import Path

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


def read(
    shapes: category_data.ShapeSet,
    section: settings.DDFConfig,
    drawn: sampling.SamplesConfig,
    samples_dir: Path,
    meshes_dir: Path,
) -> Truth:
    """As the section asks for it, of the given shapes.

    Args:
      drawn: how fresh samples are drawn. samples_dir: of stored ones. meshes_dir: of meshes to cast rays on.
    Raises:
      InputError: a shape is in no shard, or a file is damaged; it is named.
    """
    scenes = host_samples.Scenes(meshes_dir, shapes.ids) if section.casts else None
    fresh = section.samples == "fresh"
    if scenes and fresh:
        samples = host_samples.FreshSamples(scenes, drawn)
    else:
        samples = category_data.read_samples(samples_dir, shapes.ids)
    propose = None
    if scenes and section.proposals:
        propose = proposed_rays.Proposer(shapes, proposed_rays.HostCaster(scenes), section.proposals)
    return Truth(samples, propose, drawn if fresh else None, scenes.paths if scenes else [])
