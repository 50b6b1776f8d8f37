"""AdamW, and Muon for the matrices between hidden layers: one handle for both.

Muon (Jordan et al. 2024; torch's own) moves a matrix by the nearest orthogonal one to the average of its gradients, so
that no direction waits for another. AdamW keeps what is no such matrix: first layers, heads, biases, encoders.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import torch
from torch import Tensor, nn

from ddf import siren


class Optimiser:
    """Both optimisers of a model."""

    def __init__(
        self, model: nn.Module, groups: Sequence[Mapping[str, Any]], learning_rate: float, muon: float | None
    ) -> None:
        """Fresh state.

        Args:
          groups: AdamW's parameter groups; Muon takes its matrices out of them, and keeps their weight decay.
          learning_rate: AdamW's.
          muon: Muon's learning rate, the spectral norm of a step; null: AdamW for all.
        """
        taken = set() if muon is None else {id(weight) for weight in siren.hidden_matrices(model)}
        rest, matrices = ([_part(group, taken, inside) for group in groups] for inside in (False, True))
        self._parts: dict[str, torch.optim.Optimizer] = {
            "optimiser": torch.optim.AdamW(rest, lr=learning_rate, fused=True)
        }
        matrices = [group for group in matrices if group["params"]]
        if muon is not None and matrices:
            self._parts["muon"] = torch.optim.Muon(matrices, lr=muon, weight_decay=0.0)
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
