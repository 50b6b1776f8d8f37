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

from ddf.fields import siren
from ddf.models import loop_config

MOMENTUM = 0.95
QUINTIC = (3.4445, -4.7750, 2.0315)  # coefficients, steps and least norm of Newton and Schulz's iteration, as published
QUINTIC_STEPS = 5
LEAST_NORM = 1e-7


class Muon(torch.optim.Optimizer):
    """torch's own Muon, but its products are of the weights' type, where torch makes them in bfloat16; and kernels of
    convolutions are taken too.
    """

    def __init__(self, groups: Sequence[Mapping[str, Any]], learning_rate: float) -> None:
        super().__init__([dict(group) for group in groups], {"lr": learning_rate, "weight_decay": 0.0})

    @torch.no_grad()
    def step(self) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Move every matrix that has a gradient, the way torch does: Nesterov's average, decay apart from it.

        A GPU, where launches cost more than products, moves all weights of one shape together; a CPU, whose cache they
        would leave, each for itself.
        """
        batches: dict[tuple[float, Any], list[Tensor]] = {}
        for group in self.param_groups:
            weights = [each for each in group["params"] if each.grad is not None]
            if weights and group["weight_decay"]:
                _foreach("mul_", weights, 1 - group["lr"] * group["weight_decay"])
            for weight in weights:
                batches.setdefault((group["lr"], self._together(weight)), []).append(weight)
        for (rate, _), weights in batches.items():
            self._move(weights, rate)

    @staticmethod
    def _together(weight: Tensor) -> Any:
        """What is equal for weights that are moved together."""
        return id(weight) if weight.device.type == "cpu" else weight.shape

    def _move(self, weights: Sequence[Tensor], rate: float) -> None:
        """Of several weights of one shape."""
        for weight in weights:
            if not self.state[weight]:
                self.state[weight]["momentum_buffer"] = torch.zeros_like(weight)
        gradients = [weight.grad for weight in weights if weight.grad is not None]
        averages = [self.state[weight]["momentum_buffer"] for weight in weights]
        _foreach("lerp_", averages, gradients, 1 - MOMENTUM)
        ahead = [each.flatten(1) for each in _foreach("lerp", gradients, averages, MOMENTUM)]
        stack = ahead[0] if len(ahead) == 1 else torch.stack(ahead)
        moves = nearest_orthogonal(stack, QUINTIC, QUINTIC_STEPS, LEAST_NORM)
        rows, columns = moves.shape[-2:]
        moved = [each.reshape(weights[0].shape) for each in moves.reshape(-1, rows, columns)]
        _foreach("add_", weights, moved, alpha=-rate * max(1.0, rows / columns) ** 0.5)


def _foreach(name: str, *arguments: Any, **named: Any) -> Any:
    """torch's operator of this name for each of several tensors, which a GPU does at once."""
    return getattr(torch, f"_foreach_{name}")(*arguments, **named)


def nearest_orthogonal(
    matrix: Float[Tensor, "*n a b"], coefficients: tuple[float, float, float], steps: int, eps: float
) -> Float[Tensor, "*n a b"]:
    """About U V^T of U Σ V^T, of one matrix or several: singular values near 1, by Newton and Schulz's iteration.

    Source: Jordan et al. 2024.

    All steps multiply X from the left by polynomials of the first X X^T, so for a long matrix they are made on that
    square, and X is multiplied once in the end (derived here).

    Args:
      coefficients: of X <- a X + (b X X^T + c (X X^T)²) X. eps: least norm that X is divided by at first.
    """
    a, b, c = coefficients
    wide = matrix.shape[-2] <= matrix.shape[-1]
    found = matrix if wide else matrix.mT
    found = found / found.norm(dim=(-2, -1), keepdim=True).clamp(min=eps)
    if found.shape[-1] >= 2 * found.shape[-2]:
        gram = found @ found.mT
        product = gram
        for step in range(steps):
            factor = _multiply_add(gram, gram, gram, beta=b, alpha=c)
            factor.diagonal(dim1=-2, dim2=-1).add_(a)
            product = factor @ product if step else factor
            if step + 1 < steps:
                gram = factor @ gram @ factor
        found = product @ found
    else:
        for _ in range(steps):
            gram = found @ found.mT
            found = _multiply_add(found, _multiply_add(gram, gram, gram, beta=b, alpha=c), found, beta=a, alpha=1.0)
    return found if wide else found.mT


def _multiply_add(added: Tensor, left: Tensor, right: Tensor, beta: float, alpha: float) -> Tensor:
    return (torch.addmm if added.ndim == 2 else torch.baddbmm)(added, left, right, beta=beta, alpha=alpha)


class Optimiser:
    """All optimisers of a model."""

    def __init__(self, model: nn.Module, groups: Sequence[Mapping[str, Any]], config: loop_config.LoopConfig) -> None:
        """Fresh state.

        Args:
          groups: AdamW's parameter groups; Muon takes its matrices out of them, and keeps their weight decay. `share`:
            of AdamW's learning rate, for what it keeps of a group; 1 where a group does not say it.
        """
        kernels = [part.weight for part in model.modules() if isinstance(part, nn.Conv2d)]
        matrices = siren.hidden_matrices(model)
        wanted = {"muon": (config.muon, matrices), "muon_kernels": (config.muon_kernels, kernels)}
        self._parts: dict[str, torch.optim.Optimizer] = {}
        rest = [{"share": 1.0, **group} for group in groups]
        for name, (rate, weights) in wanted.items():
            taken = set() if rate is None else {id(weight) for weight in weights}
            own = [part for part in (_part(group, taken, True) for group in rest) if part["params"]]
            rest = [_part(group, taken, False) for group in rest]
            if rate is not None and own:
                share = {"share": rate / config.learning_rate}
                self._parts[name] = Muon([part | share for part in own], rate)
        self._parts["optimiser"] = torch.optim.AdamW(rest, lr=config.learning_rate, fused=True)
        self.set_rate(config.learning_rate)

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
