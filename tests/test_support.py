"""The comparison helper itself, and names that would hide a test."""

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
    assert_close(np.array([1.0 + step / 1e3]), one[:1])  # the coarser of the two
    with pytest.raises(AssertionError):
        assert_close(one, one + torch.tensor([0, 0, step], dtype=dtype))


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


def test_no_two_tests_of_a_file_share_a_name():
    for path in sorted(TESTS.rglob("test_*.py")):
        names = [node.name for node in ast.parse(path.read_text()).body if isinstance(node, ast.FunctionDef)]
        assert len(names) == len(set(names)), path.name


def test_no_two_test_files_have_one_name():
    names = [file.name for file in TESTS.rglob("test_*.py")]
    assert sorted(name for name in set(names) if names.count(name) > 1) == []
