"""How near one triangle mesh is to another: Chamfer distance, F-scores and normal consistency of drawn points."""

from dataclasses import dataclass

import numpy as np

from ddf.data import mesh_topology
from ddf.data.samples.surface import Surface
from ddf.geometry import mesh_io, neighbours
from ddf.geometry.mesh_io import Mesh
from ddf.metrics import cloud_scores


@dataclass(frozen=True)
class SurfaceScores:
    """clouds: scores of the points drawn. chamfer_l1: mean of both means of distances, not squared.

    normal_consistency: mean of both means of |n . n'| with the nearest point's normal; 1 is best. watertight: every
    edge has two triangles.
    """

    clouds: cloud_scores.CloudScores
    chamfer_l1: float
    normal_consistency: float
    watertight: bool


def compare(
    mesh: Mesh, truth: Mesh, points: int = 10_000, tau_sq: float = cloud_scores.TAU_SQ, seed: int = 0
) -> SurfaceScores:
    """Scores of a mesh against the true one, by points drawn by area on both; both in one frame and unit."""
    random = np.random.default_rng(seed)
    drawn, normals = zip(*(_draw(each, points, random) for each in (mesh, truth)), strict=True)
    distances, agreement = [], []
    for own, other in ((0, 1), (1, 0)):
        dist_sq, index = neighbours.Neighbours(drawn[other]).nearest(drawn[own])
        distances.append(np.sqrt(dist_sq).mean())
        agreement.append(np.abs((normals[own] * normals[other][index]).sum(axis=1)).mean())
    return SurfaceScores(
        cloud_scores.compare_clouds(drawn[0], drawn[1], tau_sq),
        float(np.mean(distances)),
        float(np.mean(agreement)),
        mesh_topology.is_watertight(mesh),
    )


def _draw(mesh: Mesh, count: int, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Points drawn by area, and the normals of their triangles."""
    points, face = Surface.of(mesh).draw(count, random)
    return points, mesh_io.face_normals(mesh)[0][face]
