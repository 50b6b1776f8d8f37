"""A field as a module of torch: rays in, what it says of them out, with gradients.

Positions and directions have any batch shape, are float32 or float64, and in the frame and the unit of the mesh.
Gradients go to them, a pose, a latent and a network's parameters; first and second ones wherever the field is smooth.
"""

import copy
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ddf.api import field as api_field
from ddf.api import reconstruction
from ddf.core import arrays, checks, extras, shipped_models

with extras.named():
    import torch
    from torch import Tensor, nn

    from ddf.fields import derivatives, field_values, pddf, shape_field
    from ddf.fields.grid import patch_field, soft_rays
    from ddf.fit import latent_prior
    from ddf.geometry import rays, transforms

Vectors = Float[Tensor, "*batch 3"]
SOFT = 0.03  # of half the longest side: radius of a ray of patches, as of `ddf.recover_pose`


class Answer(NamedTuple):
    """What is said of rays. depth: of the likeliest surface, also where visibility is low; `inf` of none.

    depths, weights: of the k surfaces that a network holds possible (2), or that the rays within the radius of a soft
    one meet (12); 0 of none. normals: unit, facing back; 0 without a depth.
    """

    visibility: Float[Tensor, "*batch"]
    depth: Float[Tensor, "*batch"]
    depths: Float[Tensor, "*batch k"]
    weights: Float[Tensor, "*batch k"]
    normals: Vectors


class Field(nn.Module):
    """A field of one shape, or of all shapes of a category (`of_model`).

    A network's parameters are a copy, to be trained; `double()` evaluates them in float64. Patches have none, are asked
    on the CPU, and their visibility is a staircase of 13 values, the share of 12 rays, with the first derivatives of a
    smooth share.

    Args:
      field: of `ddf.load`, `ddf.fit`, `ddf.generate` or `ddf.reconstruct`; else, or by ONNX alone, a ValueError.
      soft: of patches: radius of a ray, unit of the mesh; None is `SOFT`, 0 a sharp edge, which has no gradient.
    """

    def __init__(self, field: Any, soft: float | None = None) -> None:
        super().__init__()
        shape = field.field if isinstance(field, reconstruction.Reconstruction) else field
        shape = shape.weights if isinstance(shape, api_field.Field) else shape
        if isinstance(shape, patch_field.PatchField):
            self._ask: Any = _Patches(shape, SOFT if soft is None else soft * shape.field_from_mesh.scale)
        elif isinstance(shape, shape_field.ShapeField):
            self._ask = _Network(copy.deepcopy(shape.field), shape.lower, shape.upper)
        else:
            raise checks.InputError(f"give a field of ddf.load, fit, generate or reconstruct; got {type(field)}")
        self._field_from_mesh = shape.field_from_mesh.to_matrix()

    @classmethod
    def of_model(cls, model: str) -> "Field":
        """All shapes of chair, plane, car, or of the folder of a reconstruction model; their frame is [-1, 1]³."""
        shapes, made = latent_prior.load(shipped_models.require(model, "reconstruction")), cls.__new__(cls)
        nn.Module.__init__(made)
        made._ask = _Network(shapes.decoder.field, -np.ones(3), np.ones(3), shapes.decoder.modulator, shapes.prior)
        made._field_from_mesh = np.eye(4)
        return made

    def forward(
        self, positions: Tensor, directions: Tensor, pose: Tensor | None = None, latent: Tensor | None = None
    ) -> Answer:
        """What is seen from positions along unit directions, (*batch, 3) once broadcast, in their type.

        With a pose (4, 4), of scale, turn and shift, the mesh stands there, and rays and answers are of that frame. A
        latent (k) of `of_model` is N(0, I) over objects, on as many axes as wanted; None is the mean shape.
        ValueError of what is no ray, a latent of one shape, a pose without gradient that shears.
        """
        positions, directions = broadcast(torch.broadcast_tensors, positions, directions)
        basis = getattr(self._ask, "basis", None)
        most = 0 if basis is None else basis.shape[1]
        if latent is not None and (latent.ndim != 1 or not 0 < len(latent) <= most):
            raise checks.InputError(f"latent: none of one shape, else up to {most} in a row; got {tuple(latent.shape)}")
        for name, given in (("positions", positions), ("directions", directions), ("latent", latent)):
            if given is not None and not given.isfinite().all():
                checks.require_finite(name, given)
        if ((directions.detach().norm(dim=-1) - 1).abs() > checks.UNIT_LENGTH_TOLERANCE).any():
            checks.require_unit("directions", directions)
        if pose is not None and not pose.requires_grad:
            transforms.Similarity.of_matrix("pose", arrays.to_numpy(pose), 1e-3)
        to_field = positions.new_tensor(self._field_from_mesh)
        to_field = to_field if pose is None else to_field @ torch.linalg.inv(pose).to(to_field)
        linear, shape = to_field[:3, :3], positions.shape[:-1]
        along = (directions @ linear.T).reshape(-1, 3)
        stretch = along.norm(dim=-1, keepdim=True)
        start = (positions @ linear.T + to_field[:3, 3]).reshape(-1, 3)
        found = Answer(*(each.to(start) for each in self._ask(start, along / stretch, latent)))
        normals = nn.functional.normalize(found.normals @ linear, dim=-1)
        met = found.depth.detach().isfinite()  # an infinite depth over a length would have no gradient in it
        depth = torch.where(met, torch.where(met, found.depth, 0.0) / stretch[:, 0], torch.inf)
        found = found._replace(depth=depth, depths=found.depths / stretch, normals=normals)
        return Answer(*(each.reshape((*shape, *each.shape[1:])) for each in found))


