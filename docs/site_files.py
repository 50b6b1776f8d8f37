"""Hooks of mkdocs: pages lie where the repository has them, so that links work in both places; formulas are MathML."""

import html
import re
import subprocess
from pathlib import Path
from typing import Any

from latex2mathml import converter
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[1]
PAGES = ["README.md", "CHANGELOG.md", "CONTRIBUTING.md", "docs/*.md", "docs/*.webp", "docs/*.svg", "reports/**/*.md"]
LINKED = (
    "LICENSE CITATION.cff pipeline.yaml configs/*.yaml src/ddf/**/*.py reports/** examples/** docs/recipes/*".split()
)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Replaces the files of docs/ by those of the repository that a page shows or links to; the theme's own stay."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "--", *PAGES, *LINKED]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines()
    theme = [file for file in files if file.src_dir != config.docs_dir]
    own = [
        File.generated(config, name, abs_src_path=str(ROOT / name))
        for name in sorted(set(listed))
        if (ROOT / name).is_file()
    ]
    return Files([*theme, *own])


def on_page_content(content: str, **_: Any) -> str:
    """Replaces the formulas that arithmatex found; browsers draw MathML themselves."""
    formula = re.compile(r'<span class="arithmatex">\\\((.*?)\\\)</span>', re.DOTALL)
    return formula.sub(lambda found: converter.convert(html.unescape(found[1])), content)
