"""Value, tangent and adjoint pass of a sine network with their reverse written out: the work of a training step.

Letters as in `siren` and `derivatives`, with ω_l folded into W_l and b_l, q_l = m_l cos a_l, and x* for ∂loss/∂x:

  value    a_l = W_l h_{l-1} + b_l, h_l = m_l sin a_l, y = W h_L + b
  tangent  ȧ_l = W_l ḣ_{l-1}, ḣ_l = q_l ȧ_l, ẏ = W ḣ_L
  adjoint  g_L = W^T g, ā_l = q_l g_l, g_{l-1} = W_l^T ā_l, ∇_p = g_0

and in reverse, the adjoint pass from the first layer up, the other two from the last one down:

  ā*_l = W_l g*_{l-1}, g*_l = q_l ā*_l
  ȧ*_l = q_l ḣ*_l, ḣ*_{l-1} = W_l^T ȧ*_l
  a*_l = q_l h*_l - h_l q*_l, h*_{l-1} = W_l^T a*_l

  q*_l = ȧ_l ḣ*_l + g_l ā*_l,   m*_l = Σ (h_l h*_l + q_l q*_l) / m_l,   b*_l = Σ a*_l,
  W*_l = Σ a*_l h_{l-1}^T + ȧ*_l ḣ_{l-1}^T + ā_l g*_{l-1}^T          (all derived here)

No graph is kept, one sine and one cosine are taken per unit, and a block of points that fits the cache goes through all
six passes before the next one comes, in the same memory.

On a GPU torch's compiler makes few kernels of the passes of a block and the loss between them. There each operator is a
kernel that reads and writes all of its values, which takes longer than the matrix products between them. The compiler
joins what lies between two products. A CPU's blocks stay in its cache.
"""

import contextlib
import functools
import logging
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor, nn

from ddf.data.samples import sample_batch
from ddf.fields import siren
from ddf.fields.derivatives import POSITION
from ddf.fields.pddf import PDDF


@contextlib.contextmanager
def rounded(device: torch.device) -> Iterator[None]:
    """On a GPU, products have the ten-bit factors of `tf32` within: for a descent that needs a direction, no depth."""
    before = torch.get_float32_matmul_precision()
    torch.set_float32_matmul_precision("high" if device.type == "cuda" else before)
    try:
        yield
    finally:
        torch.set_float32_matmul_precision(before)


class Workspace:
    """Memory that every block uses again: its i-th request gets the i-th buffer, which grows when it must.

    Fresh memory for every result costs up to a tenth of a step, in page faults.
    """

    def __init__(self, like: Tensor) -> None:
        self.like, self.taken = like, 0
        self.buffers: list[Tensor] = []

    def restart(self) -> None:
        """A new block: whatever was taken before is given up."""
        self.taken = 0

    def take(self, shape: Sequence[int]) -> Tensor:
        """A tensor of any content, for as long as the block lasts."""
        if self.taken == len(self.buffers):
            self.buffers.append(self.like.new_empty(0))
        if self.buffers[self.taken].numel() < math.prod(shape):
            self.buffers[self.taken] = self.like.new_empty(math.prod(shape))
        self.taken += 1
        return self.buffers[self.taken - 1][: math.prod(shape)].view(*shape)


class FreshMemory(Workspace):
    """Memory of its own for every request, which a compiler plans better than the buffers of a `Workspace`."""

    def take(self, shape: Sequence[int]) -> Tensor:
        """A tensor of any content."""
        return self.like.new_empty(shape)


