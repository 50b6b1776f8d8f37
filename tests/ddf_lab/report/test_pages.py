"""Pages that git keeps: narrow tables, links that hold."""

import re
import subprocess
from pathlib import Path

import pytest

from ddf_lab.report import pages

ROOT = Path(__file__).resolve().parents[3]
PAGES = sorted((ROOT / "reports").glob("**/*.md"))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: f"{page.parent.name}/{page.name}")
def test_pages_are_readable_and_what_is_linked_is_kept_in_git(page):
    listed = subprocess.run(["git", "ls-files", "reports"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode:
        pytest.skip("not a git checkout")
    text, tracked = page.read_text(encoding="utf-8"), listed.stdout.splitlines()
    widths = [len(re.findall(r"(?<!\\)\|", line)) - 1 for line in text.splitlines() if line.startswith("|")]
    assert max(widths, default=0) <= pages.MAX_COLUMNS
    paths = [(page.parent / name).resolve() for name in re.findall(r"\]\(([^)#]+)\)", text) if ":" not in name]
    assert [path for path in paths if not path.exists()] == []
    inside = [path.relative_to(ROOT).as_posix() for path in paths if path.is_relative_to(ROOT / "reports")]
    assert [name for name in inside if not any(f"{one}/".startswith(f"{name}/") for one in tracked)] == []
