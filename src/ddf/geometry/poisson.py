"""A triangle mesh through points with normals: screened Poisson reconstruction, by Open3D. Kazhdan and Hoppe 2013."""

import numpy as np
import open3d as o3d
from jaxtyping import Float

from ddf.geometry.mesh_io import Mesh

_LEAST_DENSITY = 0.02  # quantile of the vertices' density below which they are cut off: the points do not support them


def surface(points: Float[np.ndarray, "n 3"], normals: Float[np.ndarray, "n 3"], depth: int = 7) -> Mesh:
    """The surface through the points, in their frame; open where there are none.

    Args:
      normals: outward, unit. depth: of the octree; details are about the box over 2^depth.
    """
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.normals = o3d.utility.Vector3dVector(normals)
    mesh, density = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=depth, n_threads=1)
    density = np.asarray(density)
    mesh.remove_vertices_by_mask(density < np.quantile(density, _LEAST_DENSITY))
    return Mesh(np.asarray(mesh.vertices), np.asarray(mesh.triangles))
