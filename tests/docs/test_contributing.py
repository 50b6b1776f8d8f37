"""The diffs of CONTRIBUTING.md fit the files as they are."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CHANGES = {
    section.splitlines()[0]: "".join(re.findall(r"```diff\n(.*?)```", section, re.DOTALL))
    for section in re.split(r"(?m)^### ", (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"))[1:]
}


def _files(diff):
    """Path before, None for a new file, and its hunks."""
    for part in re.split(r"(?m)^--- ", diff)[1:]:
        old, new, *_ = part.splitlines()
        assert new.startswith("+++ b/")
        hunks = re.split(r"(?m)^@@ .*\n", part)[1:]
        yield (None if old == "/dev/null" else old.removeprefix("a/")), new.removeprefix("+++ b/"), hunks


def test_there_are_twelve():
    assert len(CHANGES) == 12 and all(CHANGES.values())


@pytest.mark.parametrize("name", CHANGES)
def test_a_diff_fits_and_touches_at_most_four_files(name):
    files = list(_files(CHANGES[name]))
    assert 1 <= len(files) <= 4
    for old, new, hunks in files:
        assert hunks
        if old is None:
            assert not (ROOT / new).exists()
            continue
        text, place = (ROOT / old).read_text(encoding="utf-8"), 0
        for hunk in hunks:
            lines = [line for line in hunk.splitlines() if not line.startswith("+")]
            before = "\n".join(line[1:] for line in lines)
            found = text.find(before, place)
            assert found >= 0, f"{old} has no longer:\n{before}"
            place = found + len(before)
