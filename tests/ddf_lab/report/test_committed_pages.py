"""The pages in reports/ that are kept in git: narrow tables, files that exist, no HTML."""

import re
import subprocess
from pathlib import Path

import pytest

from ddf_lab.report import pages

ROOT = Path(__file__).resolve().parents[3]
KEPT = (
    "README.md",
    "cpu/README.md",
    "cpu_paper/README.md",
    "real/README.md",
    "figures/README.md",
    "fit/README.md",
    "generative/README.md",
    "bench/README.md",
    "hard_cases.md",
    "mutants.md",
)
PAGES = [ROOT / "reports" / name for name in KEPT]


def _tracked() -> list[str]:
    """The files of reports/ that git keeps."""
    listed = subprocess.run(["git", "ls-files", "reports"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode:
        pytest.skip("not a git checkout")
    return listed.stdout.splitlines()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: f"{page.parent.name}/{page.name}")
def test_tables_are_narrow_and_what_is_linked_exists(page):
    text = page.read_text(encoding="utf-8")
    widths = [len(re.findall(r"(?<!\\)\|", line)) - 1 for line in text.splitlines() if line.startswith("|")]
    assert widths and max(widths) <= pages.MAX_COLUMNS
    linked = [name for name in re.findall(r"\]\(([^)#]+)\)", text) if ":" not in name]
    assert [name for name in linked if not (page.parent / name).exists()] == []


def test_html_pages_are_not_kept():
    assert not [name for name in _tracked() if name.endswith(".html")]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: f"{page.parent.name}/{page.name}")
def test_what_is_linked_in_reports_is_kept_in_git(page):
    linked = re.findall(r"\]\(([^)#]+)\)", page.read_text(encoding="utf-8"))
    paths = [(page.parent / name).resolve() for name in linked if ":" not in name]
    inside = [path.relative_to(ROOT).as_posix() for path in paths if path.is_relative_to(ROOT / "reports")]
    tracked = _tracked()
    assert [
        name for name in inside if name not in tracked and not any(one.startswith(f"{name}/") for one in tracked)
    ] == []
