"""Models from the files that a training or a fit wrote, and the device on which they run."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeVar

import torch
from torch import Tensor, nn

from ddf.core import checks, storage

MODEL = "model.safetensors"  # of the folder that a training writes

Model = TypeVar("Model", bound=nn.Module)


def device() -> torch.device:
    """CUDA when there is one, else the CPU; of several GPUs the process's own."""
    return torch.device("cuda" if torch.cuda.is_available() else "cpu")


def built(make: Callable[[], Model], folder: Path, beside: str | None = None, name: str = MODEL) -> Model:
    """The model that `make` builds with the weights that a training wrote; as `load_model`.

    Sizes are compared with those of the file first: what a record claims takes no memory.
    """
    path = folder / name
    found = {part: shape for part, shape in storage.shapes(path).items() if not (beside and part.startswith(beside))}
    try:
        with torch.device("meta"):
            wanted = {part: tuple(value.shape) for part, value in make().state_dict().items()}
    except checks.InputError:
        raise
    except (RuntimeError, TypeError, ValueError, OverflowError) as error:
        raise checks.InputError(f"{path}: its record describes no model ({' '.join(str(error).split())})") from error
    for part in [*wanted, *found]:
        if wanted.get(part) != found.get(part):
            raise checks.InputError(
                f"{path}: does not fit the architecture of its config: {part[:80]} is {wanted.get(part, 'no part')} "
                f"there and {found.get(part, 'not')} in the file"
            )
    model = make()
    load_model(model, folder, beside, name)
    return model


def load_model(model: nn.Module, folder: Path, beside: str | None = None, name: str = MODEL) -> dict:
    """Fill `model` from the file that a training wrote, and return its record; the model is left in evaluation mode.
    Tensors whose names begin with `beside` are no weights.
    """
    path = folder / name
    tensors, record = storage.load_tensors(path, framework="torch")
    try:
        model.load_state_dict({k: v for k, v in tensors.items() if beside is None or not k.startswith(beside)})
    except RuntimeError as error:
        reason = " ".join(str(error).split())
        raise checks.InputError(f"{path}: does not fit the architecture of its config: {reason}") from error
    for part, value in tensors.items():
        if value.is_floating_point() and not bool(torch.isfinite(value).all()):
            raise checks.InputError(f"{path}: {part[:80]} holds values that are not finite; fit or train it again")
    model.to(device()).eval()
    return record


def rounded(tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Matrices and convolution kernels as float16; vectors, statistics and buffers as they are.

    A weight keeps 11 significant bits. Loading widens it to float32 again.
    """
    wide = {torch.float32, torch.float64}
    return {name: value.half() if value.dtype in wide and value.ndim >= 2 else value for name, value in tensors.items()}
