"""AdamW, and Muon for the matrices between hidden layers and for the kernels of convolutions: one handle for all.

Muon (Jordan et al. 2024) moves a matrix by the nearest orthogonal one to the average of its gradients, so that no
direction waits for another; a kernel is a matrix of one row per output channel. AdamW keeps what is no such matrix:
first sine layers, heads, biases, scales.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor, nn

from ddf.fields import passes, siren

MOMENTUM = 0.95
QUINTIC = (3.4445, -4.7750, 2.0315)  # coefficients, steps and least norm of Newton and Schulz's iteration, as published
QUINTIC_STEPS = 5
LEAST_NORM = 1e-7


class Muon(torch.optim.Optimizer):
    """As torch's own, but products are of a type of choice, where torch makes them in bfloat16 whatever the processor;
    and kernels of convolutions are taken too.
    """

    def __init__(self, groups: Sequence[Mapping[str, Any]], learning_rate: float, matmul: passes.Matmul) -> None:
        super().__init__([dict(group) for group in groups], {"lr": learning_rate, "weight_decay": 0.0})
        self.matmul: passes.Matmul = matmul

    @torch.no_grad()
    def step(self) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Move every matrix that has a gradient, as torch does it: Nesterov's average, decay apart from it."""
        for group in self.param_groups:
            for weights in _batches([each for each in group["params"] if each.grad is not None]):
                each = [self._ahead(weight) for weight in weights]
                ahead = each[0] if len(each) == 1 else torch.stack(each)
                factors = ahead.to(passes.product_type(self.matmul, ahead))
                moves = nearest_orthogonal(factors, QUINTIC, QUINTIC_STEPS, LEAST_NORM)
                taller = max(1.0, ahead.shape[-2] / ahead.shape[-1])
                for weight, moved in zip(weights, moves.reshape(-1, *ahead.shape[-2:]), strict=True):
                    weight.mul_(1 - group["lr"] * group["weight_decay"])
                    weight.add_(moved.reshape(weight.shape), alpha=-group["lr"] * taller**0.5)

    def _ahead(self, weight: Tensor) -> Float[Tensor, "a b"]:
        """Nesterov's average of the gradient, as a matrix."""
        gradient, state = weight.grad, self.state[weight]
        if gradient is None:
            raise ValueError("a weight without gradient is not moved")
        if not state:
            state["momentum_buffer"] = torch.zeros_like(weight)
        average = state["momentum_buffer"].lerp_(gradient, 1 - MOMENTUM)
        return gradient.lerp(average, MOMENTUM).flatten(1)


def _batches(weights: Sequence[Tensor]) -> list[list[Tensor]]:
    """Weights whose products are made together: on a GPU, where launches cost more than products, all of one shape."""
    found: dict[Any, list[Tensor]] = {}
    for index, weight in enumerate(weights):
        found.setdefault(index if weight.device.type == "cpu" else weight.shape, []).append(weight)
    return list(found.values())


def nearest_orthogonal(
    matrix: Float[Tensor, "*n a b"], coefficients: tuple[float, float, float], steps: int, eps: float
) -> Float[Tensor, "*n a b"]:
    """About U V^T of U Σ V^T, of one matrix or several: singular values near 1, by Newton and Schulz's iteration.

    Source: Jordan et al. 2024.

    All steps multiply X from the left by polynomials of the first X X^T, so for a long matrix they are made on that
    square, and X is multiplied once in the end (derived here); squares of bfloat16 would lose the small values.

    Args:
      coefficients: of X <- a X + (b X X^T + c (X X^T)²) X. eps: least norm that X is divided by at first.
    """
    a, b, c = coefficients
    wide = matrix if matrix.shape[-2] <= matrix.shape[-1] else matrix.mT
    found = wide / wide.norm(dim=(-2, -1), keepdim=True).clamp(min=eps)
    multiply_add = torch.addmm if matrix.ndim == 2 else torch.baddbmm
    if found.shape[-1] >= 2 * found.shape[-2] and found.dtype != torch.bfloat16:
        gram, product = found @ found.mT, None
        for step in range(steps):
            factor = multiply_add(gram, gram, gram, beta=b, alpha=c)
            factor.diagonal(dim1=-2, dim2=-1).add_(a)
            product = factor if product is None else factor @ product
            if step + 1 < steps:
                gram = factor @ gram @ factor
        found = found if product is None else product @ found
    else:
        for _ in range(steps):
            gram = found @ found.mT
            found = multiply_add(found, multiply_add(gram, gram, gram, beta=b, alpha=c), found, beta=a)
    return found if wide is matrix else found.mT


