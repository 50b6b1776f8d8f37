"""The comparison helper itself, and names that would hide a test."""

import ast
from pathlib import Path

import numpy as np
import pytest
import torch
from _support import assert_close

TESTS = Path(__file__).resolve().parent


@pytest.mark.parametrize(("dtype", "step"), [(torch.float64, 1e-8), (torch.float32, 1e-3), (torch.bfloat16, 5e-2)])
def test_assert_close_follows_the_coarser_type_and_names_the_worst_entry(dtype, step):
    one = torch.ones(3, dtype=dtype)
    assert_close(np.array([1.0 + step / 1e3]), one[:1])
    with pytest.raises(AssertionError, match=r"1 of 3 entries differ; the worst at \(2,\): .* against .*1\.0"):
        assert_close(one + torch.tensor([0, 0, step], dtype=dtype), one)


def test_assert_close_refuses_nan_infinity_other_shapes_integers_that_differ_and_a_loose_rtol():
    assert_close(np.array([np.inf, -np.inf]), np.array([np.inf, -np.inf]))
    for other in (np.array([np.nan, 1.0]), np.array([-np.inf, 1.0]), np.array([1.0, 1.0]), np.array([[np.inf, 1.0]])):
        with pytest.raises(AssertionError):
            assert_close(other, np.array([np.inf, 1.0]))
    for one, other in (([np.nan], [np.nan]), ([1, 2], [1, 3])):
        with pytest.raises(AssertionError):
            assert_close(np.array(one), np.array(other))
    with pytest.raises(ValueError, match="rtol must be"):
        assert_close(1.0, 1.0, rtol=0.1)


def test_names_hide_no_test():
    files = sorted(TESTS.rglob("test_*.py"))
    own = [[node.name for node in ast.parse(f.read_text()).body if isinstance(node, ast.FunctionDef)] for f in files]
    for names in (*own, [file.name for file in files]):
        assert len(names) == len(set(names)), [name for name in names if names.count(name) > 1]
