"""Models from the files that a training or a fit wrote, and the device on which they run."""

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import torch
from torch import nn

from ddf.core import checks, storage

MODEL = "model.safetensors"  # of the folder that a training writes

Model = TypeVar("Model", bound=nn.Module)


def device() -> torch.device:
    """CUDA when there is one, else the CPU; of several GPUs the process's own."""
    return torch.device("cuda" if torch.cuda.is_available() else "cpu")


def built(make: Callable[[], Model], folder: Path, beside: str | None = None) -> Model:
    """The model that `make` builds with the weights that a training wrote; as `load_model`.

    Sizes are compared with those of the file first: what a record claims takes no memory.
    """
    path = folder / MODEL
    found = {name: shape for name, shape in storage.shapes(path).items() if not (beside and name.startswith(beside))}
    try:
        with torch.device("meta"):
            wanted = {name: tuple(value.shape) for name, value in make().state_dict().items()}
    except checks.InputError:
        raise
    except (RuntimeError, TypeError, ValueError, OverflowError) as error:
        raise checks.InputError(f"{path}: its record describes no model ({' '.join(str(error).split())})") from error
    for name in [*wanted, *found]:
        if wanted.get(name) != found.get(name):
            raise checks.InputError(
                f"{path}: does not fit the architecture of its config: {name[:80]} is {wanted.get(name, 'no part')} "
                f"there and {found.get(name, 'not')} in the file"
            )
    model = make()
    load_model(model, folder, beside)
    return model


def load_model(model: nn.Module, folder: Path, beside: str | None = None) -> dict:
    """Fill `model` from the file that a training wrote, and return its record; the model is left in evaluation mode.

    Args:
      beside: how the names of tensors begin that are no weights.
    Raises:
      InputError: the file is damaged, holds another architecture, or a weight that is not finite.
    """
    path = folder / MODEL
    tensors, record = storage.load_tensors(path, framework="torch")
    try:
        model.load_state_dict({k: v for k, v in tensors.items() if beside is None or not k.startswith(beside)})
    except RuntimeError as error:
        reason = " ".join(str(error).split())
        raise checks.InputError(f"{path}: does not fit the architecture of its config: {reason}") from error
    for name, value in tensors.items():
        if value.is_floating_point() and not bool(torch.isfinite(value).all()):
            raise checks.InputError(f"{path}: {name[:80]} holds values that are not finite; fit or train it again")
    model.to(device()).eval()
    return record
