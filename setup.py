"""What pyproject.toml cannot say: README.md for an index, without its picture and its links into the checkout."""

import re
from pathlib import Path

import setuptools

README = Path(__file__).with_name("README.md").read_text(encoding="utf-8")
WITHOUT_PICTURES = re.sub(r"(?m)^!\[.*\n(?:\n\*.*\*\n)?\n?", "", README)
TEXT = re.sub(r"\[([^\]]*)\]\((?!https?:)[^)]*\)", r"\1", WITHOUT_PICTURES)

setuptools.setup(long_description=TEXT, long_description_content_type="text/markdown")
