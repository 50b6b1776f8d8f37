"""Packages that the base install leaves out: which extra brings them, and the one line that says so."""

import contextlib
from collections.abc import Iterator

from ddf.core import checks

_TORCH = ("torch", "torchvision", "safetensors", "tqdm", "open3d")
_EXPERIMENTS = (
    "argcomplete",
    "dask",
    "distributed",
    "dvc",
    "fast_simplification",
    "joblib",
    "manifold3d",
    "matplotlib",
    "onnx",
    "OpenEXR",
    "pandas",
    "psutil",
    "pymeshlab",
    "rtree",
    "trimesh",
)
EXTRA_OF = dict.fromkeys(_TORCH, "torch") | dict.fromkeys(_EXPERIMENTS, "experiments")  # modules to extras


class MissingPackage(checks.InputError):
    """A package of an extra is not installed. One line: which, and the command."""


def command(extra: str) -> str:
    """What installs an extra."""
    return f'pip install "ddf[{extra}]"'


def missing(error: ModuleNotFoundError) -> MissingPackage | None:
    """The error that tells what to install; None where no extra would bring the module."""
    module = (error.name or "").partition(".")[0]
    if module not in EXTRA_OF:
        return None
    return MissingPackage(f"this needs {module}: {command(EXTRA_OF[module])}")


@contextlib.contextmanager
def named() -> Iterator[None]:
    """Turn the failing import of a package of an extra into `MissingPackage`."""
    try:
        yield
    except ModuleNotFoundError as error:
        told = missing(error)
        if told is None:
            raise
        raise told from error
