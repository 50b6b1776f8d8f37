"""AdamW, and Muon for the matrices between hidden layers: one handle for both.

Muon (Jordan et al. 2024) moves a matrix by the nearest orthogonal one to the average of its gradients, so that no
direction waits for another. AdamW keeps what is no such matrix: first layers, heads, biases, encoders.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor, nn

from ddf import passes, siren


class Muon(torch.optim.Muon):
    """torch's own, with products in a type of choice: torch makes them in bfloat16, whatever the processor."""

    def __init__(self, groups: Sequence[Mapping[str, Any]], learning_rate: float, matmul: passes.Matmul) -> None:
        super().__init__([dict(group) for group in groups], lr=learning_rate, weight_decay=0.0)
        self.matmul: passes.Matmul = matmul

    @torch.no_grad()
    def step(self) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Move every matrix that has a gradient, as torch does it: Nesterov's average, decay apart from it."""
        for group in self.param_groups:
            for matrix in (each for each in group["params"] if each.grad is not None):
                state, rate = self.state[matrix], group["lr"]
                if not state:
                    state["momentum_buffer"] = torch.zeros_like(matrix)
                average = state["momentum_buffer"].lerp_(matrix.grad, 1 - group["momentum"])
                ahead = matrix.grad.lerp(average, group["momentum"])
                factors = ahead.to(passes.product_type(self.matmul, ahead))
                moved = nearest_orthogonal(factors, group["ns_coefficients"], group["ns_steps"], group["eps"])
                matrix.mul_(1 - rate * group["weight_decay"])
                taller = max(1.0, matrix.shape[0] / matrix.shape[1])
                matrix.add_(moved, alpha=-rate * taller**0.5)


def nearest_orthogonal(
    matrix: Float[Tensor, "a b"], coefficients: tuple[float, float, float], steps: int, eps: float
) -> Float[Tensor, "a b"]:
    """About U V^T of U Σ V^T: singular values near 1, by Newton and Schulz's iteration. Source: Jordan et al. 2024.

    Args:
      coefficients: of X <- a X + (b X X^T + c (X X^T)²) X. eps: least norm that X is divided by at first.
    """
    a, b, c = coefficients
    wide = matrix if matrix.shape[0] <= matrix.shape[1] else matrix.T
    found = wide / wide.norm().clamp(min=eps)
    for _ in range(steps):
        gram = found @ found.T
        found = torch.addmm(found, torch.addmm(gram, gram, gram, beta=b, alpha=c), found, beta=a)
    return found if wide is matrix else found.T


class Optimiser:
    """Both optimisers of a model."""

    def __init__(
        self,
        model: nn.Module,
        groups: Sequence[Mapping[str, Any]],
        learning_rate: float,
        muon: float | None,
        matmul: passes.Matmul = "float32",
    ) -> None:
        """Fresh state.

        Args:
          groups: AdamW's parameter groups; Muon takes its matrices out of them, and keeps their weight decay.
          learning_rate: AdamW's.
          muon: Muon's learning rate, the spectral norm of a step; null: AdamW for all.
          matmul: how Muon's products are made.
        """
        taken = set() if muon is None else {id(weight) for weight in siren.hidden_matrices(model)}
        rest, matrices = ([_part(group, taken, inside) for group in groups] for inside in (False, True))
        self._parts: dict[str, torch.optim.Optimizer] = {
            "optimiser": torch.optim.AdamW(rest, lr=learning_rate, fused=True)
        }
        matrices = [group for group in matrices if group["params"]]
        if muon is not None and matrices:
            self._parts["muon"] = Muon(matrices, muon, matmul)
        self._shares = {"optimiser": 1.0, "muon": 0.0 if muon is None else muon / learning_rate}

    def set_rate(self, rate: float) -> None:
        """AdamW's learning rate from now on; Muon's keeps its ratio to it."""
        for name, part in self._parts.items():
            for group in part.param_groups:
                group["lr"] = rate * self._shares[name]

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
