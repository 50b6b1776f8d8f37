"""Packages that the base install leaves out: which extra brings them, and the one line that says so."""

import contextlib
from collections.abc import Iterator

from ddf.core import errors

DISTRIBUTION = "directed-distance-fields"  # as package indexes name it
_TORCH = ("joblib", "onnx", "open3d", "torch", "trimesh")
_EXPERIMENTS = (
    *("argcomplete", "dask", "distributed", "fast_simplification", "matplotlib", "OpenEXR", "pandas"),
    *("psutil", "pymeshlab", "rtree", "torch_fidelity", "torchvision"),
)
COSTS = {"torch": "networks, 6 GB", "experiments": "closing of meshes, training, 7 GB"}
EXTRA_OF = dict.fromkeys(_TORCH, "torch") | dict.fromkeys(_EXPERIMENTS, "experiments") | {"laspy": "las"}  # of modules


def command(extra: str) -> str:
    """What installs an extra."""
    return f'pip install "{DISTRIBUTION}[{extra}]"'


def version() -> str:
    """Version of this package; `unknown` where it runs from a folder without being installed."""
    import importlib.metadata  # takes longer than all else that `ddf --help` imports

    try:
        return importlib.metadata.version(DISTRIBUTION)
    except importlib.metadata.PackageNotFoundError:
        return "unknown"


def hint(error: ModuleNotFoundError) -> str | None:
    """The line that tells what to install; None where no extra would bring the module."""
    module = (error.name or "").partition(".")[0]
    return f"this needs {module}: {command(EXTRA_OF[module])}" if module in EXTRA_OF else None


@contextlib.contextmanager
def named() -> Iterator[None]:
    """Turn the failing import of a package of an extra into an `InputError` that tells what to install."""
    try:
        yield
    except ModuleNotFoundError as error:
        told = hint(error)
        if told is None:
            raise
        raise errors.InputError(told) from error
