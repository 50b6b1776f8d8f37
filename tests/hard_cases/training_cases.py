"""Hard batches, masks and cameras in training. Truth: fields with constant outputs, whose losses have a closed form."""

import dataclasses
import math

import _models
import torch
from torch import Tensor

from ddf.data.samples import sample_batch
from ddf.fields import losses, pddf
from ddf.geometry import transforms
from ddf.models import camera_encoder, reconstruction_models, reconstruction_settings
from ddf.reconstruction import mask_descent

from . import case
from .field_cases import SATURATED, constant_field

TRAINING = case.Group("training")
COUNTS = {"E": 3, "U": 5, "A": 6, "B": 4, "S": 2, "T": 3, "O": 2, "U+": 4}
WEIGHTS = losses.LossWeights(transition_speed=1.5)


def _sigmoid(x: float) -> float:
    return 1 / (1 + math.exp(-x))


def _batch(dtype: torch.dtype, visible: float, depth: float) -> sample_batch.SampleBatch:
    """Random oriented points of two shapes, all with the same ground truth; normals are zero, as they are on misses."""
    generator, count = torch.Generator().manual_seed(0), sum(COUNTS.values())
    positions = 2 * torch.rand(2, count, 3, generator=generator, dtype=torch.float64) - 1
    directions = torch.nn.functional.normalize(
        torch.randn(2, count, 3, generator=generator, dtype=torch.float64), dim=-1
    )
    same = torch.ones(2, count, dtype=dtype)
    return sample_batch.SampleBatch(
        positions.to(dtype),
        directions.to(dtype),
        visible * same,
        depth * same,
        torch.zeros_like(positions).to(dtype),
        COUNTS,
    )


def _loss(
    field: pddf.PDDF, batch: sample_batch.SampleBatch, weights: losses.LossWeights = WEIGHTS
) -> tuple[Tensor, Tensor, case.Outcome]:
    """𝔏_S, its gradient in the head's biases, and whether every gradient is finite."""
    loss, _ = losses.shape_loss(field, batch, None, weights)
    gradients = torch.autograd.grad(loss, list(field.parameters()))
    finite = all(bool(torch.isfinite(g).all()) for g in (loss, *gradients))
    return loss, gradients[-1], case.true("finite gradients", finite)


def _miss_loss(b: float) -> tuple[float, list[float]]:
    """𝔏_S of a field with ξ logit b and w_1 = 1/2 everywhere when every ray misses, and its gradient in the biases.

    No depth, no normals; log(1 + e^b) of visibility, ξ(1 - ξ), w_1 w_2 = 1/4, ε_T², and the eikonal's 2 ξ on E.
    """
    xi = _sigmoid(b)
    known = COUNTS["E"] / sum(COUNTS[kind] for kind in "EUAB")
    loss = WEIGHTS.visibility * math.log1p(math.exp(b)) + WEIGHTS.visibility_variance * xi * (1 - xi)
    loss += WEIGHTS.weight_variance / 4 + WEIGHTS.transition * WEIGHTS.transition_speed**2
    loss += WEIGHTS.eikonal_depth * 2 * xi * known
    slope = WEIGHTS.visibility * xi + WEIGHTS.visibility_variance * xi * (1 - xi) * (1 - 2 * xi)
    return loss, [0.0, 0.0, 0.0, slope]  # ξ of the eikonal on E is not followed


@TRAINING.case(
    "every ray misses",
    "a batch of all sample types without one hit; a field of constant outputs, ξ logit 0.7",
    "𝔏_S and its gradient in closed form, within 64 ε of the largest weight: none from depth and normals; finite",
)
def _all_miss(dtype: torch.dtype) -> case.Outcome:
    loss, gradient, finite = _loss(constant_field((1, 2, 0, 0.7), dtype), _batch(dtype, 0.0, 0.0))
    value, slopes = _miss_loss(0.7)
    allowed = 64 * case.step(dtype) * WEIGHTS.visibility
    return case.every(finite, case.worst(case.close(gradient, slopes, allowed), case.close(loss, value, allowed)))


@TRAINING.case(
    "every ray misses a random field",
    "the same batch; a field of random weights, so that normals and rates exist",
    "depth and normal terms exactly 0, no gradient in the depth biases, all finite",
)
def _all_miss_random(dtype: torch.dtype) -> case.Outcome:
    torch.manual_seed(0)
    field = pddf.PDDF(pddf.PDDFConfig((16, 16), 3.0, 1.0, "relu", 1.0)).to(dtype)
    batch = _batch(dtype, 0.0, 0.0)
    terms = losses.shape_loss(field, batch, None, WEIGHTS)[1]
    _, gradient, finite = _loss(field, batch)
    return case.every(
        finite,
        case.exact(torch.stack((terms["depth"], terms["normals"])), [0, 0]),
        case.exact(gradient[:2], [0.0, 0.0]),
    )


