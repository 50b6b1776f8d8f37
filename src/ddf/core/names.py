"""Unknown names: the known ones, and the one that was perhaps meant."""

from collections.abc import Iterable


def known(name: object, names: Iterable[object]) -> str:
    """The names, with a question after them where one is near to what was given."""
    import difflib  # only where something is wrong

    words = [str(each) for each in names]
    near = difflib.get_close_matches(str(name), words, 1)
    return (", ".join(words) or "none") + (f" (did you mean {near[0]}?)" if near else "")
