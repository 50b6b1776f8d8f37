"""The commands of `ddf` that need a checkout: `run` and `info`, and `config show` of experiments too.

COMMANDS lists room, place and summary of each, as `ddf.cli.commands` lists its own.
"""

import argparse
import os
from pathlib import Path
from typing import Any

COMMANDS = {
    "run": (
        "experiment",
        "ddf_lab.commands:RunCommand",
        "an experiment file through all its stages, to tables, figures and report",
    ),
    "config": (
        "experiment",
        "ddf_lab.commands:ConfigCommand",
        "every setting of an experiment or a fit, with its reasons",
    ),
    "info": ("experiment", "ddf_lab.commands:InfoCommand", "models, stages, sizes and cost of an experiment file"),
}
_CONFIG = "an experiment file, or the name of one in configs/"
SAMPLE_BYTES = 14  # as `packing` stores a sample: 6 position, 4 direction, 2 depth, 2 normal
CLOUD_BYTES = 13  # of a true point: three float32 and whether it is hidden
MODEL_COPIES = 4  # of the parameters on disk: the model, and the checkpoint with AdamW's two moments


class RunCommand:
    """`ddf run CONFIG`."""

    EXAMPLES = (
        "ddf run smoke",
        "ddf run configs/cpu.yaml --seeds 3 --jobs 2",
        "ddf run smoke --stage pointclouds --set pcsiren.steps=60 --set ddf.steps=60",
        'ddf run paper --data ~/shapenet --launch "srun --gres=gpu:1"',
        "ddf run cpu --dag",
    )

    @staticmethod
    def add_arguments(parser: argparse.ArgumentParser) -> None:
        """Add the command's own arguments."""
        from ddf.cli import arguments

        cores, number, add = len(os.sched_getaffinity(0)), arguments.whole_number(1), parser.add_argument
        several: dict[str, Any] = {"action": "append", "default": []}
        add("config", metavar="CONFIG", help=_CONFIG)
        add("--stage", metavar="S", help="a stage, with what it needs, in place of the report", **several)
        add("--seeds", metavar="N", type=number, default=1, help="trainings of each model (default 1)")
        add("--jobs", metavar="N", type=number, default=cores, help=f"trainings side by side (default {cores})")
        add("--data", metavar="DIR", help="holds ShapeNetCore.v1/ and ShapeNetRendering/; is remembered")
        add("--launch", metavar="CMD", default="", help="goes before every training command")
        varied = "section.key=value: a variant of the experiment, in folders of its own"
        add("--set", metavar="KEY=VALUE", dest="changes", help=varied, **several)
        add("--dag", action="store_true", help="list the stages and what each waits for; run nothing")
        parser.set_defaults(kept="what is finished is kept; go on by:")

    @staticmethod
    def run(args: argparse.Namespace) -> dict[str, Any]:
        """Run what has to be run; says where the page is."""
        from ddf_lab.engine import graph, runner

        if args.dag:
            experiment = graph.experiment(args.config, args.changes)
            lines = graph.table(graph.expand(experiment, args.seeds))
            return {"stages": lines[1:], "table": lines, "verdict": f"{len(lines) - 1} stages of {experiment.name}"}
        options = runner.Options(args.stage, args.seeds, args.jobs, args.data or None, args.launch)
        out = runner.run(args.config, args.changes, options).as_posix()
        return {"out": out, "table": [], "verdict": out}


class ConfigCommand:
    """`ddf config show NAME` in a checkout: of experiments too."""

    EXAMPLES = ("ddf config show cpu", "ddf config show long_fit", "ddf config show paper --json")

    @staticmethod
    def add_arguments(parser: argparse.ArgumentParser) -> None:
        """Add those of the command without a checkout."""
        from ddf.cli import config

        config.add_arguments(parser)

    @staticmethod
    def run(args: argparse.Namespace) -> dict[str, Any]:
        """All sections of its kind."""
        from ddf.cli import config
        from ddf_lab.run import Run

        experiment = Run.read(args.name)
        return config.answer(experiment.file, experiment.sections())


