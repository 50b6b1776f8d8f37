"""Normals, depth gradients and mean curvature: explicit passes against autograd and finite differences.

A network of five layers of 256 (random weights: the arithmetic is the same) at oriented points of its box, in float32;
errors are against autograd in float64. Finite differences are central, with the step that is best in float32.
The mean curvature by autograd takes a gradient of each component of the gradient. The 99.9 % errors of finite
differences are those across a change of the heavier component, where depth jumps.
"""

import functools
from collections.abc import Callable

import torch
from torch import Tensor
from torch.nn import functional

from bench.lib import display, measuring
from ddf.fields import curvature, derivatives, pddf

THREADS, REPEATS, POINTS, SEED = 2, 7, 4096, 0
CONFIG = pddf.PDDFConfig((256,) * 5, 3.0, 1.0, "softplus", 100.0)
FIRST_STEP, SECOND_STEP = 5e-3, 3e-2
GRAZING = 0.1  # rays with a smaller |n·v| are left out: rounding decides which side faces the viewer
FLAT = 1e-3  # and so are those where the depth's activation all but vanishes, with a shorter gradient: no surface there
Ways = dict[str, Callable[[pddf.PDDF, Tensor, Tensor], Tensor]]


def chosen_raw(field: pddf.PDDF, positions: Tensor, directions: Tensor) -> Tensor:
    """Depth of the heavier component."""
    return field.depth(field(positions, directions))


def explicit_gradient(field: pddf.PDDF, positions: Tensor, directions: Tensor) -> Tensor:
    """∇_p d by one adjoint pass."""
    found = derivatives.trace(field.network, torch.cat((positions, directions), dim=-1))
    rows = pddf.heavier_rows(found.outputs)
    slope = (rows * field.depth_slopes(found.outputs)).sum(-1, keepdim=True)
    return slope * derivatives.adjoint(field.network, found.slopes, rows)


def autograd_gradient(field: pddf.PDDF, positions: Tensor, directions: Tensor) -> Tensor:
    """∇_p d by the reverse pass of torch."""
    p = positions.clone().requires_grad_()
    with torch.enable_grad():
        return torch.autograd.grad(chosen_raw(field, p, directions).sum(), p)[0]


def difference_gradient(field: pddf.PDDF, positions: Tensor, directions: Tensor) -> Tensor:
    """∇_p d from six more queries."""
    steps = FIRST_STEP * torch.eye(3).to(positions)
    ahead, behind = (
        torch.stack([chosen_raw(field, positions + sign * step, directions) for step in steps], dim=-1)
        for sign in (1, -1)
    )
    return (ahead - behind) / (2 * FIRST_STEP)


def normals_by(gradient: Callable[[pddf.PDDF, Tensor, Tensor], Tensor]) -> Callable[..., Tensor]:
    """Unit normals from a gradient."""
    return lambda field, positions, directions: derivatives.normals(gradient(field, positions, directions), directions)


def explicit_normals(field: pddf.PDDF, positions: Tensor, directions: Tensor) -> Tensor:
    """From the raw gradient: the depth's activation changes its length alone."""
    found = derivatives.trace(field.network, torch.cat((positions, directions), dim=-1))
    gradient = derivatives.adjoint(field.network, found.slopes, pddf.heavier_rows(found.outputs))
    return derivatives.normals(gradient, directions)


def explicit_mean(field: pddf.PDDF, positions: Tensor, directions: Tensor) -> Tensor:
    """Mean curvature by one forward, one adjoint and two tangent passes."""
    found = curvature.Surface(field, positions, directions)
    return found.mean


def trace_in_surface(hessian: Tensor, gradient: Tensor, directions: Tensor) -> Tensor:
    """tr(II) = n·v Σ_i t_i^T H t_i over a basis t of the surface."""
    normals = derivatives.normals(gradient, directions)
    sums = sum(torch.einsum("ni,nij,nj->n", t, hessian, t) for t in curvature.tangent_basis(normals))
    return (normals * directions).sum(-1) * sums


