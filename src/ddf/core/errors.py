"""Errors of the user, and what they are told: unknown names with the known ones, messages in one line.

numpy is not imported here: bare help and `ddf doctor` do without.
"""

from collections.abc import Iterable

_HEAD, _TAIL = 320, 150  # characters of a message that are kept of a longer one


class InputError(ValueError):
    """The user's input cannot be used. One line, under 500 characters: what, which file, what to do."""

    def __init__(self, message: str) -> None:
        long = len(message) > _HEAD + _TAIL
        super().__init__(f"{message[:_HEAD]} ... {message[-_TAIL:]}" if long else message)


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
        raise InputError(f"{where}: unknown key {unknown!r}; the keys are {known_names(unknown, known)}")
