"""The commands of `ddf` that need a checkout: `run` and `info`."""

import os
import re
from collections import Counter
from pathlib import Path
from typing import Annotated, Any

from ddf.cli import arguments, results
from ddf.cli.declare import Arg, command

_CORES = len(os.sched_getaffinity(0))


@command("experiment", kept="what is finished is kept; go on by:")
def run(
    config: Annotated[str, Arg("CONFIG")],
    *,
    stage: Annotated[list[str], Arg("S", action="append")] = [],  # noqa: B006 argparse copies it
    seeds: arguments.Natural = 1,
    jobs: arguments.Natural = _CORES,
    data: Annotated[str | None, Arg("DIR")] = None,
    launch: Annotated[str, Arg("CMD")] = "",
    changes: Annotated[list[str], Arg("KEY=VALUE", ("--set",), action="append")] = [],  # noqa: B006
) -> dict[str, Any]:
    """An experiment file through the stages of its report: tables, figures and page.

    [One run](scale-out.md#one-run) tells what it does.

    Args:
      config: an experiment file, or the name of one in configs/.
      stage: a stage, with what it needs, in place of the report.
      seeds: trainings of each model.
      jobs: trainings side by side.
      data: holds ShapeNetCore.v1/ and ShapeNetRendering/; is remembered.
      launch: goes before every training command.
      changes: section.key=value: a variant of the experiment, in folders of its own.

    Examples:
      ddf run smoke
      ddf run configs/cpu.yaml --seeds 3 --jobs 2
      ddf run smoke --stage pointclouds --set pcsiren.steps=60 --set ddf.steps=60
      ddf run paper --data ~/shapenet --launch "srun --gres=gpu:1"
    """
    from ddf_lab.engine import runner

    out = runner.run(config, changes, stage, seeds, jobs, data or None, launch)
    return {"out": out.as_posix(), "table": summary(out), "verdict": out.as_posix()}


def summary(page: Path) -> list[str]:
    """The first sentences and the first table of a report's page, as lines; none of a folder."""
    text = re.sub(r"<.*?>|\*\*", "", page.read_text(encoding="utf-8")) if page.is_file() else ""
    blocks = text.split("\n\n")
    said = next((each for each in blocks if each[:1].isalpha() and not each.startswith("Stale")), "")
    table = next((each for each in blocks if each.startswith("|")), "")
    rows = [line.strip()[2:-2].split(" | ") for line in table.splitlines()]
    cells = [[cell.strip() for cell in row] for row in rows]
    return [*results.folded(said, 0), *(results.grid(cells[0], cells[2:]) if cells else ())]


@command("experiment")
def info(config: Annotated[str, Arg("CONFIG")]) -> dict[str, Any]:
    """Models and stages of an experiment file, of a reconstruction the cost too, before anything has run.

    Args:
      config: an experiment file, or the name of one in configs/.

    Examples:
      ddf info configs/cpu.yaml
      ddf info configs/paper.yaml --json
      ddf info paper_generative
    """
    from ddf_lab.engine import graph
    from ddf_lab.run import Run

    graph.load()  # outside of a checkout that is told first
    experiment = Run.read(config)
    items = graph.expand(experiment)
    parameters = _parameters(experiment)
    cost = _cost(experiment) if experiment.kind == "reconstruction" else None
    largest = max(parameters, key=lambda name: parameters[name])
    verdict = f"{experiment.file}: {len(items)} stages; the largest model is {largest} with "
    trainings = f"; {cost['trainings']} trainings" if cost else ""
    return {
        "config": str(config),
        "verdict": f"{verdict}{parameters[largest]:,} parameters{trainings}",
        "parameters": parameters,
        "stages": [item.name for item in items],
        "sections": list(experiment.given),
        **({"cost": cost} if cost else {}),
    }


def _parameters(experiment: Any) -> dict[str, int]:
    """Parameters of every model of an experiment; of figures those of a field that `ddf fit` fits."""
    import torch

    from ddf.fields import pddf
    from ddf.fit import fit_settings
    from ddf.models import generative_models, line_field, reconstruction_models, reconstruction_settings
    from ddf.training import line_steps

    if experiment.kind == "generative":
        sections = experiment.sections()
        return generative_models.parameter_counts(sections["vae"], sections["gan"])
    if experiment.kind != "reconstruction":
        fit = experiment.sections().get("fit") or fit_settings.FitConfig()
        return {"field": pddf.count_parameters(pddf.PDDF(fit.field))}
    train = experiment.section(reconstruction_settings.TrainConfig)
    field = experiment.section(reconstruction_settings.DDFConfig).field
    with torch.device("meta"):
        models = {
            "ddf": reconstruction_models.DDFModel(train, field),
            "pc_siren": reconstruction_models.PCSirenModel(train),
            "ddf_image": line_field.ImageDDFModel(train, experiment.section(line_steps.ImageTrainConfig)),
        }
    return {name: pddf.count_parameters(model) for name, model in models.items()}


def _cost(experiment: Any) -> dict[str, Any]:
    """Shapes by category, samples of each, and steps of each training.

    A category of ShapeNet is counted once the stage `dataset` has listed it, and null until then where all is taken;
    variations of shapes are counted then too.
    """
    from ddf.core import storage

    sections = experiment.sections()
    shapes = dict(sections["dataset"].categories)
    if sections["dataset"].made:
        rows = Counter(row.category for row in sections["dataset"].rows())
        shapes = {name: rows[name] + (count or 0) for name, count in shapes.items()}
    if experiment.index.exists():
        listed = storage.read_json(experiment.index)["categories"]
        shapes |= {name: len(listed[name]["shapes"]) for name in shapes if name in listed}
    steps = {name: sections[name].steps for name in ("ddf", "pcsiren", "ddf_image")}
    samples = sum(sections["samples"].counts.values())
    return {"shapes": shapes, "samples_per_shape": samples, "steps": steps, "trainings": len(shapes) * len(steps)}
