"""The site's menu has every page, or `make docs` stops with a warning."""

from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[2]
PAGES = ("*.md", "docs/*.md", "examples/*.md")  # those of reports/ need no place in the menu


def _named(menu):
    for entry in menu:
        for target in entry.values():
            if isinstance(target, str):
                yield target
            else:
                yield from _named(target)


def test_the_menu_has_every_page_once_and_no_other():
    named = list(_named(yaml.safe_load((ROOT / "mkdocs.yml").read_text())["nav"]))
    assert len(named) == len(set(named)) and all((ROOT / name).is_file() for name in named)
    pages = {str(page.relative_to(ROOT)) for pattern in PAGES for page in ROOT.glob(pattern)}
    assert pages == {name for name in named if not name.startswith("reports/")}