@TRAINING.case(
    "depth on a miss is anything finite",
    "as above, the depth of the misses 1e10 (Huber and square)",
    "the same loss as with depth 0",
)
def _miss_depth(dtype: torch.dtype) -> case.Outcome:
    field, found = constant_field((1, 2, 0, 0.7), dtype), []
    for huber in (None, 0.02):
        weights = dataclasses.replace(WEIGHTS, depth_huber=huber)
        loss, _, finite = _loss(field, _batch(dtype, 0.0, 1e10), weights)
        found += [finite, case.exact(loss, _loss(field, _batch(dtype, 0.0, 0.0), weights)[0])]
    return case.every(*found)


@TRAINING.case(
    "depth on a miss is the largest finite number",
    "as above, the depth of the misses the largest number of the type, the paper's square",
    "the same loss as with depth 0",
)
def _miss_depth_overflow(dtype: torch.dtype) -> case.Outcome:
    field = constant_field((1, 2, 0, 0.7), dtype)
    loss, _, finite = _loss(field, _batch(dtype, 0.0, torch.finfo(dtype).max))
    return case.every(finite, case.exact(loss, _loss(field, _batch(dtype, 0.0, 0.0))[0]))


@TRAINING.case(
    "saturated and wrong",
    "every ray hits at the depth that the field says, its ξ logit is -1e4; and the other way round",
    "the visibility term exactly 1e4 (weighted 1e5), gradients finite, none in the depths",
)
def _saturated(dtype: torch.dtype) -> case.Outcome:
    only = dataclasses.replace(WEIGHTS, eikonal_depth=0.0, eikonal_visibility=0.0, weight_variance=0.0, transition=0.0)
    found = []
    for visible, logit in ((1.0, -SATURATED), (0.0, SATURATED)):
        loss, gradient, finite = _loss(constant_field((1, 2, 0, logit), dtype), _batch(dtype, visible, 1.0), only)
        slope = WEIGHTS.visibility * (1 if logit > 0 else -1)
        found += [finite, case.close(gradient, [0, 0, 0, slope], 64 * case.step(dtype) * abs(slope))]
        found.append(case.close(loss, WEIGHTS.visibility * SATURATED, case.step(dtype) * 1e5))
    return case.every(*found)


@TRAINING.case(
    "saturated and right",
    "every ray hits at the depth that the field says, its ξ logit is 1e4; and no ray hits, -1e4",
    "visibility and depth terms exactly 0, gradients finite",
)
def _right(dtype: torch.dtype) -> case.Outcome:
    only = dataclasses.replace(WEIGHTS, eikonal_depth=0.0, eikonal_visibility=0.0, weight_variance=0.0, transition=0.0)
    found = []
    for visible, logit in ((1.0, SATURATED), (0.0, -SATURATED)):
        loss, gradient, finite = _loss(constant_field((1, 2, 0, logit), dtype), _batch(dtype, visible, 1.0), only)
        found += [finite, case.exact(gradient, torch.zeros(4)), case.exact(loss, 0.0)]
    return case.every(*found)


@TRAINING.case(
    "w_1 at 0 and 1 in the loss",
    "logits of w_1 of ±1e4, every ray misses",
    "L_V exactly 0, L_T = ε_T² exactly (a saturated weight has no speed), gradients finite",
)
def _saturated_weights(dtype: torch.dtype) -> case.Outcome:
    found = []
    for logit in (SATURATED, -SATURATED):
        field = constant_field((1, 2, logit, 0.7), dtype)
        with torch.no_grad():
            field.network.head.weight[2] = 1.0  # w_1's logit does change along the rays
        terms = losses.shape_loss(field, _batch(dtype, 0.0, 0.0), None, WEIGHTS)[1]
        found += [_loss(field, _batch(dtype, 0.0, 0.0))[2], case.exact(terms["weight_variance"], 0.0)]
        found.append(case.exact(terms["transition"], WEIGHTS.transition_speed**2))
    return case.every(*found)


@TRAINING.case(
    "softplus depth far below zero in the loss",
    "raw depths of -1e4 with sharpness 100, every ray hits at depth 0.5",
    "the depth term in closed form, 1/4 and doubled on U, U+ and A; gradient in the depths exactly 0, all finite",
)
def _dead_softplus(dtype: torch.dtype) -> case.Outcome:
    config = pddf.PDDFConfig((8,), 1.0, 1.0, "softplus", 100.0)
    field = constant_field((-1e4, -1e4, 0, 0.7), dtype, config)
    batch = _batch(dtype, 1.0, 0.5)
    terms = losses.shape_loss(field, batch, None, WEIGHTS)[1]
    _, gradient, finite = _loss(field, batch)
    known = sum(COUNTS.values()) - COUNTS["E"]
    doubled = COUNTS["U"] + COUNTS["A"] + COUNTS["U+"]
    depth = case.close(terms["depth"], 0.25 * (known + doubled) / known, 8 * case.step(dtype))
    return case.every(finite, case.exact(gradient[:2], [0.0, 0.0]), depth)


