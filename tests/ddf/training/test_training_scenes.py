"""The training meshes that rays are cast on."""

import _shapes
import numpy as np
import pytest

from ddf.core import checks, storage
from ddf.data.batches import category_data
from ddf.geometry import transforms
from ddf.models import reconstruction_settings
from ddf.training import proposed_rays


@pytest.fixture
def packs(tmp_path):
    for number, name in enumerate(("a", "b", "c")):
        mesh = _shapes.icosphere(1, 0.2 * (number + 1))
        tensors = {
            "vertices": mesh.vertices.astype(np.float32),
            "faces": mesh.faces.astype(np.int32),
            "ends": np.array([[len(mesh.vertices), len(mesh.faces)]]),
        }
        record = {"ids": [name], "field_from_raw": {name: transforms.Similarity(1.0).to_dict()}, "measures": [{}]}
        storage.save_tensors(tmp_path / f"{number:03d}.meshes.safetensors", tensors, record)
        storage.write_json(tmp_path / f"{number:03d}.json", {"files": {f"{number:03d}.meshes.safetensors": ""}})
    return tmp_path


def test_scenes_are_in_the_order_asked_for_however_few_packs_are_open(packs, monkeypatch):
    monkeypatch.setattr(proposed_rays, "OPEN_PACKS", 1)
    scenes = proposed_rays.Scenes(packs, ["c", "a"])
    for index, radius in ((0, 0.6), (1, 0.2), (0, 0.6)):
        depth, _ = scenes[index].first_hits(np.array([[0.01, 0.02, 1.0]]), np.array([[0.0, 0.0, -1.0]]))
        assert float(depth[0]) == pytest.approx(1 - radius, abs=0.1 * radius)
    with pytest.raises(checks.InputError, match="no prepared mesh of shape d"):
        proposed_rays.Scenes(packs, ["a", "d"])


def test_meshes_are_read_where_rays_are_proposed_alone(packs):
    shapes = category_data.ShapeSet.of(["c", "a"], [transforms.Similarity(1.0)] * 2, [np.zeros((5, 3))] * 2)
    proposals = reconstruction_settings.ProposalConfig(4, 2)
    propose, files = proposed_rays.Proposer.read(packs, shapes, proposals)
    assert propose is not None and (propose.config, files) == (proposals, sorted(packs.glob("*.safetensors")))
    assert proposed_rays.Proposer.read(packs / "none", shapes, None) == (None, [])
