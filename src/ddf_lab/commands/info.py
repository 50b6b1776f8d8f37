"""`ddf info CONFIG`: the models of an experiment with exact parameter counts, its stages, sizes of its files, its cost.

The cost is stated before anything has run: shapes, samples, disk and steps.
"""

import argparse
from pathlib import Path
from typing import Any

from ddf_lab.run import Run

SAMPLE_BYTES = 14  # as `packing` stores a sample: 6 position, 4 direction, 2 depth, 2 normal
CLOUD_BYTES = 13  # of a true point: three float32 and whether it is hidden
MODEL_COPIES = 4  # of the parameters on disk: the model, and the checkpoint with AdamW's two moments
EXAMPLES = (
    "ddf info configs/cpu.yaml",
    "ddf info configs/paper.yaml --json",
    "ddf info configs/paper_generative.yaml",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's own arguments."""
    parser.add_argument("config", metavar="CONFIG", help="an experiment file, or the name of one in configs/")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Counts come from the models themselves, built without memory for their values; generative ones have no cost."""
    experiment = Run.read(args.config)
    generative = experiment.kind == "generative"
    parameters = _generative(experiment) if generative else _reconstruction(experiment)
    cost = None if generative else _cost(experiment, parameters)
    stages = _stages(experiment)
    found = {
        "config": str(args.config),
        "verdict": _verdict(experiment.file, stages, parameters, cost),
        "parameters": parameters,
        "model_mib": {name: round(4 * count / 2**20, 1) for name, count in parameters.items()},
        "stages": stages,
        "sections": list(experiment.given),
        "artifacts_mib": _sizes(Path("artifacts") / experiment.name),
    }
    return found if generative else found | {"cost": cost}


def _reconstruction(experiment: Run) -> dict[str, int]:
    """Parameters of every model."""
    import torch

    from ddf.fields import pddf
    from ddf.models import encoders, reconstruction_models, reconstruction_settings

    train, ddf = (
        experiment.section(reconstruction_settings.TrainConfig),
        experiment.section(reconstruction_settings.DDFConfig),
    )
    with torch.device("meta"):
        models = {
            "ddf": reconstruction_models.ddf_model(train, ddf.field),
            "pc_siren": reconstruction_models.pcsiren_model(train),
            "single_shape": pddf.PDDF(pddf.PAPER_SINGLE_SHAPE),
            "ddf_encoder": encoders.ENCODERS[train.encoder](train.latent_features, train.encoder_width),
        }
    return {name: pddf.count_parameters(model) for name, model in models.items()}


def _generative(experiment: Run) -> dict[str, int]:
    """Parameters of every model."""
    from ddf.models import generative_models, generative_settings

    return generative_models.parameter_counts(
        experiment.section(generative_settings.VAEConfig), experiment.section(generative_settings.GANConfig)
    )


def _cost(run: Run, parameters: dict[str, int]) -> dict[str, Any]:
    """Shapes, samples and bytes by category, and steps.

    A category of which all shapes are taken is counted once the stage `dataset` has listed them; until then its
    numbers, and the sums, are null and those `per_shape` hold. Meshes and synthetic renders are not in the bytes.
    """
    from ddf.core import storage
    from ddf.data import dataset, sampling
    from ddf.models import reconstruction_settings

    drawn, shapes = run.section(sampling.SamplesConfig), dict(run.section(dataset.DatasetConfig).categories)
    steps = {
        "ddf": run.section(reconstruction_settings.DDFConfig).steps,
        "pcsiren": run.section(reconstruction_settings.PCSirenConfig).steps,
    }
    if run.index.exists():
        listed = storage.read_json(run.index)["categories"]
        shapes |= {name: len(listed[name]["shapes"]) for name in shapes if name in listed}
    known = [count for count in shapes.values() if count is not None]
    total = sum(known) if len(known) == len(shapes) else None
    samples = sum(drawn.counts.values())
    size = samples * SAMPLE_BYTES + drawn.cloud_points * CLOUD_BYTES
    trained = len(shapes) * MODEL_COPIES * 4 * (parameters["ddf"] + parameters["pc_siren"])
    return {
        "shapes": {**shapes, "all": total},
        "per_shape": {"samples": samples, "bytes": size},
        "samples": None if total is None else total * samples,
        "disk_bytes": {"samples": None if total is None else total * size, "trainings": trained},
        "steps": steps,
        "trainings": len(shapes) * len(steps),
        "steps_in_all": {name: count * len(shapes) for name, count in steps.items()},
    }


def _verdict(path: Path, stages: list[str], parameters: dict[str, int], cost: dict[str, Any] | None = None) -> str:
    """One line: stages, the largest model, and the trainings where those are known."""
    name = max(parameters, key=lambda key: parameters[key])
    line = f"{path}: {len(stages)} stages; the largest model is {name} with {parameters[name]:,} parameters"
    return line if cost is None else f"{line}; {cost['trainings']} trainings"


def _stages(experiment: Run) -> list[str]:
    """Names of the experiment's stages, in order, from the pipeline.yaml beside the folder of the file."""
    from ddf.core import checks
    from ddf_lab.engine import experiments, graph

    pipeline = experiment.file.resolve().parent.parent / "pipeline.yaml"
    if not pipeline.is_file():
        return []
    try:
        return [item.name for item in graph.expand(experiments.read(experiment).lists(), pipeline)]
    except (KeyError, TypeError, AttributeError) as error:
        raise checks.InputError(f"{pipeline}: not a stage graph of this project ({error!r})") from error


def _sizes(folder: Path) -> dict[str, float]:
    """MiB on disk of each stage's results, where they exist."""
    sizes = {}
    if folder.is_dir():
        for stage in sorted(path for path in folder.iterdir() if path.is_dir()):
            sizes[stage.name] = round(sum(f.stat().st_size for f in stage.rglob("*") if f.is_file()) / 2**20, 1)
    return sizes
