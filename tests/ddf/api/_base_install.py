"""What the base install must do outside the checkout, without torch: prints what was loaded and what it says."""

import json
import sys
import tempfile
from pathlib import Path

import numpy as np

import ddf

rabbit = ddf.load("rabbit")
pictures = rabbit.render(35, 25, size=256, outputs=("depth", "normals"))
assert pictures["normals"].shape == (256, 256, 3)
assert 0.1 < np.isfinite(pictures["depth"]).mean() < 0.9
beside = np.eye(4)
beside[0, 3] = 1.5
scene = ddf.compose([rabbit, ddf.load("armchair")], [np.eye(4), beside])
both = scene.render(35, 25, size=256)
assert np.isfinite(both["depth"]).any()
seen = rabbit.query([[0.0, 0.45, 5.0]], [[0.0, 0.0, -1.0]])
assert seen["visibility"][0] > 0.5
scores = ddf.compare(np.zeros((1, 3)), [[0.0, 0.0, 0.005]])
assert scores.f_score_tau == 1.0
file = Path(tempfile.mkdtemp(), "triangle.obj")
file.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", encoding="utf-8")
mesh = ddf.read_mesh(file)
assert mesh.faces.tolist() == [[0, 1, 2]]
fitted = ddf.fit(mesh, out=file.parent / "field")
assert fitted.points(50).shape == (50, 3) and len(fitted.surface(resolution=16).faces) > 10
assert fitted.query([[0.2, 0.2, 1.0]], [[0.0, 0.0, -1.0]])["depth"].round(3) == [1.0]
assert ddf.cast(mesh, [[0.2, 0.2, 1.0]], [[0.0, 0.0, -1.0]]).depth == [1.0]
assert ddf.load(file.parent / "field").export(file.parent / "field.html").is_file()
(onnx := file.parent / "alone.onnx").write_bytes(b"")
told = {}
for name, function in {
    "network": lambda: ddf.load("rabbit-network"),
    "poisson": lambda: rabbit.surface(10, "poisson"),
    "export": lambda: fitted.export(file.parent / "field.onnx"),
    "fit": lambda: ddf.fit(mesh, steps=1),
    "reconstruct": lambda: ddf.reconstruct(file, "chair"),
    "torch": lambda: ddf.torch.Field(rabbit),
    "onnx": lambda: ddf.load(onnx),
}.items():
    try:
        function()
    except ValueError as error:
        told[name] = str(error)
heavy = sorted({"torch", "torchvision", "pandas", "matplotlib", "open3d", "trimesh"} & set(sys.modules))
print(json.dumps({"file": ddf.__file__, "heavy": heavy, "told": told}))