class _Network(nn.Module):
    """A sine network in its box, field frame; with a modulator, the shapes of a prior."""

    def __init__(self, field: pddf.PDDF, lower: Any, upper: Any, modulator: Any = None, prior: Any = None) -> None:
        super().__init__()
        self.field, self.box, self.modulator = field.requires_grad_(), (lower, upper), modulator
        for name in ("mean", "basis"):
            self.register_buffer(name, getattr(prior, name, None))

    def forward(self, start: Vectors, along: Vectors, u: Tensor | None) -> Answer:
        entry, way, meets = rays.enter_box(start, along, *(start.new_tensor(corner) for corner in self.box))
        inside, looking = (each[meets].to(self.field.network.head.weight) for each in (entry, along))
        mean, basis = self.get_buffer("mean"), self.get_buffer("basis")
        latent = mean if u is None or mean is None else mean + basis[:, : len(u)] @ u.to(mean)
        modulations = self.modulator and [each[0] for each in self.modulator(latent[None])]
        said = field_values.FieldValues(self.field, inside, looking, modulations)
        depth, depths = said.depth + way[meets], self.field.depths(said.raw) + way[meets][:, None]
        met = said.visibility, depth, depths, said.weights, said.normals
        return Answer(*(_among(meets, *each) for each in zip(met, (0.0, torch.inf, 0.0, 0.0, 0.0), strict=True)))


class _Patches:
    """Patches, field frame. Two steps of Newton from the root on a patch have its derivatives up to the third."""

    def __init__(self, field: patch_field.PatchField, radius: float) -> None:
        if not 0 <= radius < np.inf:
            raise checks.InputError(f"soft must be a radius, 0 or more; got {radius} in half longest sides")
        self.tree, self.soft = field.tree, soft_rays.SoftPatches(field, radius)

    def __call__(self, start: Vectors, along: Vectors, _: None) -> Answer:
        met = torch.from_numpy(self.soft.field.met(start.detach().cpu().numpy(), along.detach().cpu().numpy()))
        met, start, along = met.to(start.device), start.double(), along.double()
        seen, count = met[:, 0].isfinite(), soft_rays.COUNT
        on_patch = self._on_patch(start[seen], along[seen], met[seen])
        depth, normals = (_among(seen, *each) for each in zip(on_patch, (torch.inf, 0.0), strict=True))
        if self.soft.radius == 0:
            return Answer(seen, depth, _among(seen, on_patch[0][:, None], 0.0), seen[:, None], normals)
        raw = self.soft(start.cpu(), along.cpu()).to(start)
        share = pddf.visibility(raw)  # it is never 0 or 1, but its gradient is that of the share of rays
        share = share + ((share - 0.5) / count).detach()
        weights = pddf.scores(raw).softmax(-1) * (share.detach() > 0.5 / count)[:, None]
        return Answer(share, depth, self.soft.depths(raw), weights, normals)

    def _on_patch(self, start: Vectors, along: Vectors, met: Float[Tensor, "n 8"]) -> tuple[Tensor, Tensor]:
        which = met[:, 7].long().cpu().numpy()
        rows, centres = (torch.from_numpy(each[which]).to(met) for each in (self.tree.patches, self.tree.centres))
        axes = torch.stack((*derivatives.tangent_basis(rows[:, :3]), rows[:, :3]), 1)
        bends, depth, slope = torch.stack((rows[:, 4:6], rows[:, 5:7]), 1), met[:, 0], along
        for step in range(3):
            x = (axes @ (start - centres + depth[:, None] * along)[..., None])[..., 0]
            bent = (bends @ x[:, :2, None])[..., 0]
            slope = (torch.cat((-bent, torch.ones_like(x[:, 2:])), 1)[:, None] @ axes)[:, 0]  # ∇f
            off, steep = x[:, 2] - rows[:, 3] - (bent * x[:, :2]).sum(-1) / 2, (slope * along).sum(-1)  # f, ∇f · v
            depth = depth - (off / torch.where(steep.abs() < 1e-9, torch.inf, steep) if step < 2 else 0)
        return depth, derivatives.normals(slope, along)


def broadcast(library: Callable[..., Any], *given: Any) -> Any:
    """Positions and directions in one shape (*batch, 3), by a library's function; InputError where there is none."""
    for name, each in zip(("positions", "directions"), given, strict=True):
        checks.require_vectors(name, each)
    try:
        return library(*given)
    except (RuntimeError, ValueError) as error:
        raise checks.InputError(f"positions and directions must fit each other: {error}") from error


def _among(chosen: Tensor, values: Tensor, empty: float) -> Tensor:
    """Values of chosen rays among all."""
    return values.new_full((len(chosen), *values.shape[1:]), empty).index_put((chosen,), values)
