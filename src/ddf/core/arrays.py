"""Functions written once for numpy arrays and torch tensors: the names that both libraries know.

torch is not imported here: whoever holds a tensor has imported it. Arguments go by position (`xp.stack(parts, -1)`),
because one library says `axis` and the other `dim`.
"""

import sys
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

if TYPE_CHECKING:
    import torch

    Array = TypeVar("Array", np.ndarray, torch.Tensor)
else:
    Array = TypeVar("Array")  # jaxtyping then checks shape and type of whatever comes


def namespace(values: Any) -> Any:
    """The library of an array: numpy, or torch for a tensor."""
    return np if isinstance(values, np.ndarray | np.generic) else sys.modules["torch"]


def like(values: Any, other: Any) -> Any:
    """An array, of either library, in the library, the type and the place of another."""
    if isinstance(other, np.ndarray | np.generic):
        return to_numpy(values).astype(other.dtype, copy=False)
    torch = sys.modules["torch"]
    return (torch.from_numpy(values) if isinstance(values, np.ndarray) else values).to(other)


def send(values: Any, device: Any) -> Any:
    """A tensor, or the tensor of a numpy array, on a torch device.

    A GPU reads it from memory that it may read at any time, so that neither waits for the other.
    """
    tensor = sys.modules["torch"].from_numpy(values) if isinstance(values, np.ndarray) else values
    if device.type != "cuda" or tensor.device.type != "cpu":
        return tensor.to(device)
    return tensor.pin_memory().to(device, non_blocking=True)


def to_numpy(values: Any) -> np.ndarray:
    """The values as a numpy array on the CPU."""
    return values.detach().cpu().numpy() if hasattr(values, "detach") else np.asarray(values)
