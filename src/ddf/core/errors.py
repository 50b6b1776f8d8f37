"""What a user is told: unknown names with the known ones, and errors of the user or of the machine.

Those are one line on stderr and exit code 2; anything else keeps its traceback.
"""

import signal
import sys
from collections.abc import Callable, Iterable

from ddf.core import extras


def guarded(function: Callable[[], object], program: str, kept: str = "") -> int:
    """Call `function`; exit code 0, or 2 after one line on stderr when the user's input or disk is at fault.

    Args:
      kept: what is left, and how to go on, where a signal ends the work and nothing says it better; 128 and the
        signal's number is the code then.
    """
    try:
        function()
    except (ValueError, OSError) as error:
        from ddf.core import checks  # here, because it imports numpy, and `ddf doctor` has to run without

        if isinstance(error, ValueError) and not isinstance(error, checks.InputError):
            raise
        sys.stderr.write(f"{program}: error: {' '.join(describe(error).split())}\n")
        return 2
    except KeyboardInterrupt as stop:
        told = getattr(stop, "kept", "") or kept
        told += " the same command" if told.endswith(":") else ""
        sys.stderr.write(f"{program}: interrupted{f': {told}' if told else ''}\n")
        return 128 + getattr(stop, "number", signal.SIGINT)
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


def known_names(name: object, names: Iterable[object]) -> str:
    """The names, with a question after them where one is near to what was given."""
    import difflib  # only where something is wrong

    words = [str(each) for each in names]
    near = difflib.get_close_matches(str(name), words, 1)
    return (", ".join(words) or "none") + (f" (did you mean {near[0]}?)" if near else "")


def require_known(where: str, given: Iterable[object], known: Iterable[object]) -> None:
    """Raise unless every key is a known one; the nearest known one is asked for."""
    known = list(known)
    unknown = next((str(key) for key in given if key not in known), None)
    if unknown is not None:
        from ddf.core import checks

        raise checks.InputError(f"{where}: unknown key {unknown!r}; the keys are {known_names(unknown, known)}")
