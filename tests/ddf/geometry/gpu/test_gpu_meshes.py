"""Rays cast by the kernel of a GPU, interpreted, against the exact cast: hard cases, ties, several meshes at once."""

import importlib.util

import _interpreter
import numpy as np
import pytest
import torch
from _shapes import cube, float32, icosphere, joined, moved, random_rays, torus

from ddf.geometry import mesh_io, raycast
from ddf.geometry.exact import exact_cast
from ddf.geometry.gpu import meshes

ABSENT = pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA device")
RANDOM = np.random.default_rng(0)
SOUP = mesh_io.Mesh(RANDOM.uniform(-1, 1, (150, 3)), np.arange(150).reshape(-1, 3))
OVERLAPPING = joined(torus(sections=8), moved(cube(), 0.3, (0.5, 0.1, 0.0)))
EMPTY = mesh_io.Mesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64))


def _held(parts, device):
    triangles = [part.triangles for part in parts]
    return meshes.joined([len(own) for own in triangles], triangles, torch.device(device))


def _cast(parts, which, positions, directions, device):
    """Depth and triangle of its mesh by the kernel, and those of the exact cast; rays are float32."""
    parts, which = [float32(part) for part in parts], np.array(which)
    rays = [torch.from_numpy(np.asarray(values, dtype=np.float32)) for values in (positions, directions)]
    held = _held(parts, device)
    depth, face = (values.cpu().numpy() for values in held.first_hits(which, *(each.to(device) for each in rays)))
    face = np.where(face < 0, -1, face - held.begins[which][:, None])
    starts, along = (each.double().numpy() for each in rays)
    exact = [
        exact_cast.first_hits(raycast.Scene(parts[mesh]), *own) for mesh, *own in zip(which, starts, along, strict=True)
    ]
    return [depth, face, *(np.stack(values) for values in zip(*exact, strict=True))]


def _same(depth, face, true_depth, true_face, *, atol=5e-7, outlines=0):
    """The share of rays that meet the same triangle; the others must meet one at the same depth.

    outlines: rays that may pass so close to an outline that float32 cannot tell.
    """
    assert ((face < 0) != (true_face < 0)).sum() <= outlines and (np.isfinite(depth) == (face >= 0)).all()
    seen = (face >= 0) & (true_face >= 0)
    off = np.abs(depth[seen] - true_depth[seen]).max(initial=0)
    assert off < atol, off
    return (face == true_face).mean()


def _unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _several_meshes(device):
    """Rows on meshes of several sizes, one twice and one without triangles; rays are no whole block."""
    parts, which = [cube(0.9), SOUP, EMPTY, icosphere(1, 0.7), OVERLAPPING], [3, 0, 2, 1, 4, 3]
    points = random_rays(6 * 130, seed=3, spread=1.2)
    starts, aim = (values.numpy().reshape(6, 130, 3) for values in (points.positions, points.directions))
    found = _cast(parts, which, starts, aim, device)
    assert _same(*found) == 1.0
    seen = (found[1] >= 0).mean(axis=1)
    assert seen[2] == 0 and (np.delete(seen, 2) > 0.15).all() and (seen < 0.9).all()


def _edges_and_corners(device):
    """No ray slips through a closed mesh where its triangles meet, from inside and from outside."""
    for mesh, inside in (
        (icosphere(2, 0.8), [0.0, 0.0, 0.0]),
        (cube(0.75), [0.0, 0.0, 0.0]),
        (moved(torus(sections=6), 1.0, (0.1, -0.05, 0.02)), [0.8, -0.05, 0.02]),
    ):
        corners = mesh.triangles
        edges = (corners + np.roll(corners, 1, axis=1)).reshape(-1, 3) / 2
        targets = np.concatenate([mesh.vertices, edges, 0.3 * corners[:, 0] + 0.7 * edges[::3]])
        for start in (np.array(inside), np.array(inside) + np.array([0.013, -0.007, 0.011])):
            away = targets - start
            aim = _unit(away)
            depth, face, *_ = _cast([mesh], [0, 0], [start + 0 * aim, start + 3 * aim], [aim, -aim], device)
            assert (face >= 0).all()
            if len(mesh.faces) != 72:  # convex: what is aimed at is what is met
                assert np.abs(depth[0] - np.linalg.norm(away, axis=1)).max() < 5e-7


def _ties(device):
    """On a diagonal of a face, on an edge and in a corner of a box, the first of the triangles is the one met."""
    aim = np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z], dtype=float)
    depth, face, _, true_face = _cast([cube(0.75)], [0], [np.zeros_like(aim)], [aim], device)
    assert (depth == 0.75).all() and (face == true_face).all()


