"""Rays that a model in training proposes, and the meshes that they are cast on."""

import dataclasses

import _shapes
import numpy as np
import pytest
import torch
from _sphere_field import Sphere

from ddf.core import checks, storage
from ddf.data.batches import category_data
from ddf.data.samples import sample_batch, sample_types
from ddf.geometry import raycast, transforms
from ddf.models import reconstruction_settings
from ddf.training import proposed_rays

CONFIG = reconstruction_settings.ProposalConfig(20, 6)
RADII = (0.4, 0.8)


def _propose(settings=CONFIG, chosen=(1, 0, 1), field=None):
    """Beside one stored sample of each type, all 0."""
    counts: dict[str, int] = dict.fromkeys(sample_types.ORDER, 1)
    zeros = torch.zeros(len(chosen), len(counts), 3)
    stored = sample_batch.SampleBatch(zeros, zeros, zeros[..., 0], zeros[..., 0], zeros, counts)
    unit = torch.nn.functional.normalize(torch.randn(50, 3, generator=torch.Generator().manual_seed(1)), dim=-1)
    clouds = [(radius * unit).numpy() for radius in RADII]
    shapes = category_data.ShapeSet.of(["small", "large"], [transforms.Similarity(1.0)] * 2, clouds)
    scenes = [raycast.Scene(_shapes.icosphere(4, radius)) for radius in RADII]
    propose = proposed_rays.Proposer(shapes, scenes, settings)
    modulations = [torch.tensor([RADII[shape] for shape in chosen]).view(-1, 1, 1).requires_grad_()]
    return propose(stored, field or Sphere(), modulations, np.array(chosen), np.random.default_rng(0))


def test_truth_is_that_of_each_shape_and_only_the_candidates_are_asked_for():
    field = Sphere()
    batch = _propose(field=field)
    assert field.queries == 3 * 20 * 6
    rows = batch.span("P", "P")
    assert batch.counts == {**dict.fromkeys(sample_types.ORDER, 1), "P": 20}
    assert (rows.start, rows.stop) == (7, 27)
    positions, directions = batch.positions[:, rows], batch.directions[:, rows]
    torch.testing.assert_close(directions.norm(dim=-1), torch.ones(3, 20))
    radius = torch.tensor([0.8, 0.4, 0.8]).view(3, 1, 1)
    raw = Sphere()(positions, directions, [radius])
    seen, clear = batch.visible[:, rows] > 0, _clearance(positions, directions, radius) > 0.01
    assert torch.equal(seen[clear], (raw[..., 3] > 0)[clear])
    torch.testing.assert_close(batch.depth[:, rows][seen & clear], raw[..., 0][seen & clear], atol=0.01, rtol=0)
    assert bool((batch.depth[:, rows][~seen] == 0).all())
    assert not batch.directions.requires_grad


def _clearance(positions, directions, radius):
    """How far from the sphere's outline, and how far from its surface, a ray passes and starts."""
    along = (positions * directions).sum(-1, keepdim=True)
    passing = (positions - along * directions).norm(dim=-1) - radius[..., 0]
    return torch.minimum(passing.abs(), (positions.norm(dim=-1) - radius[..., 0]).abs())


def test_more_candidates_lead_to_nearer_surfaces(monkeypatch):
    monkeypatch.setattr(proposed_rays, "NEAR", 0.0)
    few, many = (_propose(dataclasses.replace(CONFIG, points=200, directions=k)) for k in (1, 64))
    rows = few.span("P", "P")
    assert few.visible[:, rows].mean() < 0.6
    assert many.visible[:, rows].mean() > 0.9
    gaps = (many.positions[:, rows].norm(dim=-1) - torch.tensor([[0.8], [0.4], [0.8]])).abs()
    assert float((many.depth[:, rows] - gaps).median()) < 0.05  # nearly along the normal


@pytest.mark.parametrize("near", [0.0, 0.35, 1.0])
def test_the_share_near_the_surface_starts_there(near, monkeypatch):
    monkeypatch.setattr(proposed_rays, "NEAR", near)
    monkeypatch.setattr(proposed_rays, "JITTER", 1e-3)
    batch = _propose(dataclasses.replace(CONFIG, points=40), chosen=(0,))
    starts = batch.positions[0, batch.span("P", "P")]
    close = (starts.norm(dim=-1) - RADII[0]).abs() < 0.01
    assert int(close.sum()) == pytest.approx(40 * near, abs=2)
    assert bool((starts.abs() <= 1).all())


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
