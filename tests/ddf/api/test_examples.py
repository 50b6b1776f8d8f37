"""Every example in the docstrings of the Python interface runs and gives what it says."""

import doctest
import importlib
from pathlib import Path

import pytest

import ddf

MODULES = sorted(path.stem for path in Path(ddf.__file__).with_name("api").glob("[a-z]*.py"))


@pytest.mark.usefixtures("few_hits", "quick_completion")
@pytest.mark.parametrize("name", MODULES)
def test_docstring_examples(name):
    failed, _ = doctest.testmod(importlib.import_module(f"ddf.api.{name}"))
    assert failed == 0
