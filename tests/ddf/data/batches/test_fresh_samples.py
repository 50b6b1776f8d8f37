"""Samples and proposed rays cast by the kernel of a GPU, interpreted, are those that Open3D casts on the host."""

import dataclasses

import _interpreter
import _models
import _shapes
import numpy as np
import pytest
import torch
from _hand_made import COUNTS

from ddf.data import packing, sampling
from ddf.data.batches import category_data, fresh_samples, host_samples
from ddf.fields import pddf
from ddf.geometry import mesh_io, raycast, transforms
from ddf.geometry.gpu import meshes
from ddf.models.reconstruction import settings
from ddf.training.reconstruction import proposed_rays

ABSENT = pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA device")
CONFIG = sampling.SamplesConfig()
PROPOSALS = settings.ProposalConfig(60, 4, 0.5, 0.1, 0.05, 0.05)
CHOSEN = np.array([1, 0, 1])
FLAT = mesh_io.Mesh(np.array([[0.0, 0, 0.9], [0, 0, 0.5], [0, 0, 0.7]]), np.array([[0, 1, 2], [1, 1, 2]]))
PARTS = _shapes.joined(_shapes.icosphere(1, 0.4), FLAT), _shapes.torus(0.6, 0.25, 8)
MESHES = [_shapes.float32(part) for part in PARTS]
SCENES = [raycast.Scene(mesh) for mesh in MESHES]


def _grounds(config=CONFIG):
    grounds = fresh_samples.GroundFile(config)
    for scene in SCENES:
        grounds.append(scene)
    return grounds


def _samples(device):
    """The same numbers drawn, the same rays cast: truth differs by a step of its stored form at most."""
    counts = {name: 16 * count for name, count in COUNTS.items()}
    for config in (CONFIG, dataclasses.replace(CONFIG, box="tight", margin=0.05)):
        grounds = _grounds(config)
        held = fresh_samples.held_meshes(grounds, torch.device(device))
        sources = [host_samples.FreshSamples(SCENES, config), fresh_samples.cast_samples(held, grounds, config)]
        streams = [np.random.default_rng(5) for _ in sources]
        host, own = (
            each.draw(CHOSEN, counts, random, slice(0, 2)) for each, random in zip(sources, streams, strict=True)
        )
        assert streams[0].random() == streams[1].random() and own.counts == host.counts
        assert own.positions.device.type == device
        own = own.to(torch.device("cpu"))
        assert torch.equal(own.positions, host.positions) and torch.equal(own.directions, host.directions)
        for name in counts:
            rows = host.span(name, name)
            seen = [each.visible[:, rows] > 0 for each in (own, host)]
            agree = seen[0] == seen[1]  # the last bit says where, and whether, a tangent meets the facets beside it
            assert float(agree.float().mean()) >= (0.9 if name == "T" else 1.0), name
            close = (own.depth - host.depth)[:, rows].abs() < 1.01 * packing.DEPTH_STEP
            share = float(close[seen[0] & seen[1]].float().mean()) if name != "E" else 1.0  # E has no truth
            assert share >= (0.8 if name == "T" else 1.0), name
            assert torch.equal(own.normals[:, rows][agree], host.normals[:, rows][agree])
            assert not bool(own.depth[:, rows][~seen[0]].any())


class _Straight(pddf.PDDF):
    """A field that holds every ray to be as long, so that each candidate is as good as another."""

    def __init__(self):
        super().__init__(_models.FIELD)

    def forward(self, positions, directions, modulations=None):
        return torch.ones((*positions.shape[:-1], 4), device=positions.device)

    def depth(self, raw):
        return raw[..., 0]


def _proposals(device):
    """Proposed rays have the hits that Open3D gives them."""
    cloud = torch.from_numpy(np.random.default_rng(1).uniform(-0.5, 0.5, (90, 3))).float()
    shapes = category_data.ShapeSet(["a", "b"], [transforms.Similarity(1.0)] * 2, [cloud, cloud])
    held, found = fresh_samples.held_meshes(_grounds(), torch.device(device)), []
    for caster, place in ((proposed_rays.HostCaster(SCENES), "cpu"), (held, device)):
        stored = host_samples.FreshSamples(SCENES, CONFIG).draw(CHOSEN, COUNTS, np.random.default_rng(0))
        given = stored.to(torch.device(place)), _Straight(), [torch.ones(3, 1, 8, device=place)], CHOSEN
        batch = proposed_rays.Proposer(shapes, caster, PROPOSALS)(*given, np.random.default_rng(2))
        assert batch.positions.device.type == place
        rows = batch.span("P", "P")
        found.append([each[:, rows].cpu() for each in batch.tensors()])
    for host, own, atol in zip(*found, (0, 1e-6, 0, 1e-5, 0), strict=True):
        torch.testing.assert_close(own, host, atol=atol, rtol=0)
    assert 0.2 < float(found[0][2].mean()) < 0.9


CASES = (_samples, _proposals)
INTERPRETED = """
from ddf.geometry.gpu import cast_kernel, meshes
import test_fresh_samples as here

meshes.TOGETHER, cast_kernel.RAYS = 64, 512  # few and large blocks: the interpreter's time goes by their number
for case in here.CASES:
    case("cpu")
print("the same")
"""


def test_the_kernel_casts_samples_and_proposals_as_open3d_does():
    done = _interpreter.interpreted(INTERPRETED, __file__)
    assert done.stdout == "the same\n", done.stderr[-3000:]


@pytest.mark.gpu
@ABSENT
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.__name__)
def test_a_gpu_casts_samples_and_proposals_as_open3d_does(case):
    case("cuda")


def test_what_samples_are_drawn_from_is_read_back_as_it_was():
    grounds = _grounds()
    assert grounds.counts == [len(mesh.faces) for mesh in MESHES]
    for index, scene in ((1, SCENES[1]), (0, SCENES[0])):
        own, truth = grounds[index], sampling.Ground.of(scene, CONFIG)
        assert own.box is truth.box and own.size == truth.size
        kept = scene.kept
        assert np.array_equal(own.surface.corners[kept], truth.surface.corners[kept])
        assert np.array_equal(own.surface.normals, truth.surface.normals)
        assert np.array_equal(own.surface.areas, truth.surface.areas)
    flat = grounds[0].surface.corners[-2:]
    assert (flat == flat[:, :1]).all()  # points, which no ray meets
    held = fresh_samples.held_meshes(grounds, torch.device("cpu"))
    assert np.array_equal(held.begins, meshes.begins_of(grounds.counts))
