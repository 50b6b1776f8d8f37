"""The commands of `ddf` that need a checkout: room, module and summary of each, as `ddf.cli.commands` lists its own."""

COMMANDS = {
    "run": (
        "experiment",
        "ddf_lab.commands.run",
        "an experiment file through all its stages, to tables, figures and report",
    ),
    "config": ("experiment", "ddf_lab.commands.config", "every setting of an experiment or a fit, with its reasons"),
    "info": ("experiment", "ddf_lab.commands.info", "models, stages, sizes and cost of an experiment file"),
}
