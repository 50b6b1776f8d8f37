"""The `ddf` command: `commands.COMMANDS` lists the commands, each is one module of a room, `frame` runs them."""

import importlib
from collections.abc import Sequence


def main(argv: Sequence[str] | None = None) -> int:
    """The entry point in pyproject.toml: `frame.main`."""
    return importlib.import_module("ddf.cli.frame").main(argv)
