"""The `ddf` command: `frame.COMMANDS` lists the commands, each a function of a module here, and `frame` runs them."""

import importlib
import time
from collections.abc import Sequence

STARTED = time.monotonic()  # of the process, but for the interpreter's own start


def main(argv: Sequence[str] | None = None) -> int:
    """The entry point in pyproject.toml: `frame.main`."""
    return importlib.import_module("ddf.cli.frame").main(argv)