def _flat_and_tiny_triangles(device):
    """Rays in a triangle's plane and triangles without an area meet nothing; tiny ones and grazing rays are exact."""
    lines = [[[0, 0, -2], [0, 0, 2], [0, 0, 0]], [[0, 0, 0], [0, 0, 0], [0, 1, 0]], [[0.3, 0.3, 0.3]] * 3]
    corners = np.array([*lines, [[0, -1, 0.5], [1, 1, 0.5], [1, -1, 0.5]]], dtype=float)
    flat = mesh_io.Mesh(corners.reshape(-1, 3), np.arange(12).reshape(-1, 3))
    starts = [[-2, 0, 0], [-2, 0, 0.3], [-1, 0, 0.5], [0, 0, 0], [0.8, 0, 2]]
    aim = [[1, 0, 0], [1, 0.1, 0], [1, 0, 0], [0, 0, 1], [0, 0, -1]]
    depth, face, *_ = _cast([flat], [0], [starts], [aim], device)
    assert depth[0].tolist() == [np.inf, np.inf, np.inf, np.inf, 1.5] and face[0].tolist() == [-1, -1, -1, -1, 3]
    middle = np.array([0.5, -0.25, 0.125])
    offset = _unit(RANDOM.standard_normal((200, 3))) * RANDOM.uniform(0, 1.3e-4, (200, 1))
    aim = _unit(RANDOM.standard_normal((200, 3)))
    tiny = moved(icosphere(1), 1e-4, tuple(middle))
    assert _same(*_cast([tiny], [0], [middle + offset - 0.7 * aim], [aim], device), outlines=2) > 0.95
    sheet = mesh_io.Mesh(
        np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=float), np.array([[0, 1, 2], [0, 2, 3]])
    )
    turn = RANDOM.uniform(0, 2 * np.pi, 200)
    aim = _unit(np.stack([np.cos(turn), np.sin(turn), np.full(200, -1e-3)], axis=1))
    assert _same(*_cast([sheet], [0], [np.tile([0.1, 0.2, 5e-4], (200, 1))], [aim], device), atol=1e-4) == 1.0


def _beside_a_face(device):
    """A start that float32 can tell from a face is on its own side of it."""
    mesh = float32(icosphere(1, 0.9))
    normals, _ = mesh_io.face_normals(mesh)
    face = RANDOM.integers(0, len(mesh.faces), 250)
    weights = RANDOM.dirichlet((2.0, 2.0, 2.0), 250)
    side = np.where(np.arange(250) % 2 == 0, 3e-7, -3e-7)[:, None] * normals[face]
    starts = np.einsum("ni,nij->nj", weights, mesh.triangles[face]) + side
    aim = -_unit(normals[face] + 0.5 * _unit(RANDOM.standard_normal((250, 3))))
    found = _cast([mesh], [0], [starts], [aim], device)
    assert _same(*found) > 0.99 and 0.4 < (found[0] < 1e-5).mean() < 0.6


CASES = (_several_meshes, _edges_and_corners, _ties, _flat_and_tiny_triangles, _beside_a_face)
INTERPRETED = """
from ddf.geometry.gpu import cast_kernel, meshes
import test_gpu_meshes as here

meshes.TOGETHER, cast_kernel.RAYS = 64, 256  # few and large blocks: the interpreter's time goes by their number
for case in here.CASES:
    case("cpu")
print("the same")
"""


def test_the_kernel_gives_the_exact_cast():
    done = _interpreter.interpreted(INTERPRETED, __file__)
    assert done.stdout == "the same\n", done.stderr[-3000:]


@pytest.mark.gpu
@ABSENT
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.__name__)
def test_a_gpu_gives_the_exact_cast(case):
    assert meshes.refusal(torch.device("cuda")) is None
    case("cuda")


def test_frames_bring_directions_onto_the_third_axis():
    aim = torch.nn.functional.normalize(torch.randn(40, 3, generator=torch.Generator().manual_seed(0)), dim=-1)
    aim[:3] = torch.tensor([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 2.0]])
    frame = meshes.frames(aim)
    expected = torch.tensor([0.0, 0.0, 1.0]).expand(40, 3)
    torch.testing.assert_close((frame @ aim[..., None])[..., 0], expected, atol=1e-6, rtol=0)
    assert torch.equal((frame[:3] @ aim[:3, :, None])[..., 0], expected[:3])
    longest = aim.gather(-1, aim.abs().argmax(dim=-1, keepdim=True))[:, 0]
    torch.testing.assert_close(torch.linalg.det(frame), 1 / longest)
    assert bool((frame[:, :2].abs() <= 1).all())  # no share is larger than 1


def test_meshes_begin_at_whole_blocks():
    parts = [icosphere(0), EMPTY, SOUP, cube()]
    held = _held(parts, "cpu")
    assert held.begins.tolist() == [0, 20, 20, 72, 84] and held.corners.shape == (9, 96)
    for part, begin in zip(parts, held.begins[:-1], strict=True):
        own = held.corners[:, begin : begin + len(part.faces)].T.reshape(-1, 3, 3)
        assert np.array_equal(own.numpy(), part.triangles.astype(np.float32))
    assert float(held.corners[:, [70, 71, 84, 95]].abs().max()) == 0


def test_a_machine_that_cannot_cast_says_why(monkeypatch):
    assert meshes.refusal(torch.device("cpu")) == "cpu is no GPU"
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert meshes.refusal(torch.device("cuda")) == "Triton is missing"
