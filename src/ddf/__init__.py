"""Directed distance fields: oriented points in, visibility and depth out.

The Python interface is what `__all__` lists; each name imports what it needs when it is first used.
"""

import importlib
import sys
import types
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ddf import torch as torch
    from ddf.api.completion import Completion, complete, recover_pose
    from ddf.api.field import Field, fit, load
    from ddf.api.meshes import cast, compare, read_mesh
    from ddf.api.reconstruction import Reconstruction, generate, reconstruct
    from ddf.api.scene import Scene, compose, read_scene
    from ddf.api.sensors import depth_camera, lidar

    __version__: str

_MODULES = {
    "field": ("Field", "fit", "load"),
    "scene": ("Scene", "compose", "read_scene"),
    "meshes": ("cast", "compare", "read_mesh"),
    "reconstruction": ("Reconstruction", "generate", "reconstruct"),
    "completion": ("Completion", "complete", "recover_pose"),
    "sensors": ("depth_camera", "lidar"),
}
_HOMES = {name: module for module, names in _MODULES.items() for name in names}
__all__ = [
    "Completion",
    "Field",
    "Reconstruction",
    "Scene",
    "cast",
    "compare",
    "complete",
    "compose",
    "depth_camera",
    "fit",
    "generate",
    "lidar",
    "load",
    "read_mesh",
    "read_scene",
    "reconstruct",
    "recover_pose",
]


def __getattr__(name: str) -> Any:
    """A public name, from the module of `ddf.api` that holds it; and the module `ddf.torch`."""
    if name == "__version__":
        return importlib.import_module("ddf.core.extras").version()
    if name == "torch":
        return importlib.import_module("ddf.torch")
    if name not in _HOMES:
        raise AttributeError(f"module 'ddf' has no attribute {name!r}")
    value = globals()[name] = getattr(importlib.import_module(f"ddf.api.{_HOMES[name]}"), name)
    return value


def __dir__() -> list[str]:
    return [*__all__, "torch"]


class _Package(types.ModuleType):
    """`ddf` itself: importing the room `ddf.fit` leaves `ddf.fit` the function."""

    def __setattr__(self, name: str, value: Any) -> None:
        if name not in _HOMES or not isinstance(value, types.ModuleType):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
