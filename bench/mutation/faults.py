"""The faults: one line each, over losses, steps, sampling, cameras, clouds, scores and claims."""

from collections.abc import Sequence
from dataclasses import dataclass

STEPS = ("tests/reconstruction",)
LOSSES = ("tests/fields/test_losses.py",)
CLOUDS = ("tests/fields/test_cloud_projection.py", "tests/fields/test_cloud_selection.py", "tests/reconstruction")
SAMPLING = ("tests/data/test_sampling.py", "tests/reconstruction")
CAMERAS = ("tests/geometry/test_cameras.py", "tests/reconstruction", "tests/fields/test_rendering.py")
SCORES = ("tests/evaluation",)


@dataclass(frozen=True)
class Mutant:
    """`old` in a file below src/ddf becomes `new`; tests: those that should notice."""

    name: str
    file: str
    old: str
    new: str
    tests: Sequence[str]


_STEP, _MODELS = "reconstruction/training_steps.py", "reconstruction/reconstruction_models.py"
_LOSSES, _CLOUDS = "fields/losses.py", "fields/cloud_projection.py"
MUTANTS = (
    Mutant("true camera in L_M", _STEP, "        model.camera_head(scores),\n", "        batch.cameras,\n", STEPS),
    Mutant(
        "scale 1 in L_M", _STEP, "shapes.field_scales(batch.shapes)", "0 * shapes.field_scales(batch.shapes) + 1", STEPS
    ),
    Mutant("γ_RS ignored", _STEP, "config.shape_weight * shape_loss", "shape_loss", STEPS),
    Mutant(
        "camera weight ignored in PC-SIREN",
        _STEP,
        "chamfer + train.camera_weight * camera_loss",
        "chamfer + camera_loss",
        STEPS,
    ),
    Mutant("batch seed ignored", _STEP, "default_rng((config.loop.seed, step))", "default_rng((0, step))", STEPS),
    Mutant(
        "first points of a cloud",
        "reconstruction/category_data.py",
        "random.choice(len(cloud), count, replace=len(cloud) < count)",
        "np.arange(count) % len(cloud)",
        STEPS,
    ),
    Mutant(
        "camera weight ignored in the DDF",
        _STEP,
        "train.camera_weight * camera_loss + config",
        "camera_loss + config",
        STEPS,
    ),
    Mutant("γ_RM ignored", _STEP, "config.mask_weight * mask_loss", "mask_loss", STEPS),
    Mutant(
        "step ignored in a batch",
        _STEP,
        "default_rng((config.loop.seed, step))",
        "default_rng((config.loop.seed, 0))",
        STEPS,
    ),
    Mutant("shift ignored in L_M", _STEP, "        shapes.field_shifts(batch.shapes).to(place),\n", "", STEPS),
    Mutant(
        "rays that miss left out of L_M", _MODELS, " - LOG_OF_ZERO * wanted.masked_fill(meets, 0.0).mean(-1)", "", STEPS
    ),
    Mutant("share of the rays that meet ignored", _MODELS, " * meets.to(bce.dtype).mean(-1)", "", STEPS),
    Mutant(
        "z-scores of the camera unscaled", _MODELS, "(truth - self.mean) / self.deviation", "truth - self.mean", STEPS
    ),
    Mutant(
        "camera clamped from below only",
        _MODELS,
        "torch.minimum(torch.maximum(camera, self.lowest), self.highest)",
        "torch.maximum(camera, self.lowest)",
        STEPS,
    ),
    Mutant(
        "sine and cosine swapped",
        _MODELS,
        "torch.cat((torch.sin(truth[:, :1]), torch.cos(truth[:, :1])",
        "torch.cat((torch.cos(truth[:, :1]), torch.sin(truth[:, :1])",
        STEPS,
    ),
    Mutant("depth not doubled on A and U", _LOSSES, "return depth.sum() + again", "return depth.sum()", LOSSES),
    Mutant(
        "squared depth error unsquared",
        _LOSSES,
        "return (depth - truth).square()",
        "return (depth - truth).abs()",
        LOSSES,
    ),
    Mutant(
        "normal loss without its sign",
        _LOSSES,
        "return -visible * (normals * truth).sum(-1).abs()",
        "return visible * (normals * truth).sum(-1).abs()",
        LOSSES,
    ),
    Mutant(
        "eikonal towards 1 instead of -1", _LOSSES, "(depth_rates + 1).square()", "(depth_rates - 1).square()", LOSSES
    ),
    Mutant(
        "eikonal of visibility unweighted",
        _LOSSES,
        "weights.eikonal_visibility * visibility_rate",
        "visibility_rate",
        LOSSES,
    ),
    Mutant(
        "transition without its bound",
        _LOSSES,
        "torch.relu(speed - weight_rate.abs())",
        "(speed - weight_rate.abs())",
        LOSSES,
    ),
    Mutant("transition of any sign", _LOSSES, "speed - weight_rate.abs()", "speed - weight_rate", LOSSES),
    Mutant(
        "Chamfer loss one way",
        "training/chamfer_loss.py",
        "return there + (truth - near_predicted).square().sum(-1).mean()",
        "return there",
        ("tests/training",),
    ),
    Mutant("O samples all at their distance", "data/sampling.py", 'config.offsets == "uniform"', "False", SAMPLING),
    Mutant(
        "A samples look away",
        "data/samples/draws.py",
        "return Draw(positions, -directions, normals",
        "return Draw(positions, directions, normals",
        SAMPLING,
    ),
    Mutant(
        "no point on the boundary", "data/samples/draws.py", "BOUNDARY_SHARE = 0.1", "BOUNDARY_SHARE = 0.0", SAMPLING
    ),
    Mutant(
        "B samples look outwards",
        "data/samples/draws.py",
        "np.float32(-1), np.float32(1)))",
        "np.float32(1), np.float32(-1)))",
        SAMPLING,
    ),
    Mutant(
        "focal length off by 1 %",
        "geometry/cameras.py",
        "(centres - CENTRE_PX) / FOCAL_PX",
        "(centres - CENTRE_PX) / (1.01 * FOCAL_PX)",
        CAMERAS,
    ),
    Mutant(
        "pixel corners instead of centres",
        "geometry/cameras.py",
        "(xp.arange(size, dtype=like.dtype) + 0.5)",
        "xp.arange(size, dtype=like.dtype)",
        CAMERAS,
    ),
    Mutant(
        "rows from the bottom",
        "geometry/cameras.py",
        "xp.meshgrid(-offset, offset",
        "xp.meshgrid(offset, offset",
        CAMERAS,
    ),
    Mutant(
        "η_T ignored in the weights of a cloud",
        "fields/udf.py",
        "visibilities / (temperature * (inverse_depth + depths))",
        "visibilities / (inverse_depth + depths)",
        (*CLOUDS, "tests/fields/test_udf.py"),
    ),
    Mutant(
        "visibility ignored in the weights of a cloud",
        "fields/udf.py",
        "score = visibilities / ",
        "score = 1 / ",
        (*CLOUDS, "tests/fields/test_udf.py"),
    ),
    Mutant("least visible points kept", _CLOUDS, "topk(count).indices", "topk(count, largest=False).indices", CLOUDS),
    Mutant("rechecks from one side", _CLOUDS, "torch.tensor([-1.0, 1.0]", "torch.tensor([1.0, 1.0]", CLOUDS),
    Mutant("hits of the first cycle are candidates", _CLOUDS, "pool = cycles[1:] or cycles", "pool = cycles", CLOUDS),
    Mutant(
        "scale of the box's longest side",
        "reconstruction/scales.py",
        "float((upper - lower).norm())",
        "float((upper - lower).max())",
        STEPS,
    ),
    Mutant(
        "one scale for clouds of all cycles",
        "evaluation/scoring.py",
        'own if own in self.tensors else "scale_pred"',
        '"scale_pred"',
        SCORES,
    ),
    Mutant(
        "translation of the true frame dropped",
        "evaluation/scoring.py",
        ' + self.tensors["centre_true"][image]',
        "",
        SCORES,
    ),
    Mutant(
        "Chamfer distance one way",
        "evaluation/metrics.py",
        " + np.mean(pred_to_truth_sq, dtype=np.float64)",
        "",
        SCORES,
    ),
    Mutant(
        "F-score at an unsquared threshold",
        "evaluation/metrics.py",
        "f_score(to_truth, to_prediction, tau_sq)",
        "f_score(to_truth, to_prediction, tau_sq**0.5)",
        SCORES,
    ),
    Mutant(
        "precision for recall",
        "evaluation/metrics.py",
        "recall_tau=hit_share(to_prediction, tau_sq)",
        "recall_tau=hit_share(to_truth, tau_sq)",
        SCORES,
    ),
    Mutant(
        "azimuths that do not wrap",
        "evaluation/metrics.py",
        "np.abs((difference + np.pi) % (2 * np.pi) - np.pi)",
        "np.abs(difference)",
        SCORES,
    ),
    Mutant("claims at one standard error", "evaluation/paired.py", "CLAIMED = 2.0", "CLAIMED = 1.0", SCORES),
    Mutant(
        "trainings leave the error alone",
        "evaluation/paired.py",
        "if trainings > 1 else 0.0",
        "if trainings > 9 else 0.0",
        SCORES,
    ),
    Mutant(
        "retrieval takes the farthest image",
        "evaluation/baselines.py",
        "sum(axis=1).argmin()",
        "sum(axis=1).argmax()",
        SCORES,
    ),
)
