"""Rays of a training cast on a GPU, which keeps the meshes where its memory has room for them; else Open3D casts.

For rays that Open3D casts on the host a step waits.
"""

import logging
from dataclasses import replace

import tqdm

from ddf.data import sampling
from ddf.data.batches import fresh_samples, host_samples, resident, sources
from ddf.geometry import raycast
from ddf.geometry.gpu import meshes
from ddf.training.reconstruction import proposed_rays, training_steps

LOGGER = logging.getLogger(__name__)


def moved(
    memory: resident.Memory, samples: sources.SampleSource, propose: training_steps.Proposer | None
) -> tuple[sources.SampleSource, training_steps.Proposer | None]:
    """Both, with rays cast on the device, if they cast any and the meshes fit there."""
    scenes = _cast_on_the_host(samples, propose)
    if memory.device.type == "cpu" or scenes is None:
        return samples, propose
    refusal = meshes.refusal(memory.device)
    if refusal is not None:
        LOGGER.warning("rays are cast by Open3D on the host, so steps take longer: %s", refusal)
        return samples, propose
    fresh = samples if isinstance(samples, host_samples.FreshSamples) else None
    grounds = read_grounds(scenes, fresh.config if fresh else sampling.SamplesConfig())
    size = int(meshes.begins_of(grounds.counts)[-1]) * (36 + 4 * bool(fresh))
    if not memory.takes("meshes", size, "with Open3D on the host"):
        return samples, propose
    held = fresh_samples.held_meshes(grounds, memory.device)
    if fresh:
        samples = fresh_samples.cast_samples(held, grounds, fresh.config)
    return samples, replace(propose, caster=held) if isinstance(propose, proposed_rays.Proposer) else propose


def read_grounds(scenes: sources.Listed[raycast.Scene], config: sampling.SamplesConfig) -> fresh_samples.GroundFile:
    """The triangles of all meshes, and what samples of this config are drawn from."""
    grounds = fresh_samples.GroundFile(config)
    for index in tqdm.trange(
        len(scenes), desc="meshes to the GPU", unit="shape", mininterval=2, disable=resident.silent()
    ):
        grounds.append(scenes[index])
    return grounds


def _cast_on_the_host(
    samples: sources.SampleSource, propose: training_steps.Proposer | None
) -> sources.Listed[raycast.Scene] | None:
    """The scenes that rays are cast on, shape after shape; None where none are."""
    if isinstance(samples, host_samples.FreshSamples):
        return samples.scenes
    if isinstance(propose, proposed_rays.Proposer) and isinstance(propose.caster, proposed_rays.HostCaster):
        return propose.caster.scenes
    return None
