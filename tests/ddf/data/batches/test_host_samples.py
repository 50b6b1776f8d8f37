"""Where a training's oriented points come from: fresh samples against stored ones, and the scenes that are cast on."""

import dataclasses
import json

import _models
import _shapes
import numpy as np
import pytest
import torch
from _support import assert_close

from ddf.core import checks, storage
from ddf.data import packing, sampling
from ddf.data.batches import category_data, host_samples
from ddf.data.samples import sample_types
from ddf.geometry import mesh_io, raycast, rays, transforms
from ddf.models.reconstruction import settings
from ddf.training.reconstruction import training_truth

COUNTS = {"E": 3, "U": 6, "A": 6, "B": 4, "S": 4, "T": 4, "O": 4, "A+": 5}
CONFIG = sampling.SamplesConfig(counts=sample_types.Counts(4000, 4000, 4000, 4000, 4000, 4000))
MESHES = (_shapes.icosphere(3, 0.4), _shapes.cube(0.8))


def _fresh(meshes=MESHES, settings=CONFIG):
    return host_samples.FreshSamples([raycast.Scene(mesh) for mesh in meshes], settings)


def _equal(one, two):
    return all(
        torch.equal(a, b) if isinstance(a, torch.Tensor) else a == b
        for a, b in zip(vars(one).values(), vars(two).values(), strict=True)
    )


def test_a_batch_is_that_of_stored_samples_and_belongs_to_its_shapes():
    batch = _fresh().draw(np.array([1, 0, 1]), COUNTS, np.random.default_rng(0))
    assert dict(batch.counts) == COUNTS
    assert list(batch.counts) == [kind for kind in ("E", *sample_types.STORED) if kind in COUNTS]
    assert batch.positions.shape == (3, sum(COUNTS.values()), 3)
    starts = batch.positions[:, batch.span("S", "S")].double()
    assert_close(starts[1].norm(dim=-1).numpy(), np.full(4, 0.4), atol=0.01)
    assert_close(starts[[0, 2]].abs().amax(dim=-1).numpy(), np.full((2, 4), 0.8), atol=1e-4)
    for row, mesh in enumerate((MESHES[1], MESHES[0], MESHES[1])):
        known = batch.span("U", "B")
        asked = rays.OrientedPoints(batch.positions[row, known], batch.directions[row, known])
        hits = raycast.cast(mesh, asked)
        assert torch.equal(batch.visible[row, known] == 1, hits.visible)
        seen = hits.visible
        assert_close(batch.depth[row, known][seen].numpy(), hits.depth[seen].numpy(), atol=1e-4)
        assert float((batch.normals[row, known][seen] * hits.normals[seen]).sum(-1).min()) > 0.999
        assert bool((batch.depth[row, known][~seen] == 0).all())


def test_no_sample_is_drawn_twice_but_the_same_seed_draws_the_same():
    source, shapes = _fresh(), np.array([0, 0])
    first = source.draw(shapes, COUNTS, np.random.default_rng(0))
    assert _equal(first, source.draw(shapes, COUNTS, np.random.default_rng(0)))
    assert not torch.equal(first.positions[0], first.positions[1])
    for start, end in (("U", "U"), ("A", "A"), ("A+", "A+")):
        one = first.positions[0, first.span(start, end)]
        assert len(torch.unique(one, dim=0)) == len(one)
    assert not torch.equal(first.positions[:, first.span("A", "A")][:, :5], first.positions[:, first.span("A+", "A+")])


def test_a_part_gets_what_it_has_among_all():
    shapes, whole = np.array([1, 0, 1, 0]), np.random.default_rng(0)
    batch = _fresh().draw(shapes, COUNTS, whole)
    random = np.random.default_rng(0)
    part = _fresh().draw(shapes, COUNTS, random, slice(1, 3))
    for name in ("positions", "directions", "visible", "depth", "normals"):
        assert torch.equal(getattr(part, name), getattr(batch, name)[1:3])
    assert random.random() == whole.random()


