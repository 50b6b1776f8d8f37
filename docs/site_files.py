"""Hooks of mkdocs: pages lie where the repository has them, so that links work in both places; formulas are MathML.

The page of the Python interface ends in what the docstrings say; long tables of benchmarks open by a click; the gallery
shows the fields that docs/gallery.py writes.
"""

import ast
import html
import re
import subprocess
from pathlib import Path
from typing import Any

import griffe
from latex2mathml import converter
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[1]
PAGES = [
    "README.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "docs/*.md",
    "docs/*.webp",
    "docs/*.svg",
    "docs/*.css",
    "docs/*.js",
    "reports/**/*.md",
]
LINKED = (
    "LICENSE CITATION.cff pipeline.yaml configs/*.yaml src/ddf/**/*.py reports/** examples/** docs/recipes/*".split()
)

API, BENCH, GALLERY, CARD = "docs/api.md", "reports/bench/README.md", "docs/gallery.md", "docs/fields.webp"
LONG_TABLE = 16  # lines
NAMED = {  # parts of the theme's pages that have no name of their own, by what their tags hold
    'data-md-component="search" role="dialog"': "Search",
    'id="__search"': "Search",
    'id="__drawer"': "Navigation",
}


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


class Sections(griffe.Extension):
    """Docstrings have no empty line before a section; griffe wants one."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Parts the sections of a docstring."""
        if obj.docstring:
            obj.docstring.value = re.sub(r"\n(Returns|Raises|Example)(:\n)", _parted, obj.docstring.value)


def _parted(head: re.Match[str]) -> str:
    return f"\n\n{head[1].replace('Example', 'Examples')}{head[2]}"


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Adds the docstrings of `ddf.__all__` and live fields; folds long tables of benchmarks."""
    if page.file.src_uri == API:
        (modules,) = re.findall(r"(?ms)^_MODULES = (\{.*?^\})", (ROOT / "src" / "ddf" / "__init__.py").read_text())
        homes = ast.literal_eval(modules).items()
        named = "\n\n".join(f"::: ddf.api.{home}.{name}" for home, names in homes for name in names)
        return f"{markdown}\n\n## Reference\n\n{named}\n"
    if page.file.src_uri == GALLERY:
        live = '<iframe class="live" src="live/rabbit.html" title="A rabbit, live" loading="lazy"></iframe>\n'
        shown = r'<a class="gallery" href="live/\1.html"><img src="live/\1.webp" alt="\1"><br>\1: \2</a>'
        return re.sub(r"(?m)^- `([\w-]+)`: (.+)$", shown, markdown) + live
    if page.file.src_uri == BENCH:
        return re.sub(rf"(?m)(?:^\|.*\n){{{LONG_TABLE},}}", _folded, markdown)
    return markdown


def _folded(table: re.Match[str]) -> str:
    count = table[0].count("\n") - 2
    return f'<details markdown="1"><summary>{count} rows</summary>\n\n{table[0]}\n</details>\n'


def on_post_page(output: str, page: Page, config: MkDocsConfig) -> str:
    """What a link to the page shows where it is shared; the picture where the site knows its own address."""
    facts = {"title": f"{page.title} - {config.site_name}", "description": config.site_description}
    if config.site_url:
        facts["image"] = config.site_url.rstrip("/") + "/" + CARD
    card = "".join(f'<meta property="og:{name}" content="{html.escape(str(text))}">' for name, text in facts.items())
    return named(output).replace("</head>", f"{card}</head>", 1)


def on_post_template(output_content: str, template_name: str, **_: Any) -> str:
    """The page of what is not found has the same parts."""
    return named(output_content) if template_name == "404.html" else output_content


def named(page: str) -> str:
    """Names, for those who hear the page, of parts of the theme that have none.

    Raises:
      LookupError: the theme's pages are not as `NAMED` says.
    """
    for part, name in NAMED.items():
        if page.count(part) != 1:
            raise LookupError(f"{part} is in a page {page.count(part)} times; mend NAMED in docs/site_files.py")
        page = page.replace(part, f'{part} aria-label="{name}"')
    return page


def on_page_content(content: str, **_: Any) -> str:
    """Replaces the formulas that arithmatex found; browsers draw MathML themselves. A header without text is none."""
    content = re.sub(r"<th([^>]*)>\s*</th>", r"<td\1></td>", content)
    formula = re.compile(r'<span class="arithmatex">\\\((.*?)\\\)</span>', re.DOTALL)
    return formula.sub(lambda found: converter.convert(html.unescape(found[1])), content)
