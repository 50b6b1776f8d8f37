"""Arguments shared by commands: lists that name what the library has, and checks before any work."""

import argparse

import pytest

from ddf.cli import arguments
from ddf.cli.model import export
from ddf.fields import framed_field
from ddf.io import onnx_file


def test_lists_are_those_of_the_library():
    assert arguments.UP_AXES == framed_field.UP_AXES
    assert export.PRECISIONS == (onnx_file.FULL, *onnx_file.PRECISIONS)


@pytest.mark.parametrize("text", ["x", "1.5", "0", "11", ""])
def test_whole_numbers_keep_to_their_range(text):
    with pytest.raises(argparse.ArgumentTypeError, match=f"must be a whole number, 1 to 10; got '{text}'"):
        arguments.whole_number(1, 10)(text)


def test_whole_numbers_may_have_no_end():
    assert arguments.whole_number(0)("123456789") == 123456789
    with pytest.raises(argparse.ArgumentTypeError, match="must be a whole number, 0 or more; got '-1'"):
        arguments.whole_number(0)("-1")


def test_outputs_are_a_list_with_commas():
    assert arguments.outputs(" depth, normals,") == ("depth", "normals")
    with pytest.raises(argparse.ArgumentTypeError, match=r"must be among visibility, .*; got colour"):
        arguments.outputs("depth,colour")
    with pytest.raises(argparse.ArgumentTypeError, match="got none"):
        arguments.outputs(",")
