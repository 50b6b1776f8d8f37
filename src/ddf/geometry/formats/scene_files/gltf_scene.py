"""The nodes of a glTF scene with their transforms, and the triangles of the meshes that hang on them."""

from typing import Any

import numpy as np
from jaxtyping import Float

from ddf.core import checks
from ddf.geometry.formats.scene_files import parts
from ddf.geometry.formats.scene_files.gltf_accessors import Accessors, whole

_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_MOST = 100_000  # nodes, and primitives placed
_NO_TRIANGLES = {0: "points", 1: "lines", 2: "line loops", 3: "line strips"}


def of_scene(tree: dict[str, Any], accessors: Accessors) -> tuple[list[parts.Part], tuple[str, ...]]:
    """Vertices and triangles of every primitive of every node of the scene, in the scene's frame, and remarks.

    A mirroring transform turns the triangles, as the format says.

    Raises:
      InputError: nodes in a circle or with two parents, indices to nothing, more than 20 million triangles.
    """
    meshes, found, total = tree.get("meshes", []), [], 0
    skipped: dict[str, int] = {}
    for node, matrix in _nodes(tree):
        if "mesh" not in node:
            continue
        mesh = meshes[whole(node["mesh"], "mesh")]
        if "skin" in node:
            skipped["skins are not applied: the mesh is read as modelled"] = 1
        if any(node.get("weights", mesh.get("weights", ()))):
            skipped["morph targets are not applied"] = 1
        for primitive in mesh["primitives"]:
            mode = primitive.get("mode", _TRIANGLES)
            if mode in _NO_TRIANGLES:
                remark = f"primitives of {_NO_TRIANGLES[mode]} are left out"
                skipped[remark] = skipped.get(remark, 0) + 1
                continue
            total = parts.counted(total, _num_entries(primitive, accessors))
            if len(found) >= _MOST:
                raise checks.InputError(f"the scene places more than {_MOST} primitives")
            found.append(parts.placed(*_primitive(primitive, mode, accessors), matrix))
    return found, tuple(skipped)


def _num_entries(primitive: dict[str, Any], accessors: Accessors) -> int:
    vertices = accessors.count(primitive["attributes"]["POSITION"])
    return max(vertices, accessors.count(primitive["indices"]) if "indices" in primitive else vertices)


def _primitive(primitive: dict[str, Any], mode: Any, accessors: Accessors) -> parts.Part:
    vertices = accessors.positions(primitive["attributes"]["POSITION"])
    index = accessors.indices(primitive["indices"]) if "indices" in primitive else np.arange(len(vertices))
    if len(index) and index.max() >= len(vertices):
        raise checks.InputError(f"a triangle uses vertex {index.max()}, but there are only {len(vertices)}")
    if mode == _TRIANGLES:
        if len(index) % 3:
            raise checks.InputError(f"{len(index)} indices of triangles: not a multiple of three")
        return vertices, index.reshape(-1, 3)
    if len(index) < 3:
        return vertices, np.zeros((0, 3), dtype=np.int64)
    first, second, third = index[:-2], index[1:-1], index[2:]
    if mode == _STRIP:
        odd = np.arange(len(first)) % 2 == 1
        return vertices, np.stack([first, np.where(odd, third, second), np.where(odd, second, third)], axis=1)
    if mode == _FAN:
        return vertices, np.stack([second, third, np.full(len(second), index[0])], axis=1)
    raise checks.InputError(f"primitive mode {str(mode)[:20]} is none of glTF's")


def _nodes(tree: dict[str, Any]) -> list[tuple[dict[str, Any], Float[np.ndarray, "4 4"]]]:
    """Nodes of the scene from its roots down, each with the product of the transforms above it."""
    nodes, found = tree.get("nodes", []), []
    stack = [(root, np.eye(4)) for root in reversed(_roots(tree, nodes))]
    seen: set[int] = set()
    while stack:
        index, above = stack.pop()
        if whole(index, "node") >= len(nodes):
            raise checks.InputError(f"node {index} does not exist; there are {len(nodes)}")
        if index in seen:
            raise checks.InputError(f"node {index} hangs in the scene twice, or in a circle")
        seen.add(index)
        if len(seen) > _MOST:
            raise checks.InputError(f"the scene has more than {_MOST} nodes")
        with np.errstate(over="ignore", invalid="ignore"):
            matrix = above @ _local(nodes[index])
        found.append((nodes[index], matrix))
        stack += [(child, matrix) for child in reversed(nodes[index].get("children", []))]
    return found


def _roots(tree: dict[str, Any], nodes: list[dict[str, Any]]) -> list[int]:
    scenes = tree.get("scenes", [])
    if scenes:
        return list(scenes[whole(tree.get("scene", 0), "scene")].get("nodes", []))
    below = {child for node in nodes for child in node.get("children", [])}
    return [i for i in range(len(nodes)) if i not in below]


def _local(node: dict[str, Any]) -> Float[np.ndarray, "4 4"]:
    """The node's own transform: a matrix by columns, or scale, then rotation (x, y, z, w), then translation."""
    if "matrix" in node:
        return parts.numbers(node["matrix"], 16, "matrix").reshape(4, 4).T
    matrix = np.eye(4)
    quaternion = parts.numbers(node.get("rotation", (0.0, 0.0, 0.0, 1.0)), 4, "rotation")
    norm = float(np.linalg.norm(quaternion))
    if not 0 < norm < float("inf"):
        raise checks.InputError("the rotation of a node must not be zero")
    x, y, z, w = quaternion / norm
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix[:3, :3] = turn * parts.numbers(node.get("scale", (1.0, 1.0, 1.0)), 3, "scale")
    matrix[:3, 3] = parts.numbers(node.get("translation", (0.0, 0.0, 0.0)), 3, "translation")
    return matrix
