"""Rays that a training proposes, cast on a GPU, which keeps the meshes where its memory has room; else Open3D casts.

For rays that Open3D casts on the host a step waits.
"""

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import tqdm
from jaxtyping import Float

from ddf.data.batches import category_data, resident, training_scenes
from ddf.geometry import raycast
from ddf.geometry.gpu import meshes
from ddf.models import reconstruction_settings
from ddf.training import proposed_rays

LOGGER = logging.getLogger(__name__)


def read(
    folder: Path, shapes: category_data.ShapeSet, config: reconstruction_settings.ProposalConfig | None
) -> tuple[proposed_rays.Proposer | None, list[Path]]:
    """What proposes rays, cast on the host, and the files of its meshes; None and no files without a config.

    Args:
      folder: of the stage `meshes`, for the category of the shapes.
    Raises:
      InputError: a shape is in no pack, or a pack is damaged; it is named.
    """
    if config is None:
        return None, []
    scenes = training_scenes.Scenes(folder, shapes.ids)
    return proposed_rays.Proposer(shapes, proposed_rays.HostCaster(scenes), config), scenes.paths


def moved(memory: resident.Memory, propose: proposed_rays.Proposer | None) -> proposed_rays.Proposer | None:
    """The same, with rays cast on the device, if there is one and the meshes fit there."""
    if propose is None or memory.device.type == "cpu" or not isinstance(propose.caster, proposed_rays.HostCaster):
        return propose
    refusal = meshes.refusal(memory.device)
    if refusal is not None:
        LOGGER.warning("rays are cast by Open3D on the host, so steps take longer: %s", refusal)
        return propose
    scenes = propose.caster.scenes
    steps = tqdm.trange(len(scenes), desc="meshes to the GPU", unit="shape", mininterval=2, disable=resident.silent())
    corners = [triangles(scenes[index]) for index in steps]
    counts = [len(own) for own in corners]
    if not memory.takes("meshes", 36 * int(meshes.begins_of(counts)[-1]), "with Open3D on the host"):
        return propose
    return replace(propose, caster=meshes.joined(counts, corners, memory.device))


def triangles(scene: raycast.Scene) -> Float[np.ndarray, "n 3 3"]:
    """Corners of a mesh's triangles, float32; those without an area become points, which no ray meets."""
    corners = scene.mesh.vertices.astype(np.float32)[scene.mesh.faces]
    flat = np.ones(len(corners), dtype=bool)
    flat[scene.kept] = False
    corners[flat] = corners[flat, :1]
    return corners