class Optimiser:
    """All optimisers of a model."""

    def __init__(
        self,
        model: nn.Module,
        groups: Sequence[Mapping[str, Any]],
        learning_rate: float,
        muon: float | None,
        muon_kernels: float | None,
        matmul: passes.Matmul = "float32",
    ) -> None:
        """Fresh state.

        Args:
          groups: AdamW's parameter groups; Muon takes its matrices out of them, and keeps their weight decay. `share`:
            of AdamW's learning rate, for what it keeps of a group; 1 where a group does not say it.
          learning_rate: AdamW's.
          muon: Muon's learning rate for hidden matrices, the spectral norm of a step; null: AdamW for them.
          muon_kernels: that for the kernels of convolutions; null: AdamW for them.
          matmul: how Muon's products are made.
        """
        kernels = [part.weight for part in model.modules() if isinstance(part, nn.Conv2d)]
        wanted = {"muon": (muon, siren.hidden_matrices(model)), "muon_kernels": (muon_kernels, kernels)}
        self._parts: dict[str, torch.optim.Optimizer] = {}
        rest = [{"share": 1.0, **group} for group in groups]
        for name, (rate, weights) in wanted.items():
            taken = set() if rate is None else {id(weight) for weight in weights}
            matrices = [part for part in (_part(group, taken, True) for group in rest) if part["params"]]
            rest = [_part(group, taken, False) for group in rest]
            if rate is not None and matrices:
                of_adamw = {"share": rate / learning_rate}
                self._parts[name] = Muon([part | of_adamw for part in matrices], rate, matmul)
        self._parts["optimiser"] = torch.optim.AdamW(rest, lr=learning_rate, fused=True)
        self.set_rate(learning_rate)

    def set_rate(self, rate: float) -> None:
        """AdamW's learning rate from now on; Muon's, and those of groups with a share, keep their ratio to it."""
        for part in self._parts.values():
            for group in part.param_groups:
                group["lr"] = rate * group["share"]

    def zero_grad(self) -> None:
        """Forget all gradients."""
        for part in self._parts.values():
            part.zero_grad(set_to_none=True)

    def step(self) -> None:
        """Move all parameters by their gradients."""
        for part in self._parts.values():
            part.step()

    def tensors(self) -> Iterator[tuple[str, Tensor]]:
        """The state, by names that `load` reads."""
        for part_name, part in self._parts.items():
            for index, state in part.state_dict()["state"].items():
                for name, value in state.items():
                    yield f"{part_name}.{index}.{name}", value

    def load(self, tensors: Mapping[str, Tensor]) -> None:
        """Take the state from what `tensors` gave, among others."""
        for part_name, part in self._parts.items():
            state: dict[int, dict[str, Tensor]] = {}
            for full_name, value in tensors.items():
                owner, _, rest = full_name.partition(".")
                if owner == part_name:
                    index, _, name = rest.partition(".")
                    state.setdefault(int(index), {})[name] = value
            part.load_state_dict({"state": state, "param_groups": part.state_dict()["param_groups"]})


def _part(group: Mapping[str, Any], taken: set[int], inside: bool) -> dict[str, Any]:
    """The group with those of its parameters that are `taken`, or with the others."""
    return {**group, "params": [each for each in group["params"] if (id(each) in taken) == inside]}