def autograd_mean(field: pddf.PDDF, positions: Tensor, directions: Tensor) -> Tensor:
    """Mean curvature by differentiating the gradient again."""
    p = positions.clone().requires_grad_()
    with torch.enable_grad():
        (gradient,) = torch.autograd.grad(chosen_raw(field, p, directions).sum(), p, create_graph=True)
        rows = [torch.autograd.grad(gradient[:, i].sum(), p, retain_graph=True)[0] for i in range(3)]
    return trace_in_surface(torch.stack(rows, dim=1), gradient.detach(), directions)


def difference_mean(field: pddf.PDDF, positions: Tensor, directions: Tensor) -> Tensor:
    """Mean curvature from five queries along the surface and six for its normal."""
    gradient = difference_gradient(field, positions, directions)
    normals = derivatives.normals(gradient, directions)
    middle, total = chosen_raw(field, positions, directions), 0.0
    for tangent in curvature.tangent_basis(normals):
        ahead, behind = (chosen_raw(field, positions + sign * SECOND_STEP * tangent, directions) for sign in (1, -1))
        total = total + (ahead - 2 * middle + behind) / SECOND_STEP**2
    return (normals * directions).sum(-1) * total


QUANTITIES: dict[str, Ways] = {
    "gradient": {
        "explicit": explicit_gradient,
        "autograd": autograd_gradient,
        "finite differences": difference_gradient,
    },
    "normals": {
        "explicit": explicit_normals,
        "autograd": normals_by(autograd_gradient),
        "finite differences": normals_by(difference_gradient),
    },
    "mean curvature": {
        "explicit": explicit_mean,
        "autograd": autograd_mean,
        "finite differences": difference_mean,
    },
}


def points(dtype: torch.dtype) -> tuple[Tensor, Tensor]:
    """Oriented points of the box."""
    generator = torch.Generator().manual_seed(SEED)
    positions = 2 * torch.rand((POINTS, 3), generator=generator, dtype=torch.float64) - 1
    directions = functional.normalize(torch.randn((POINTS, 3), generator=generator, dtype=torch.float64), dim=-1)
    return positions.to(dtype), directions.to(dtype)


def network(dtype: torch.dtype) -> pddf.PDDF:
    """The same weights in any type."""
    torch.manual_seed(SEED)
    return pddf.PDDF(CONFIG).requires_grad_(False).to(dtype)


SECTION = display.Section(views=(display.View("relative_p999", "error over the median value, 99.9 %", ("quantity",)),))


def main() -> None:
    """Measure every way of every quantity."""
    torch.set_num_threads(THREADS)
    field, inputs = network(torch.float32), points(torch.float32)
    positions, directions = (values.double() for values in inputs)
    precise = network(torch.float64), positions, directions
    gradient = autograd_gradient(*precise)
    steep = gradient.norm(dim=-1) > FLAT * gradient.norm(dim=-1).median()
    clear = steep & ((derivatives.normals(gradient, directions) * directions).sum(-1).abs() > GRAZING)
    chosen = {(quantity, name): way for quantity, ways in QUANTITIES.items() for name, way in ways.items()}
    named = {", ".join(key): functools.partial(way, field, *inputs) for key, way in chosen.items()}
    times = measuring.interleaved(named, REPEATS)
    rows = []
    for (quantity, name), way in chosen.items():
        truth = QUANTITIES[quantity]["autograd"](*precise)
        off = way(field, *inputs).double() - truth
        lengths, errors = ((x if x.ndim > 1 else x[:, None]).norm(dim=-1) for x in (truth, off))
        share = errors[clear] / lengths.median()
        error = {"relative_median": float(share.median()), "relative_p999": float(share.quantile(0.999))}
        size = {"quantity": quantity, "points": POINTS, "hidden": list(CONFIG.hidden)}
        row = measuring.row(name, size, times[f"{quantity}, {name}"], error)
        rows.append({**row, "points_per_s": POINTS / row["median_s"]})
    measuring.write("derivatives", THREADS, rows)
