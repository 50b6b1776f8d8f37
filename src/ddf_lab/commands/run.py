"""`ddf run CONFIG`: an experiment file through all its stages, to tables, figures and report."""

import argparse
import os
from typing import Any

from ddf.cli import arguments

EXAMPLES = (
    "ddf run smoke",
    "ddf run configs/cpu.yaml --seeds 3 --jobs 2",
    "ddf run smoke --stage pointclouds --set pcsiren.steps=60 --set ddf.steps=60",
    'ddf run paper --data ~/shapenet --launch "srun --gres=gpu:1"',
    "ddf run cpu --dag",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's own arguments."""
    cores = len(os.sched_getaffinity(0))
    number = arguments.whole_number(1)
    parser.add_argument("config", metavar="CONFIG", help="an experiment file, or the name of one in configs/")
    parser.add_argument(
        "--stage", metavar="S", action="append", default=[], help="a stage, with what it needs, in place of the report"
    )
    parser.add_argument("--seeds", metavar="N", type=number, default=1, help="trainings of each model (default 1)")
    parser.add_argument(
        "--jobs", metavar="N", type=number, default=cores, help=f"trainings side by side (default {cores})"
    )
    parser.add_argument("--data", metavar="DIR", help="holds ShapeNetCore.v1/ and ShapeNetRendering/; is remembered")
    parser.add_argument("--launch", metavar="CMD", default="", help="goes before every training command")
    parser.add_argument(
        "--set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        dest="changes",
        help="section.key=value: a variant of the experiment, in folders of its own",
    )
    parser.set_defaults(kept="what is finished is kept; go on by:")
    parser.add_argument("--dag", action="store_true", help="list the stages and what each waits for; run nothing")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Run what has to be run; says where the page is."""
    from ddf_lab.engine import dag, experiments, graph, runner

    if args.dag:
        experiment = experiments.find(args.config, args.changes)
        lines = dag.lines(graph.expand(experiment.lists(args.seeds)))
        return {"stages": lines[1:], "table": lines, "verdict": f"{len(lines) - 1} stages of {experiment.name}"}
    options = runner.Options(args.stage, args.seeds, args.jobs, args.data or None, args.launch)
    out = runner.run(args.config, args.changes, options).as_posix()
    return {"out": out, "table": [], "verdict": out}
