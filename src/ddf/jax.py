"""A field as a function of JAX: rays in, what `ddf.torch.Field` says of them out, to be differentiated and compiled.

  parameters, ask = ddf.jax.field(ddf.load("rabbit-network"))
  slope = jax.grad(lambda p: ask(parameters, p, v).depth.sum())(p)

Numbers are of the type of the rays; float64 takes `jax_enable_x64`. Import it by `import ddf.jax`; JAX is no part of an
extra. Patches are traced on the CPU, behind `jax.pure_callback`.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import jax  # pyright: ignore[reportMissingImports]
import jax.numpy as jnp  # pyright: ignore[reportMissingImports]
import numpy as np
from jaxtyping import Float

from ddf.core import checks, extras

with extras.named():
    import torch

    from ddf import torch as ddf_torch
    from ddf.fields import derivatives, pddf
    from ddf.fields.grid import soft_rays

Parameters = Mapping[str, Any]  # a tree of arrays, to be trained; empty of patches
Ask = Callable[..., ddf_torch.Answer]
Within = Callable[[Parameters, jax.Array, jax.Array, Any], ddf_torch.Answer]  # field frame, a latent last
_TINY = 1e-30  # a direction along a side of the box


def field(shape: Any, soft: float | None = None) -> tuple[Parameters, Ask]:
    """The parameters of a field of `ddf.load`, `ddf.fit`, `ddf.generate` or `ddf.reconstruct`, and what asks it.

    Args:
      soft: of patches, as of `ddf.torch.Field`.
    Returns:
      parameters, and `ask(parameters, positions, directions, pose=None)`: an `Answer` as of `ddf.torch.Field.forward`,
      of positions and unit directions, (*batch, 3) once broadcast, in the frame and the unit of the mesh, which a pose
      (4, 4) moves.
    Raises:
      ValueError: something else, or a field by ONNX alone.
    """
    return _asking(ddf_torch.Field(shape, soft))


def of_model(model: str) -> tuple[Parameters, Ask]:
    """As `field`, of all shapes of chair, plane, car, or of the folder of a reconstruction model; `ask` takes a
    `latent` (k) too, of N(0, I) over objects; None is the mean shape.
    """
    return _asking(ddf_torch.Field.of_model(model))


def _asking(module: ddf_torch.Field) -> tuple[Parameters, Ask]:
    """Of the module that holds the same field."""
    own, field_from_mesh = module._ask, module._field_from_mesh
    patches = isinstance(own, ddf_torch._Patches)
    parameters, within = ({}, _patches(own.soft)) if patches else (_read(own), _network(own))

    def ask(
        parameters: Parameters, positions: Any, directions: Any, pose: Any = None, latent: Any = None
    ) -> ddf_torch.Answer:
        most = parameters["prior"][1].shape[1] if "prior" in parameters else 0
        if latent is not None and (jnp.ndim(latent) != 1 or not 0 < len(latent) <= most):
            raise checks.InputError(f"latent: none of one shape, else up to {most} in a row; got {jnp.shape(latent)}")
        asked = (jnp.asarray(each) * 1.0 for each in (positions, directions))  # whole numbers as real ones
        positions, directions = ddf_torch.broadcast(jnp.broadcast_arrays, *asked)
        to_field = jnp.asarray(field_from_mesh, positions.dtype)
        to_field = to_field if pose is None else to_field @ jnp.linalg.inv(jnp.asarray(pose)).astype(positions.dtype)
        linear, shape = to_field[:3, :3], positions.shape[:-1]
        along = (directions @ linear.T).reshape(-1, 3)
        stretch = jnp.linalg.norm(along, axis=-1, keepdims=True)
        start = (positions @ linear.T + to_field[:3, 3]).reshape(-1, 3)
        found = within(parameters, start, along / stretch, latent)
        met = jnp.isfinite(found.depth)
        depth = jnp.where(met, jnp.where(met, found.depth, 0.0) / stretch[:, 0], jnp.inf)
        normals = _unit(found.normals @ linear)
        found = found._replace(depth=depth, depths=found.depths / stretch, normals=normals)
        return ddf_torch.Answer(*(each.reshape((*shape, *each.shape[1:])) for each in found))

    return parameters, ask


def _read(own: ddf_torch._Network) -> Parameters:
    """Weights and biases; (mean, basis) of the prior where there is a modulator."""

    def pairs(layers: Iterable[Any]) -> list[tuple[jax.Array, ...]]:
        return [tuple(jnp.asarray(own.detach().numpy()) for own in (each.weight, each.bias)) for each in layers]

    found: dict[str, Any] = {"layers": pairs(own.field.network.layers), "head": pairs([own.field.network.head])[0]}
    if own.modulator is not None:
        found["modulator"] = pairs(own.modulator.layers)
        found["prior"] = [jnp.asarray(own.get_buffer(name).numpy()) for name in ("mean", "basis")]
    return found


def _network(own: ddf_torch._Network) -> Within:
    """A sine network in its box, field frame; see `fields.siren`, `fields.pddf`."""
    (lower, upper), omegas, config = own.box, own.field.network.omegas, own.field.config
    sharp = config.depth_sharpness

    def activated(raw: jax.Array) -> jax.Array:
        return jax.nn.relu(raw) if config.depth_activation == "relu" else jax.nn.softplus(sharp * raw) / sharp

    def raw_outputs(parameters: Parameters, modulations: Sequence[Any], p: jax.Array, v: jax.Array) -> jax.Array:
        hidden = jnp.concatenate([p, v])
        for (weight, bias), omega, modulation in zip(parameters["layers"], omegas, modulations, strict=True):
            hidden = modulation * jnp.sin(omega * (weight @ hidden + bias))
        weight, bias = parameters["head"]
        return weight @ hidden + bias

    def heavier(raw: jax.Array) -> jax.Array:
        return jnp.where(raw[..., pddf.WEIGHT_ROW] >= 0, raw[..., 0], raw[..., 1])

    def modulated(parameters: Parameters, u: Any, kind: Any) -> list[Any]:
        if "modulator" not in parameters:
            return [1.0] * len(omegas)
        mean, basis = (each.astype(kind) for each in parameters["prior"])
        features = latent = mean if u is None else mean + basis[:, : len(u)] @ jnp.asarray(u)
        found = []
        for weight, bias in parameters["modulator"]:
            found.append(jax.nn.softplus(weight @ features + bias))
            features = jnp.concatenate([found[-1], latent])
        return found

    def within(parameters: Parameters, start: jax.Array, along: jax.Array, u: Any) -> ddf_torch.Answer:
        divisor = jnp.where(jnp.abs(along) < _TINY, _TINY, along)
        low, high = (jnp.asarray(corner, start.dtype) for corner in (lower, upper))
        ends = jnp.stack([(low - start) / divisor, (high - start) / divisor])
        enter, leave = jnp.maximum(ends.min(0).max(-1), 0), ends.max(0).min(-1)
        meets = enter <= leave
        way = jnp.where(meets, enter, 0.0)[:, None]
        inside = jnp.where(meets[:, None], jnp.clip(start + way * along, low, high), 0.0)
        modulations = modulated(parameters, u, start.dtype)
        raw = jax.vmap(lambda p, v: raw_outputs(parameters, modulations, p, v))(inside, along)
        slope = jax.grad(lambda p, v: heavier(raw_outputs(parameters, modulations, p, v)))
        weight = jax.nn.sigmoid(raw[:, pddf.WEIGHT_ROW])
        return ddf_torch.Answer(
            visibility=jnp.where(meets, jax.nn.sigmoid(raw[:, pddf.VISIBILITY_ROW]), 0.0),
            depth=jnp.where(meets, activated(heavier(raw)) + way[:, 0], jnp.inf),
            depths=jnp.where(meets[:, None], activated(raw[:, : pddf.NUM_COMPONENTS]) + way, 0.0),
            weights=jnp.where(meets[:, None], jnp.stack([weight, 1 - weight], -1), 0.0),
            normals=jnp.where(meets[:, None], _facing(jax.vmap(slope)(inside, along), along), 0.0),
        )

    return within


def _patches(soft: soft_rays.SoftPatches) -> Within:
    """Patches, field frame, by Newton's method from the root as `ddf.torch` has it; see there."""
    rows, centres, count = soft.field.tree.patches, soft.field.tree.centres, soft_rays.COUNT
    axes = np.stack((*derivatives.tangent_basis(torch.from_numpy(rows[:, :3])), rows[:, :3]), 1)
    bends = np.stack((rows[:, 4:6], rows[:, 5:7]), 1)

    def traced(*asked: Float[jax.Array, "*n 3"]) -> Float[np.ndarray, "*n 8"]:
        met = soft.field.met(*(np.asarray(each, np.float64).reshape(-1, 3) for each in asked))
        return met.reshape(*asked[0].shape[:-1], 8).astype(asked[0].dtype)

    def bundled(*asked: Float[jax.Array, "*n 3"]) -> Float[np.ndarray, "*n out"]:
        start, along = (torch.tensor(np.asarray(each)) for each in asked)
        return soft(start, along).numpy()

    def pulled(upstream: Any, *asked: Float[jax.Array, "*n 3"]) -> list[np.ndarray]:
        start, along = (torch.tensor(np.asarray(each), requires_grad=True) for each in asked)
        found = torch.autograd.grad(soft(start, along), (start, along), torch.tensor(np.asarray(upstream)))
        return [each.numpy() for each in found]

    def said(*asked: jax.Array) -> jax.Array:
        kind = jax.ShapeDtypeStruct((*asked[0].shape[:-1], 2 * count), asked[0].dtype)
        return jax.pure_callback(bundled, kind, *asked, vmap_method="broadcast_all")

    def gradient(asked: tuple[jax.Array, ...], upstream: jax.Array) -> tuple[jax.Array, ...]:
        kinds = [jax.ShapeDtypeStruct(each.shape, each.dtype) for each in asked]
        return tuple(jax.pure_callback(pulled, kinds, upstream, *asked, vmap_method="broadcast_all"))

    raw_outputs: Any = jax.custom_vjp(said)
    raw_outputs.defvjp(lambda *asked: (said(*asked), asked), gradient)

    def softened(start: jax.Array, along: jax.Array, met: ddf_torch.Answer) -> ddf_torch.Answer:
        raw = raw_outputs(start, along)
        share = jax.nn.sigmoid(raw[:, pddf.VISIBILITY_ROW])
        share = share + jax.lax.stop_gradient((share - 0.5) / count)
        scores = jnp.pad(raw[:, count:-1], ((0, 0), (0, 1)))
        weights = jax.nn.softmax(scores) * (jax.lax.stop_gradient(share) > 0.5 / count)[:, None]
        return met._replace(visibility=share, depths=raw[:, :count], weights=weights)

    def within(_: Parameters, start: jax.Array, along: jax.Array, u: Any) -> ddf_torch.Answer:
        asked = [jax.lax.stop_gradient(each) for each in (start, along)]
        kind = jax.ShapeDtypeStruct((len(start), 8), start.dtype)
        met = jax.pure_callback(traced, kind, *asked, vmap_method="broadcast_all")
        seen = jnp.isfinite(met[:, 0])
        which = jnp.where(seen, met[:, 7], 0).astype(int)
        turn, bend, offset = (jnp.asarray(each, start.dtype)[which] for each in (axes, bends, rows[:, 3]))
        near = start - jnp.asarray(centres, start.dtype)[which]
        depth, slope = jnp.where(seen, met[:, 0], 0.0), along
        for step in range(3):
            x = jnp.einsum("nij,nj->ni", turn, near + depth[:, None] * along)
            bent = jnp.einsum("nij,nj->ni", bend, x[:, :2])
            slope = jnp.einsum("ni,nij->nj", jnp.concatenate([-bent, jnp.ones_like(x[:, 2:])], 1), turn)  # ∇f
            off, steep = x[:, 2] - offset - (bent * x[:, :2]).sum(-1) / 2, (slope * along).sum(-1)  # f, ∇f · v
            steep = jnp.where(jnp.abs(steep) < 1e-9, jnp.inf, steep)
            depth = depth - (off / steep if step < 2 else 0)
        normals = jnp.where(seen[:, None], _facing(slope, along), 0.0)
        first = jnp.where(seen, depth, 0.0)[:, None]
        visible = seen.astype(start.dtype)
        found = ddf_torch.Answer(visible, jnp.where(seen, depth, jnp.inf), first, visible[:, None], normals)
        return softened(start, along, found) if soft.radius else found

    return within


def _unit(vectors: jax.Array) -> jax.Array:
    """Of length 1; 0 stays 0, and finite in the gradient."""
    square = (vectors**2).sum(-1, keepdims=True)
    return jnp.where(square > 0, vectors / jnp.sqrt(jnp.where(square > 0, square, 1.0)), 0.0)


def _facing(gradient: jax.Array, along: jax.Array) -> jax.Array:
    """n = ±∇_p d/‖∇_p d‖ with n · v <= 0. Source: [DDF22] §3.1, Property II."""
    unit = _unit(gradient)
    return jnp.where((unit * along).sum(-1, keepdims=True) > 0, -unit, unit)