@pytest.mark.parametrize("kind", sample_types.KINDS)
def test_fresh_samples_are_distributed_as_stored_ones(kind):
    arrays, _ = sampling.extract(MESHES[1], CONFIG, "test")
    stored = packing.decode({name: torch.from_numpy(values) for name, values in arrays.items()}, kind)
    counts = {
        **dict.fromkeys(sample_types.ORDER, 1),
        kind: 3,
    }  # as few as a batch may have: shares must hold on average
    batch = _fresh().draw(np.ones(1300, int), counts, np.random.default_rng(0))
    own = batch.span(kind, kind)
    fresh = {name: getattr(batch, name)[:, own].flatten(0, 1) for name in ("positions", "directions")}
    for name, values in fresh.items():
        assert_close(values.mean(0).numpy(), stored[name].mean(0).numpy(), atol=0.05)
        assert_close(values.std(0).numpy(), stored[name].std(0).numpy(), atol=0.03)
    visible = batch.visible[:, own].mean()
    assert float(visible) == pytest.approx(float(stored["visible"].float().mean()), abs=0.04)
    on_wall = (fresh["positions"].abs().amax(-1) == 1).float().mean()
    assert float(on_wall) == pytest.approx(float((stored["positions"].abs().amax(-1) == 1).float().mean()), abs=0.02)


def test_a_mesh_outside_the_cube_is_refused():
    with pytest.raises(checks.InputError, match="must lie in"):
        _fresh([_shapes.cube(1.1)]).draw(np.array([0]), COUNTS, np.random.default_rng(0))


def _write_packs(folder):
    for number, name in enumerate(("a", "b", "c")):
        mesh = _shapes.icosphere(1, 0.2 * (number + 1))
        maps = json.dumps({name: transforms.Similarity(1.0).to_dict()})
        members = {
            f"{name}.ply": mesh_io.ply_bytes(mesh),
            "measures.csv": b"id\n",
            "field_from_raw.json": maps.encode(),
        }
        storage.save_pack(folder / f"{number:03d}.zip", members, {"ids": [name]})
        storage.write_json(folder / f"{number:03d}.json", {"files": {f"{number:03d}.zip": ""}})


def test_scenes_are_in_the_order_asked_for_however_few_packs_are_open(tmp_path, monkeypatch):
    monkeypatch.setattr(host_samples, "OPEN_PACKS", 1)
    _write_packs(tmp_path)
    scenes = host_samples.Scenes(tmp_path, ["c", "a"])
    for index, radius in ((0, 0.6), (1, 0.2), (0, 0.6)):
        depth, _ = scenes[index].first_hits(np.array([[0.01, 0.02, 1.0]]), np.array([[0.0, 0.0, -1.0]]))
        assert float(depth[0]) == pytest.approx(1 - radius, abs=0.1 * radius)
    with pytest.raises(checks.InputError, match="no prepared mesh of shape d"):
        host_samples.Scenes(tmp_path, ["a", "d"])


def test_fresh_samples_need_meshes_alone_and_stored_ones_no_mesh(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    drawn, nothing, packs = sampling.SamplesConfig(epsilon_o=0.03), tmp_path / "nothing", tmp_path / "meshes"
    packs.mkdir()
    _write_packs(packs)
    shapes = category_data.ShapeSet(["c", "a"], [transforms.Similarity(1.0)] * 2, [torch.zeros(5, 3)] * 2)
    proposals = settings.ProposalConfig(4, 2, 0.5, 0.1, 0.05, 0.05)
    fresh = dataclasses.replace(_models.DDF, samples="fresh", proposals=proposals)
    truth = training_truth.read(shapes, fresh, drawn, nothing, packs)
    assert truth.drawn == drawn
    assert truth.sources == sorted(packs.glob("*.zip"))
    batch = truth.samples.draw(np.array([0, 1]), COUNTS, np.random.default_rng(0), slice(None))
    radius = batch.positions[:, batch.span("S", "S")].norm(dim=-1)
    assert_close(radius.numpy(), np.array([[0.6] * 4, [0.2] * 4]), atol=0.06)
    assert truth.propose is not None and truth.propose.config == proposals
    with pytest.raises((checks.InputError, FileNotFoundError), match="nothing"):
        training_truth.read(shapes, dataclasses.replace(_models.DDF, proposals=proposals), drawn, nothing, packs)
    stored = dataclasses.replace(_models.DDF, samples="stored", proposals=None)
    assert not stored.casts
    sets = category_data.SampleSet([], [])
    monkeypatch.setattr(category_data, "read_samples", lambda folder, ids: sets)
    assert training_truth.read(shapes, stored, drawn, nothing, nothing) == training_truth.Truth(sets, None, None, [])
