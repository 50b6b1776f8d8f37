"""Every example in the docstrings of the Python interface runs and gives what it says."""

import doctest
import importlib
from pathlib import Path

import pytest

import ddf

MODULES = sorted(path.stem for path in Path(ddf.__file__).with_name("api").glob("[a-z]*.py"))


@pytest.mark.parametrize("name", MODULES)
def test_docstring_examples(name):
    failed, _ = doctest.testmod(importlib.import_module(f"ddf.api.{name}"))
    assert failed == 0


def test_every_public_function_has_an_example():
    public = [getattr(ddf, name) for name in ddf.__all__]
    methods = [getattr(ddf.Scene, name) for name in ("query", "render", "udf", "box")]
    methods += [getattr(ddf.Field, name) for name in ("points", "surface")]
    for item in [value for value in public if not isinstance(value, type)] + methods:
        assert ">>> " in (item.__doc__ or ""), item
