"""AdamW, and Muon for the matrices between hidden layers and for the kernels of convolutions: one handle for all.

Muon (Jordan et al. 2024) moves a matrix by the nearest orthogonal one to the average of its gradients, so that no
direction waits for another; a kernel is a matrix of one row per output channel. AdamW keeps what is no such matrix:
first sine layers, heads, biases, scales.
"""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor, nn

from ddf.fields import passes, siren
from ddf.models import loop_config

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
        by_rate: dict[float, list[Tensor]] = {}
        for group in self.param_groups:
            weights = [each for each in group["params"] if each.grad is not None]
            if weights and group["weight_decay"]:
                _foreach("mul_", weights, 1 - group["lr"] * group["weight_decay"])
            by_rate.setdefault(group["lr"], []).extend(weights)
        for rate, weights in by_rate.items():
            for batches in _rounds(weights):
                self._move(batches, rate)

    def _move(self, batches: Sequence[Sequence[Tensor]], rate: float) -> None:
        """Of several batches of weights of one shape."""
        weights = list(itertools.chain.from_iterable(batches))
        ahead = iter(self._ahead(weights))
        stacks = [_stacked(list(itertools.islice(ahead, len(batch)))) for batch in batches]
        factors = [stack.to(passes.product_type(self.matmul, stack)) for stack in stacks]
        found = nearest_orthogonals(factors, QUINTIC, QUINTIC_STEPS, LEAST_NORM)
        for batch, moves in zip(batches, found, strict=True):
            rows, columns = moves.shape[-2:]
            moved = [each.reshape(batch[0].shape) for each in moves.reshape(-1, rows, columns)]
            _foreach("add_", batch, moved, alpha=-rate * max(1.0, rows / columns) ** 0.5)

    def _ahead(self, weights: Sequence[Tensor]) -> list[Float[Tensor, "a b"]]:
        """Nesterov's averages of the gradients, as matrices."""
        gradients = [weight.grad for weight in weights if weight.grad is not None]
        for weight in weights:
            if not self.state[weight]:
                self.state[weight]["momentum_buffer"] = torch.zeros_like(weight)
        averages = [self.state[weight]["momentum_buffer"] for weight in weights]
        _foreach("lerp_", averages, gradients, 1 - MOMENTUM)
        return [each.flatten(1) for each in _foreach("lerp", gradients, averages, MOMENTUM)]


def _foreach(name: str, *arguments: Any, **named: Any) -> Any:
    """torch's operator of this name for each of several tensors, which a GPU does at once."""
    return getattr(torch, f"_foreach_{name}")(*arguments, **named)


def _rounds(weights: Sequence[Tensor]) -> list[list[list[Tensor]]]:
    """Weights that are moved together, those of one shape side by side: on a GPU, where launches cost more than
    products, all of them; on a CPU, whose cache they would leave, each for itself.
    """
    if not weights or weights[0].device.type == "cpu":
        return [[[weight]] for weight in weights]
    found: dict[torch.Size, list[Tensor]] = {}
    for weight in weights:
        found.setdefault(weight.shape, []).append(weight)
    return [list(found.values())]


def _stacked(matrices: Sequence[Float[Tensor, "a b"]]) -> Float[Tensor, "*n a b"]:
    return matrices[0] if len(matrices) == 1 else torch.stack(list(matrices))


def nearest_orthogonals(
    matrices: Sequence[Tensor], coefficients: tuple[float, float, float], steps: int, eps: float
) -> list[Tensor]:
    """`nearest_orthogonal` of each; the squares of all long ones with as short a side are made together."""
    if len(matrices) == 1:
        return [nearest_orthogonal(matrices[0], coefficients, steps, eps)]
    unit = [_unit(each, eps) for each in matrices]
    found = [each if _is_long(each) else _iterated(each, coefficients, steps) for each in unit]
    by_side: dict[int, list[int]] = {}
    for index, each in enumerate(unit):
        if _is_long(each):
            by_side.setdefault(each.shape[-2], []).append(index)
    for side, members in by_side.items():
        grams = [(unit[index] @ unit[index].mT).reshape(-1, side, side) for index in members]
        products = _polynomial(torch.cat(grams), coefficients, steps).split([len(gram) for gram in grams])
        for index, product in zip(members, products, strict=True):
            found[index] = product.reshape(*unit[index].shape[:-2], side, side) @ unit[index]
    return [each if _is_wide(given) else each.mT for given, each in zip(matrices, found, strict=True)]


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
    found = _unit(matrix, eps)
    if _is_long(found):
        found = _polynomial(found @ found.mT, coefficients, steps) @ found
    else:
        found = _iterated(found, coefficients, steps)
    return found if _is_wide(matrix) else found.mT


def _is_wide(matrix: Float[Tensor, "*n a b"]) -> bool:
    return matrix.shape[-2] <= matrix.shape[-1]


def _is_long(wide: Float[Tensor, "*n a b"]) -> bool:
    return wide.shape[-1] >= 2 * wide.shape[-2] and wide.dtype != torch.bfloat16


def _unit(matrix: Float[Tensor, "*n a b"], eps: float) -> Float[Tensor, "*n c d"]:
    """Over its norm, the longer side last."""
    wide = matrix if _is_wide(matrix) else matrix.mT
    return wide / wide.norm(dim=(-2, -1), keepdim=True).clamp(min=eps)


def _multiply_add(added: Tensor, left: Tensor, right: Tensor, beta: float, alpha: float) -> Tensor:
    return (torch.addmm if added.ndim == 2 else torch.baddbmm)(added, left, right, beta=beta, alpha=alpha)


def _polynomial(
    gram: Float[Tensor, "*n a a"], coefficients: tuple[float, float, float], steps: int
) -> Float[Tensor, "*n a a"]:
    """What all steps together multiply X by, of the first X X^T; `steps` is at least 1."""
    a, b, c = coefficients
    product = gram
    for step in range(steps):
        factor = _multiply_add(gram, gram, gram, beta=b, alpha=c)
        factor.diagonal(dim1=-2, dim2=-1).add_(a)
        product = factor @ product if step else factor
        if step + 1 < steps:
            gram = factor @ gram @ factor
    return product


def _iterated(
    found: Float[Tensor, "*n a b"], coefficients: tuple[float, float, float], steps: int
) -> Float[Tensor, "*n a b"]:
    a, b, c = coefficients
    for _ in range(steps):
        gram = found @ found.mT
        found = _multiply_add(found, _multiply_add(gram, gram, gram, beta=b, alpha=c), found, beta=a, alpha=1.0)
    return found


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


def of(model: nn.Module, groups: Sequence[Mapping[str, Any]], config: loop_config.LoopConfig) -> Optimiser:
    """A fresh one of the model, of these parameter groups."""
    return Optimiser(model, groups, config.learning_rate, config.muon, config.muon_kernels, config.matmul)


def _part(group: Mapping[str, Any], taken: set[int], inside: bool) -> dict[str, Any]:
    """The group with those of its parameters that are `taken`, or with the others."""
    return {**group, "params": [each for each in group["params"] if (id(each) in taken) == inside]}
