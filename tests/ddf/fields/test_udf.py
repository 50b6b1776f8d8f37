"""Unsigned distances and v*: on closed forms whose distances, directions and medial surfaces are known."""

import pytest
import torch
from _support import assert_close

from ddf.fields import udf
from ddf.geometry import primitives, rays


def _ask(shape):
    """An exact field as an `udf.Ask`."""

    def ask(positions, directions, normals):
        flat = rays.OrientedPoints(positions.reshape(-1, 3), directions.reshape(-1, 3))
        hits = primitives.cast(shape, flat)
        where = positions.shape[:-1]
        depth = torch.where(hits.visible, hits.depth, 0.0).reshape(where)
        normal = hits.normals.reshape(positions.shape) if normals else None
        return udf.Answer(hits.visible.to(positions).reshape(where), depth, normal)

    return ask


def _points(count, seed=0):
    generator = torch.Generator().manual_seed(seed)
    return 2 * torch.rand((count, 3), generator=generator, dtype=torch.float64) - 1


SPHERE = primitives.Sphere(radius=0.6)


def test_nothing_seen_is_infinitely_far_and_has_no_direction():
    def blind(positions, directions, normals):
        zero = positions.new_zeros(positions.shape[:-1])
        return udf.Answer(zero, zero, torch.zeros_like(positions) if normals else None)

    candidates = udf.CandidateNetwork().double()(_points(5))
    found = udf.from_candidates(blind, _points(5), candidates)
    assert found.distances.isinf().all() and (found.directions == 0).all()


def test_candidate_network_has_the_papers_size_and_unit_outputs():
    network = udf.CandidateNetwork()
    assert sum(value.numel() for value in network.parameters()) == 4 * 128 + 4 * (128 * 128 + 128) + 128 * 15 + 15
    candidates = network(torch.rand(7, 3))
    assert candidates.shape == (7, 5, 3)
    assert_close(candidates.norm(dim=-1), torch.ones(7, 5))


def test_loss_equals_the_papers_formula_written_as_loops():
    positions = _points(6)
    candidates = torch.nn.functional.normalize(_points(30, 1).reshape(6, 5, 3), dim=-1)
    ask = _ask(SPHERE)
    total = 0.0
    for point, row in zip(positions, candidates, strict=True):
        answers = [ask(point[None], v[None], True) for v in row]
        total += sum(float(a.depth - a.visibility) for a in answers) / 5
        pairs = sum(float(row[i] @ row[j]) for i in range(5) for j in range(5) if j != i)
        total += 2 * 5e-3 / (25 - 5) * pairs
        both = zip(row, answers, strict=True)
        aligned = [(float(v @ a.normals[0]) + 1) ** 2 for v, a in both if a.normals is not None]
        total += 0.1 * sum(aligned) / 5
    assert float(udf.loss(ask, positions, candidates)) == pytest.approx(total / 6, rel=1e-12)


def test_loss_has_gradients_in_the_network():
    network = udf.CandidateNetwork().double()

    def ask(positions, directions, normals):
        depth = (positions + directions).square().sum(-1)
        return udf.Answer(torch.sigmoid(depth), depth, torch.nn.functional.normalize(positions - directions, dim=-1))

    udf.loss(ask, _points(8), network(_points(8))).backward()
    assert all(value.grad is not None and value.grad.abs().sum() > 0 for value in network.parameters())


def test_an_invisible_candidate_weighs_as_softmax_says():
    ways = torch.tensor([[[1.0, 0, 0], [0, 1, 0]]], dtype=torch.float64)
    found = udf.closest_directions(ways, torch.tensor([[1.0, 0.0]]).double(), torch.ones(1, 2).double(), 1.0, 0.0)[0]
    assert_close(found[0] / found[1], torch.tensor(torch.e, dtype=torch.float64))
