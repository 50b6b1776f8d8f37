"""`ddf config show NAME` in a checkout: of experiments too."""

import argparse
from typing import Any

from ddf.cli import config
from ddf_lab.run import Run

EXAMPLES = ("ddf config show cpu", "ddf config show long_fit", "ddf config show paper --json")
add_arguments = config.add_arguments


def run(args: argparse.Namespace) -> dict[str, Any]:
    """All sections of its kind."""
    experiment = Run.read(args.name)
    return config.answer(experiment.file, experiment.sections())
