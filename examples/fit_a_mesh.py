"""Fit a field to a mesh file for some minutes, keep it in a folder and say how well it does on rays it never saw.

python examples/fit_a_mesh.py MESH.obj my_field --minutes 2
"""

import argparse

import numpy as np

import ddf

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("mesh", help="an OBJ, PLY, STL, OFF or GLB file")
    parser.add_argument("out", help="folder of the field; a stopped fit goes on there")
    parser.add_argument("--minutes", type=float, default=2.0, help="wall time of sampling and training")
    parser.add_argument("--rays", type=int, default=2000)
    args = parser.parse_args()

    try:
        mesh = ddf.read_mesh(args.mesh)
        field = ddf.fit(mesh, minutes=args.minutes, out=args.out)
    except (OSError, ValueError) as error:
        parser.error(str(error))

    lower, upper = field.box
    random = np.random.default_rng(0)
    directions = random.standard_normal((args.rays, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    positions = random.uniform(lower, upper, (args.rays, 3)) - 2 * np.linalg.norm(upper - lower) * directions
    truth, seen = ddf.cast(mesh, positions, directions), field.query(positions, directions)
    print(f"visibility is right for {100 * np.mean((seen['visibility'] >= 0.5) == truth.visible):.1f} % of the rays")
