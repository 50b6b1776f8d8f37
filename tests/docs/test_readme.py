"""What README.md and the docs tell people to type and to open is there."""

import re
import subprocess
from pathlib import Path

import pytest

from ddf.cli import frame

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_and_links_exist(page):
    text = page.read_text()
    assert set(re.findall(r"(?:^    |`)ddf ([a-z]+)\b", text, re.MULTILINE)) <= set(frame.COMMANDS)
    links = [link for link in re.findall(r"\]\(([^)#]+)\)", text) if not link.startswith("http")]
    assert [link for link in links if not (page.parent / link).exists()] == []


@pytest.mark.parametrize("given", ["/my data/~ (1)", "~/shapes", "a$b", "a'b\"c"])
def test_recipes_get_the_root_of_data_as_it_was_given(tmp_path, given):
    (tmp_path / "Makefile").write_text(f"include {ROOT / 'Makefile'}\nshown:\n\t@env\n")
    shown = subprocess.run(["make", "shown", f"DATA={given}"], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert f"DATA={given}" in shown.stdout.splitlines()
