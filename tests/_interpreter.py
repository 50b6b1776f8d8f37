"""Kernels for a GPU by Triton's interpreter, which must be asked for before Triton is imported: in another process."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest


def interpreted(script, test):
    """What a script of a test file did, whose imports find that file; the test is skipped where Triton is missing."""
    if importlib.util.find_spec("triton") is None:
        pytest.skip("needs Triton")
    paths = os.pathsep.join(
        [str(Path(test).resolve().parent), str(Path(__file__).resolve().parent), os.environ.get("PYTHONPATH", "")]
    )
    environment = os.environ | {"TRITON_INTERPRET": "1", "PYTHONPATH": paths}
    return subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True)
