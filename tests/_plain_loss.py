"""The loss of a shape written from the paper's formulas, for tests of the package's explicit derivative passes."""

from collections.abc import Iterable

import torch
from torch import Tensor
from torch.nn import functional

from ddf.data.samples import sample_batch, sample_types
from ddf.fields import losses, pddf

KINDS = (*sample_types.ORDER, *sample_types.VALUES_ONLY)
DOUBLED = ("U", "A", "U+", "A+", "P")  # samples whose depth error counts twice


def plain_loss(
    field: pddf.PDDF, batch: sample_batch.SampleBatch, modulations: list[Tensor] | None, weights: losses.LossWeights
) -> Tensor:
    """𝔏_S by create_graph, written from the paper's formulas, one type at a time; none of the package's terms.

    Args:
      weights: with the paper's depth term, `depth_of` = chosen and `depth_huber` = None.
    """
    v, n, seen, truth = batch.directions, batch.normals, batch.visible, batch.depth
    p = batch.positions.clone().requires_grad_()
    raw = field(p, v, modulations)
    d, w, xi = field.depths(raw), torch.sigmoid(raw[..., 2]), torch.sigmoid(raw[..., 3])

    def gradient(values: Tensor) -> Tensor:
        return torch.autograd.grad(values.sum(), p, create_graph=True)[0]

    heaviest = (w < 0.5).long()[..., None]
    chosen = d.gather(-1, heaviest)[..., 0]
    unit = functional.normalize(gradient(raw[..., :2].gather(-1, heaviest)), dim=-1)
    rates = torch.stack([(gradient(d[..., i]) * v).sum(-1) for i in range(2)])
    xi_rate, w_rate = (gradient(xi) * v).sum(-1), (gradient(w) * n).sum(-1)
    stops = torch.tensor([0, *(batch.counts.get(k, 0) for k in KINDS)]).cumsum(0).tolist()
    where = {k: slice(stops[i], stops[i + 1]) for i, k in enumerate(KINDS)}
    known = [kind for kind in KINDS if kind != "E"]

    def mean(values: Tensor, kinds: Iterable[str]) -> Tensor:
        return torch.cat([values[:, where[k]] for k in kinds], dim=1).mean()

    doubled = torch.ones(raw.shape[1], dtype=raw.dtype)
    for kind in DOUBLED:
        doubled[where[kind]] = 2
    factor = seen.clone()
    factor[:, where["E"]] = xi[:, where["E"]].detach()
    eikonal = weights.eikonal_depth * factor * (rates + 1).square().sum(0) + weights.eikonal_visibility * xi_rate**2
    bce = -(seen * torch.log(xi) + (1 - seen) * torch.log(1 - xi))
    normal = -seen * (unit * n).sum(-1).abs()
    speed = torch.relu(weights.transition_speed - w_rate.abs()) ** 2
    return (
        weights.depth * mean(doubled * seen * (chosen - truth) ** 2, known)
        + weights.visibility * mean(bce, known)
        + weights.visibility_variance * mean(xi * (1 - xi), known)
        + weights.normals * mean(normal, "UAB")
        + mean(eikonal, "EUAB")
        + weights.weight_variance * mean(w * (1 - w), "EUAB")
        + weights.transition * mean(speed, "ST")
    )