class Parameters:
    """The parameters of a sine network as the passes read them, and the sums of their gradients over blocks."""

    def __init__(self, network: siren.SineNetwork, memory: type[Workspace] = Workspace) -> None:
        self.omegas = network.omegas
        scaled = list(zip(network.layers, network.omegas, strict=True))
        self.weights = [layer.weight.detach() * omega for layer, omega in scaled]
        self.biases = [layer.bias.detach() * omega for layer, omega in scaled]
        self.head, self.head_bias = network.head.weight.detach(), network.head.bias.detach()
        self.weight_grads = [torch.zeros_like(weight) for weight in self.weights]
        self.bias_grads = [torch.zeros_like(bias) for bias in self.biases]
        self.workspace = memory(self.head)
        self.head_grad, self.head_bias_grad = torch.zeros_like(self.head), torch.zeros_like(self.head_bias)

    def gradients(self) -> list[Tensor]:
        """The sums, in the order of `network.parameters()`."""
        found = []
        for weight, bias, omega in zip(self.weight_grads, self.bias_grads, self.omegas, strict=True):
            found += [weight * omega, bias * omega]
        return [*found, self.head_grad, self.head_bias_grad]

    def sums(self) -> list[Tensor]:
        """All that blocks add to."""
        return [*self.weight_grads, *self.bias_grads, self.head_grad, self.head_bias_grad]

    def affine(self, index: int, inputs: Float[Tensor, "*n _"]) -> Float[Tensor, "*n _"]:
        """W_l x + b_l."""
        found = self.workspace.take((*inputs.shape[:-1], len(self.biases[index])))
        torch.addmm(self.biases[index], inputs.flatten(0, -2), self.weights[index].T, out=found.flatten(0, -2))
        return found

    def product(self, left: Float[Tensor, "*n _"], right: Float[Tensor, "a b"]) -> Float[Tensor, "*n _"]:
        """Of every row with a matrix."""
        found = self.workspace.take((*left.shape[:-1], right.shape[-1]))
        torch.mm(left.flatten(0, -2), right, out=found.flatten(0, -2))
        return found

    def times(self, left: Float[Tensor, "*n _"], right: Float[Tensor, "*n _"]) -> Float[Tensor, "*n _"]:
        """left * right."""
        return torch.mul(left, right, out=self.workspace.take(left.shape))


