"""Ask a field along rays from its ONNX file alone: torch is not imported.

python examples/onnx_without_torch.py FIELD.onnx  a file that `ddf export` wrote
"""

import argparse
import sys

import numpy as np

import ddf

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("field", help="a .onnx file")
    try:
        field = ddf.load(parser.parse_args().field)
    except (OSError, ValueError) as error:
        parser.error(str(error))
    lower, upper = field.box
    heights = np.linspace(lower[1], upper[1], 7)  # in the frame of the mesh
    middle = (lower + upper) / 2
    positions = np.stack([np.full(7, middle[0]), heights, np.full(7, upper[2] + 1)], axis=1)
    directions = np.tile([0.0, 0.0, -1.0], (7, 1))
    seen = field.query(positions, directions, outputs=("depth", "visibility"))
    for height, depth, visibility in zip(heights, seen["depth"], seen["visibility"], strict=True):
        print(f"height {height:6.3f}: depth {depth:6.3f}, visibility {visibility:.3f}")
    assert "torch" not in sys.modules
