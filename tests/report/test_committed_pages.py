"""The pages in reports/ that are kept in git: narrow tables, files that exist, no HTML."""

import re
import subprocess
from pathlib import Path

import pytest

from ddf.report import pages

ROOT = Path(__file__).resolve().parents[2]
KEPT = (
    "README.md",
    "cpu/README.md",
    "figures/README.md",
    "fit/README.md",
    "fit_proof/README.md",
    "bench/README.md",
    "growth.md",
)
PAGES = [ROOT / "reports" / name for name in (*KEPT, "hard_cases.md")]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: f"{page.parent.name}/{page.name}")
def test_tables_are_narrow_and_what_is_linked_exists(page):
    text = page.read_text(encoding="utf-8")
    widths = [len(re.findall(r"(?<!\\)\|", line)) - 1 for line in text.splitlines() if line.startswith("|")]
    assert widths and max(widths) <= pages.MAX_COLUMNS
    linked = [name for name in re.findall(r"\]\(([^)#]+)\)", text) if ":" not in name]
    assert [name for name in linked if not (page.parent / name).exists()] == []


def test_html_pages_are_not_kept():
    tracked = subprocess.run(["git", "ls-files", "reports"], cwd=ROOT, capture_output=True, text=True, check=False)
    if tracked.returncode:
        pytest.skip("not a git checkout")
    assert not [name for name in tracked.stdout.split() if name.endswith(".html")]