class Block:
    """A block of points of several shapes on its way through the passes: `__init__`, `adjoint`, then `reverse`.

    outputs: y of all points. rates: ẏ = ∇_p y · t of the first k points.

    Args:
      directions: t, any length, of the first k points; k may be 0.
      modulations: one per layer, positive, or None.
    """

    outputs: Float[Tensor, "shapes n out"]
    rates: Float[Tensor, "shapes k out"]

    def __init__(
        self,
        parameters: Parameters,
        inputs: Float[Tensor, "shapes n in"],
        directions: Float[Tensor, "shapes k 3"],
        modulations: Sequence[Float[Tensor, "shapes 1 _"]] | None,
    ) -> None:
        self.parameters, self.modulations = parameters, modulations
        self.inputs, self.directions, self.count = inputs, directions, directions.shape[1]
        self.values, self.slopes, self.tangents, self.rates_of_values = [], [], [], []  # h_l, q_l, ȧ_l, ḣ_l
        parameters.workspace.restart()
        angles = nn.functional.linear(inputs, parameters.weights[0], parameters.biases[0])
        tangent = torch.matmul(directions, parameters.weights[0][:, POSITION].T)
        for index in range(len(parameters.weights)):
            if index > 0:
                angles = parameters.affine(index, self.values[-1])
                tangent = parameters.product(self.rates_of_values[-1], parameters.weights[index].T)
            slope = torch.cos(angles, out=parameters.workspace.take(angles.shape))
            value = angles.sin_()
            if modulations is not None:
                slope *= modulations[index]
                value *= modulations[index]
            self.values.append(value)
            self.slopes.append(slope)
            self.tangents.append(tangent)
            self.rates_of_values.append(parameters.times(tangent, slope[:, : self.count]))
        self.outputs = nn.functional.linear(self.values[-1], parameters.head, parameters.head_bias)
        self.rates = torch.matmul(self.rates_of_values[-1], parameters.head.T)

    def adjoint(self, span: slice, cotangents: Float[Tensor, "shapes m rows"]) -> Float[Tensor, "shapes m 3"]:
        """∇_p (g · y) of the points of `span`, which is among the first k; `cotangents` is g over the first outputs."""
        parameters = self.parameters
        self.span, self.cotangents = span, cotangents
        self.gradients, self.adjoints = [], []  # g_l and ā_l, last layer first
        gradient = torch.matmul(cotangents, parameters.head[: cotangents.shape[-1]])
        for index in reversed(range(len(parameters.weights))):
            self.gradients.append(gradient)
            self.adjoints.append(parameters.times(gradient, self.slopes[index][:, span]))
            if index > 0:
                gradient = parameters.product(self.adjoints[-1], parameters.weights[index])
        return torch.matmul(self.adjoints[-1], parameters.weights[0][:, POSITION])

    def reverse(
        self,
        outputs: Float[Tensor, "shapes n out"],
        rates: Float[Tensor, "shapes k out"],
        gradient: Float[Tensor, "shapes m 3"],
    ) -> list[Float[Tensor, "shapes 1 _"]]:
        """Add the block's part to the sums of the parameters, from y*, ẏ* and that of what `adjoint` gave; m*_l of each
        layer, nothing without modulations. Once, for the states of the block are used up.
        """
        parameters = self.parameters
        slopes = self._reverse_adjoint(gradient)
        _add_outer(parameters.head_grad, outputs, self.values[-1])
        _add_outer(parameters.head_grad, rates, self.rates_of_values[-1])
        parameters.head_bias_grad += outputs.sum((0, 1))
        value, tangent = torch.matmul(outputs, parameters.head), torch.matmul(rates, parameters.head)
        modulations = []
        for index in reversed(range(len(parameters.weights))):
            slope = self.tangents[index].mul_(tangent)
            slope[:, self.span] += slopes[index]
            if self.modulations is not None:
                modulations.append(self._modulation_gradient(index, value, slope))
            tangent *= self.slopes[index][:, : self.count]
            value *= self.slopes[index]
            value[:, : self.count].addcmul_(self.values[index][:, : self.count], slope, value=-1.0)
            parameters.bias_grads[index] += value.sum((0, 1))
            if index == 0:
                _add_outer(parameters.weight_grads[0], value, self.inputs)
                _add_outer(parameters.weight_grads[0][:, POSITION], tangent, self.directions)
                break
            _add_outer(parameters.weight_grads[index], value, self.values[index - 1])
            _add_outer(parameters.weight_grads[index], tangent, self.rates_of_values[index - 1])
            value, tangent = (parameters.product(each, parameters.weights[index]) for each in (value, tangent))
        return modulations[::-1]

    def _reverse_adjoint(self, gradient: Float[Tensor, "shapes m 3"]) -> list[Float[Tensor, "shapes m _"]]:
        """What the adjoint pass adds to q*_l, first layer first."""
        parameters, slopes = self.parameters, []
        narrow = parameters.weights[0][:, POSITION]
        states = zip(reversed(self.gradients), reversed(self.adjoints), strict=True)
        for index, (state, adjoint) in enumerate(states):
            if index == 0:
                _add_outer(parameters.weight_grads[0][:, POSITION], adjoint, gradient)
                found = torch.matmul(gradient, narrow.T)
            else:
                _add_outer(parameters.weight_grads[index], adjoint, gradient)
                found = parameters.product(gradient, parameters.weights[index].T)
            slopes.append(state.mul_(found))
            gradient = found.mul_(self.slopes[index][:, self.span])
        _add_outer(parameters.head_grad[: self.cotangents.shape[-1]], self.cotangents, gradient)
        return slopes

    def _modulation_gradient(self, index: int, value: Tensor, slope: Tensor) -> Float[Tensor, "shapes 1 _"]:
        """m*_l. A modulation that has underflowed to 0 gets 0: its own slope in the latent is 0 too."""
        if self.modulations is None:
            raise ValueError("there are no modulations")
        found = self.parameters.times(self.values[index], value).sum(-2, keepdim=True)
        found += self.parameters.times(self.slopes[index][:, : self.count], slope).sum(-2, keepdim=True)
        return found / self.modulations[index].clamp_min(torch.finfo(found.dtype).tiny)


