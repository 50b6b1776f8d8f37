"""Errors of the user or of the machine as one line on stderr and exit code 2; anything else keeps its traceback."""

import sys
from collections.abc import Callable

from ddf.core import extras


def guarded(function: Callable[[], object], program: str) -> int:
    """Call `function`; exit code 0, or 2 after one line on stderr when the user's input or disk is at fault."""
    try:
        function()
    except (ValueError, OSError) as error:
        from ddf.core import checks  # here, because it imports numpy, and `ddf doctor` has to run without

        if isinstance(error, ValueError) and not isinstance(error, checks.InputError):
            raise
        sys.stderr.write(f"{program}: error: {' '.join(describe(error).split())}\n")
        return 2
    except ModuleNotFoundError as error:
        told = extras.hint(error)
        if told is None:
            raise
        sys.stderr.write(f"{program}: error: {told}\n")
        return 2
    return 0


def describe(error: Exception) -> str:
    """The message of an error in one line, with the file's name for errors of the operating system."""
    if isinstance(error, OSError) and error.strerror:
        return f"{error.strerror}: {error.filename}" if error.filename else error.strerror
    return str(error)
