"""The `ddf` command: `commands.COMMANDS` lists the commands, each is one module of a room, `frame` runs them."""

from ddf.cli.frame import main

__all__ = ["main"]  # the entry point in pyproject.toml