class InfoCommand:
    """`ddf info CONFIG`: parameter counts, stages, sizes of files, and the cost before anything has run."""

    EXAMPLES = ("ddf info configs/cpu.yaml", "ddf info configs/paper.yaml --json", "ddf info paper_generative")

    @staticmethod
    def add_arguments(parser: argparse.ArgumentParser) -> None:
        """Add the command's own arguments."""
        parser.add_argument("config", metavar="CONFIG", help=_CONFIG)

    @staticmethod
    def run(args: argparse.Namespace) -> dict[str, Any]:
        """Counts come from the models themselves, built without memory for their values."""
        from ddf_lab.engine import graph
        from ddf_lab.run import Run

        experiment = Run.read(args.config)
        pipeline = experiment.file.resolve().parent.parent / graph.PIPELINE
        items = graph.expand(experiment, path=pipeline) if pipeline.is_file() else []
        parameters = _parameters(experiment)
        cost = _cost(experiment, parameters) if experiment.kind == "reconstruction" else None
        largest = max(parameters, key=lambda name: parameters[name])
        verdict = f"{experiment.file}: {len(items)} stages; the largest model is {largest} with "
        trainings = f"; {cost['trainings']} trainings" if cost else ""
        return {
            "config": str(args.config),
            "verdict": f"{verdict}{parameters[largest]:,} parameters{trainings}",
            "parameters": parameters,
            "model_mib": {name: round(4 * count / 2**20, 1) for name, count in parameters.items()},
            "stages": [item.name for item in items],
            "sections": list(experiment.given),
            "artifacts_mib": _sizes(experiment.root),
            **({"cost": cost} if cost else {}),
        }


def _parameters(experiment: Any) -> dict[str, int]:
    """Parameters of every model of an experiment."""
    import torch

    from ddf.fields import pddf
    from ddf.models import encoders, reconstruction_models, reconstruction_settings

    if experiment.kind == "generative":
        from ddf.models import generative_models

        sections = experiment.sections()
        return generative_models.parameter_counts(sections["vae"], sections["gan"])
    train = experiment.section(reconstruction_settings.TrainConfig)
    field = experiment.section(reconstruction_settings.DDFConfig).field
    with torch.device("meta"):
        models = {
            "ddf": reconstruction_models.DDFModel(train, field),
            "pc_siren": reconstruction_models.PCSirenModel(train),
            "single_shape": pddf.PDDF(pddf.PAPER_SINGLE_SHAPE),
            "ddf_encoder": encoders.ENCODERS[train.encoder](train.latent_features, train.encoder_width),
        }
    return {name: pddf.count_parameters(model) for name, model in models.items()}


def _cost(experiment: Any, parameters: dict[str, int]) -> dict[str, Any]:
    """Shapes, samples and bytes by category, and steps.

    A category of which all shapes are taken is counted once the stage `dataset` has listed them; until then its
    numbers, and the sums, are null and those `per_shape` hold. Meshes and synthetic renders are not in the bytes.
    """
    from ddf.core import storage

    sections = experiment.sections()
    shapes, samples = dict(sections["dataset"].categories), sum(sections["samples"].counts.values())
    if experiment.index.exists():
        listed = storage.read_json(experiment.index)["categories"]
        shapes |= {name: len(listed[name]["shapes"]) for name in shapes if name in listed}
    per_shape = {"samples": samples, "bytes": samples * SAMPLE_BYTES + sections["samples"].cloud_points * CLOUD_BYTES}
    known = [count for count in shapes.values() if count is not None]
    total = sum(known) if len(known) == len(shapes) else None
    steps = {name: sections[name].steps for name in ("ddf", "pcsiren")}
    trained = len(shapes) * MODEL_COPIES * 4 * (parameters["ddf"] + parameters["pc_siren"])
    return {
        "shapes": {**shapes, "all": total},
        "per_shape": per_shape,
        "samples": None if total is None else total * samples,
        "disk_bytes": {"samples": None if total is None else total * per_shape["bytes"], "trainings": trained},
        "steps": steps,
        "trainings": len(shapes) * len(steps),
        "steps_in_all": {name: count * len(shapes) for name, count in steps.items()},
    }


def _sizes(folder: Path) -> dict[str, float]:
    """MiB on disk of each stage's results, where they exist."""
    return {
        stage.name: round(sum(file.stat().st_size for file in stage.rglob("*") if file.is_file()) / 2**20, 1)
        for stage in (sorted(folder.iterdir()) if folder.is_dir() else ())
        if stage.is_dir()
    }