def _mask_losses(alpha: float, logit: float, dtype: torch.dtype) -> tuple[Tensor, Tensor]:
    """L_M of a constant field seen from inside its cube (all 64 pixels count), and its gradient in the camera."""
    camera = torch.tensor([[0.3, 0.2, 0.4]], dtype=dtype, requires_grad=True)
    scale = torch.tensor([transforms.BENCHMARK_FROM_V1], dtype=dtype)
    mask = torch.full((1, 8, 8), alpha, dtype=dtype)
    loss = reconstruction_models.mask_loss(
        constant_field((1, 1, 0, logit), dtype), _modulations(dtype), camera, scale, mask
    )
    return loss, torch.autograd.grad(loss.sum(), camera)[0]


def _modulations(dtype: torch.dtype) -> list[Tensor]:
    return [torch.ones(1, 1, 8, dtype=dtype)]


@TRAINING.case(
    "masks of all 0 and all 1",
    "alpha 0 and 1 in all 64 pixels, ξ logits of 0.7, 1e4 and -1e4",
    "L_M = log(1 + e^±b), 0 or 1e4; camera gradient exactly 0",
)
def _masks(dtype: torch.dtype) -> case.Outcome:
    found = []
    for alpha in (0.0, 1.0):
        for logit in (SATURATED, -SATURATED, 0.7):
            loss, gradient = _mask_losses(alpha, logit, dtype)
            wrong = logit if alpha == 0 else -logit
            expected = max(wrong, 0.0) + math.log1p(math.exp(-abs(wrong)))
            found.append(case.exact(gradient, torch.zeros(1, 3)))
            found.append(case.close(loss, [expected], 4 * case.step(dtype) * max(expected, 1.0)))
    return case.worst(*found)


@TRAINING.case(
    "a mask whose every ray misses",
    "a camera 1e3 box lengths away, 4 x 4 pixels, none on the box; alpha 0 and 1",
    "L_M the alpha times 100, as torch bounds -log 0; camera gradient exactly 0 and finite",
)
def _mask_misses(dtype: torch.dtype) -> case.Outcome:
    scale, found = torch.tensor([transforms.BENCHMARK_FROM_V1], dtype=dtype), []
    field = constant_field((1, 1, 0, 0.7), dtype)
    for alpha in (0.0, 1.0):
        camera = torch.tensor([[0.3, 0.2, 2000.0]], dtype=dtype, requires_grad=True)
        mask = torch.full((1, 4, 4), alpha, dtype=dtype)
        loss = reconstruction_models.mask_loss(field, _modulations(dtype), camera, scale, mask)
        (gradient,) = torch.autograd.grad(loss.sum(), camera)
        found += [case.exact(loss, [100 * alpha]), case.exact(gradient, torch.zeros(1, 3))]
    return case.worst(*found)


@TRAINING.case(
    "camera correction without a slope",
    "gradient descent on L_M from masks of all 0 and all 1 through a field of constant visibility",
    "the camera that it started from, within 2 ε (to z-scores and back)",
)
def _correction(dtype: torch.dtype) -> case.Outcome:
    torch.manual_seed(0)
    config = pddf.PDDFConfig((8,), 1.0, 1.0, "relu", 1.0)
    model, _ = _models.of_field(config, 2, 1)
    model.camera_head.fit(torch.tensor([[0.1, 0.2, 0.3], [0.5, 0.4, 0.6]]))
    with torch.no_grad():
        model.field.network.head.weight.zero_()
    model = model.to(dtype).requires_grad_(False)
    camera = torch.tensor([[0.25, 0.25, 0.5]], dtype=dtype)
    scale, correction = (
        torch.tensor([0.6], dtype=dtype),
        reconstruction_settings.CorrectionConfig(3, 0.1, 8, ("azimuth", "radius")),
    )
    modulations, found = model.modulations(torch.zeros(1, 2, dtype=dtype)), []
    for alpha in (0.0, 1.0):
        mask = torch.full((1, 8, 8), alpha, dtype=dtype)
        corrected = mask_descent.correct_camera(model, modulations, camera, scale, mask, correction)
        found.append(case.close(corrected, camera, 2 * case.step(dtype)))
    return case.worst(*found)


@TRAINING.case(
    "training cameras without a spread",
    "no camera, one camera, two cameras of one radius",
    "refused, naming the rule",
)
def _same_cameras(dtype: torch.dtype) -> case.Outcome:
    head = camera_encoder.CameraHead().to(dtype)
    two = torch.tensor([[0.1, 0.2, 0.5], [0.3, 0.4, 0.5]], dtype=dtype)
    return case.worst(
        case.refused(lambda: head.fit(two[:0]), "training cameras must be at least 2; got 0"),
        case.refused(lambda: head.fit(two[:1]), "training cameras must be at least 2; got 1"),
        case.refused(lambda: head.fit(two), "azimuth, elevation and radius must vary"),
    )
