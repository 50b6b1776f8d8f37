"""A field of one shape as a pure function of (parameters, rays) in JAX, for `jit`, `grad` and `vmap`. Needs no torch.

The ray enters the box by the slab test (`rays.box_span`); the network is that of `siren`, with ω in its weights.
"""

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ddf.core import checks, shipped_models
from ddf.fields import field_file

Parameters = list[tuple[Any, Any]]  # weights (out, in) and biases (out) of each layer, the head last
Function = Callable[[Parameters, Any, Any], tuple[Any, Any]]


def load(path_or_name: str | Path) -> tuple[Parameters, Function]:
    """Parameters, and the function of (parameters, positions, directions) that gives depth and visibility.

    Args:
      path_or_name: the folder of a field of one network (`ddf fit --kind sine`), or the name of a shipped one.
    Returns:
      A list of arrays, and a function of positions and unit directions (*b, 3), frame and unit of the mesh, float32:
      depth (*b), of the heaviest component, whether or not anything is seen, and visibility (*b), 0 where the ray
      misses the box.
    Raises:
      FileNotFoundError: there is no such field. InputError: it is of another kind or damaged, or jax is not installed.

    Example: where a mesh moved by some shift lies, from depths that were seen.
      parameters, field = jax_field.load("rabbit")
      def loss(shift):
          return abs(field(parameters, positions - shift, directions)[0] - seen).mean()
      descend = jax.jit(jax.grad(loss))
      shift = jax.numpy.zeros(3)
      for step in range(200):
          shift -= 0.02 * 0.98**step * descend(shift)
    """
    try:
        jax: Any = importlib.import_module("jax")
    except ModuleNotFoundError as error:
        raise checks.InputError("this needs jax: pip install jax") from error
    xp = jax.numpy
    stored = field_file.read(shipped_models.place(path_or_name))
    parameters = [(xp.asarray(omega * weight), xp.asarray(omega * bias)) for weight, bias, omega in stored.layers()]
    similar, sharpness = stored.field_from_mesh, stored.config["depth_sharpness"]
    matrix, shift = (np.float32(each) for each in (similar.scale * similar.rotation.T, similar.translation))
    lower, upper = np.float32(stored.lower), np.float32(stored.upper)

    def field(parameters: Parameters, positions: Any, directions: Any) -> tuple[Any, Any]:
        p, v = positions @ matrix + shift, directions @ np.float32(similar.rotation.T)
        parallel, between = v == 0, (p >= lower) & (p <= upper)
        inverse = 1 / xp.where(parallel, 1, v)
        to_lower, to_upper = (lower - p) * inverse, (upper - p) * inverse
        always = xp.where(between, xp.inf, -xp.inf)
        near = xp.where(parallel, -always, xp.minimum(to_lower, to_upper)).max(-1)
        far = xp.where(parallel, always, xp.maximum(to_lower, to_upper)).min(-1)
        near = xp.maximum(near, 0)
        meets = near <= far
        way = xp.where(meets, near, 0)
        hidden = xp.concatenate((xp.clip(p + way[..., None] * v, lower, upper), v), -1)
        for weight, bias in parameters[:-1]:
            hidden = xp.sin(hidden @ weight.T + bias)
        raw = hidden @ parameters[-1][0].T + parameters[-1][1]
        depth = xp.where(raw[..., 2] >= 0, raw[..., 0], raw[..., 1])
        relu = stored.config["depth_activation"] == "relu"
        depth = jax.nn.relu(depth) if relu else jax.nn.softplus(sharpness * depth) / sharpness
        return (depth + way) / similar.scale, xp.where(meets, jax.nn.sigmoid(raw[..., -1]), 0)

    return parameters, field