def _add_outer(total: Float[Tensor, "a b"], outputs: Float[Tensor, "*n a"], inputs: Float[Tensor, "*n b"]) -> None:
    """total += Σ outputs inputs^T, over all points."""
    total.addmm_(outputs.flatten(0, -2).T, inputs.flatten(0, -2))


LOGGER = logging.getLogger(__name__)
MOST_FORMS = 64  # of models, sizes and types in one process, for each of which passes are compiled anew

BlockLoss = Callable[..., tuple[Tensor, list[Tensor]]]
_refused: list[str] = []  # why this machine does not compile


def compiles(device: torch.device) -> bool:
    """Whether passes on this device are compiled."""
    return device.type == "cuda" and not _refused


def compiled_block_loss(
    plain: BlockLoss,
    field: PDDF,
    block: sample_batch.SampleBatch,
    modulations: list[Tensor] | None,
    weights: Any,
    parameters: Parameters,
    numbers: Mapping[Any, int],
    differentiate: bool,
) -> tuple[Tensor, list[Tensor]]:
    """What `plain` gives, and adds to the sums of `parameters`, up to rounding; by `plain` where nothing compiles."""
    given = (field, block.tensors(), dict(block.counts), modulations, weights, dict(numbers))
    made = _unless_refused(_compiled(plain), *given)
    if made is None:
        return plain(field, block, modulations, weights, parameters, numbers, differentiate)
    values, found, sums = made
    for total, own in zip(parameters.sums(), sums, strict=True):
        total += own
    return values, found


def compiled_raw(
    field: PDDF, positions: Tensor, directions: Tensor, modulations: Sequence[Tensor] | None
) -> Float[Tensor, "*batch out"]:
    """`field` of these arguments; where a training compiles, by few kernels, and so its gradient."""
    if not (field.training and torch.is_grad_enabled() and compiles(positions.device)):
        return field(positions, directions, modulations)
    found = _unless_refused(_compiled_field(), field, positions, directions, modulations)
    return field(positions, directions, modulations) if found is None else found


def _unless_refused(compiled: Callable[..., Any], *given: Any) -> Any:
    """What a compiled function gives; None, and a warning, where this machine does not compile it."""
    from torch._dynamo import config, exc  # takes a second, for a GPU alone

    try:
        with config.patch(recompile_limit=MOST_FORMS):
            return compiled(*given)
    except exc.TorchDynamoException as error:
        _refused.append(str(error))
        LOGGER.warning("the loss is not compiled, so steps take longer: %s", " ".join(str(error).split())[:200])
        return None


@functools.cache
def _compiled_field() -> Callable[..., Tensor]:
    return torch.compile(lambda field, *given: field(*given), fullgraph=True, dynamic=False)


@functools.cache
def _compiled(plain: BlockLoss) -> Callable[..., tuple[Tensor, list[Tensor], list[Tensor]]]:
    """A function of tensors alone, which keeps nothing."""

    def lone(
        field: PDDF,
        tensors: tuple[Tensor, ...],
        counts: dict[str, int],
        modulations: list[Tensor] | None,
        weights: Any,
        numbers: dict[Any, int],
    ) -> tuple[Tensor, list[Tensor], list[Tensor]]:
        parameters = Parameters(field.network, FreshMemory)
        block = sample_batch.SampleBatch(*tensors, counts=counts)
        values, found = plain(field, block, modulations, weights, parameters, numbers, True)
        return values, found, parameters.sums()

    return torch.compile(lone, fullgraph=True, dynamic=False)
