"""The comparison helper itself, and a hunt for assertions that pytest never runs."""

import ast
from pathlib import Path

import numpy as np
import pytest
import torch
from _support import assert_close

TESTS = Path(__file__).resolve().parent


def test_assert_close_names_the_worst_entry():
    with pytest.raises(AssertionError, match=r"2 of 3 entries differ; the worst at \(2,\): .*4.0.* against .*3.0"):
        assert_close(np.array([1.0, 2.001, 4.0]), np.array([1.0, 2.0, 3.0]))


@pytest.mark.parametrize(("dtype", "step"), [(torch.float64, 1e-8), (torch.float32, 1e-3), (torch.bfloat16, 5e-2)])
def test_assert_close_tolerance_follows_the_type(dtype, step):
    one = torch.ones(3, dtype=dtype)
    assert_close(one, one)
    with pytest.raises(AssertionError):
        assert_close(one, one + torch.tensor([0, 0, step], dtype=dtype))


def test_assert_close_takes_the_coarser_type():
    assert_close(np.array([1.0]), np.array([1.0 + 1e-6], dtype=np.float32))


def test_assert_close_refuses_nan_infinity_and_other_shapes():
    assert_close(np.array([np.inf, -np.inf]), np.array([np.inf, -np.inf]))
    for other in (np.array([np.nan, 1.0]), np.array([-np.inf, 1.0]), np.array([1.0, 1.0]), np.array([[np.inf, 1.0]])):
        with pytest.raises(AssertionError):
            assert_close(other, np.array([np.inf, 1.0]))
    with pytest.raises(AssertionError):
        assert_close(np.array([np.nan]), np.array([np.nan]))


def test_assert_close_compares_integers_exactly():
    with pytest.raises(AssertionError):
        assert_close(np.array([1, 2]), np.array([1, 3]))


def test_assert_close_refuses_a_loose_rtol():
    with pytest.raises(ValueError, match="rtol must be"):
        assert_close(1.0, 1.0, rtol=0.1)


def _uncollected(source: str) -> list[str]:
    """Functions that assert, are not tests and are not private (or fixtures): pytest would never run them."""
    found = []
    tree = ast.parse(source)
    scopes = [tree, *(node for node in tree.body if isinstance(node, ast.ClassDef))]
    for scope in scopes:
        for node in scope.body:
            if not isinstance(node, ast.FunctionDef) or node.name.startswith(("test", "_")):
                if (
                    isinstance(scope, ast.Module)
                    or scope.name.startswith("Test")
                    or not isinstance(node, ast.FunctionDef)
                ):
                    continue
                if not node.name.startswith("test"):
                    continue
            names = {ast.unparse(call.func) for call in ast.walk(node) if isinstance(call, ast.Call)}
            asserts = any(isinstance(inner, ast.Assert) for inner in ast.walk(node))
            if asserts or any(name.split(".")[-1].startswith(("assert_", "raises")) for name in names):
                found.append(node.name)
    return found


def test_the_hunt_finds_what_it_should():
    source = "def check_a():\n    assert 1\ndef test_b():\n    assert 1\ndef _c():\n    assert 1\nclass Cases:\n    def test_d(self):\n        assert 1\n"
    assert _uncollected(source) == ["check_a", "test_d"]


@pytest.mark.parametrize("path", sorted(TESTS.rglob("*.py")), ids=lambda path: path.name)
def test_every_asserting_function_is_collected(path):
    collected = path.name.startswith("test_")
    names = [
        name for name in _uncollected(path.read_text()) if not (path.name == "_support.py" and name == "assert_close")
    ]
    assert names == []
    if not collected:
        tests = [node.name for node in ast.parse(path.read_text()).body if getattr(node, "name", "").startswith("test")]
        assert tests == []


def test_no_two_tests_of_a_file_share_a_name():
    for path in sorted(TESTS.rglob("test_*.py")):
        names = [node.name for node in ast.parse(path.read_text()).body if isinstance(node, ast.FunctionDef)]
        assert len(names) == len(set(names)), path.name
