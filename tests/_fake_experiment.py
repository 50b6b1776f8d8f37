"""A small experiment's artefacts without any training: ellipsoids, and noisy copies of them as predictions."""

import json

import numpy as np
import pandas as pd
from PIL import Image

from ddf.core import storage

SIZES = {"L": 400, "S": 150}
NUM_TRUTH, NOISE = 700, 0.004  # points; deviation of a prediction, v1 units
SIZE = 32  # of the rendered pictures


def nearest_train_image(row):
    """Row, modulo their number, of the training image whose feature is nearest to that of test image `row`."""
    return 5 * row + 3


def _unit(generator, count):
    points = generator.normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def _axes(generator):
    """Half axes of an ellipsoid in the v1 frame: the box's diagonal is 1."""
    axes = generator.uniform(0.4, 1.0, size=3)
    return axes / np.linalg.norm(2 * axes)


def _write_image(path):
    pixels = np.zeros((137, 137, 4), np.uint8)
    pixels[24:112, 24:112] = 255, 153, 102, 255
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(pixels).save(path)


def _renders(count):
    """Visibility, depth and normals of a square that faces the camera."""
    visible = np.zeros((count, SIZE, SIZE))
    visible[:, 8:24, 8:24] = 1
    depth = np.where(visible > 0, 2.0, np.inf)
    return {"render.visibility": visible, "render.depth": depth, "render.normals": visible[..., None] * [0, 0, 1]}


class FakeExperiment:
    """Writes everything below `root` that the evaluate and report stages read; keeps the truth for the tests."""

    def __init__(self, root, categories=("chair", "plane"), train=6, test=3):
        self.root, self.artifacts = root, root / "artifacts" / "fake"
        self.generator = np.random.default_rng(0)
        self.categories = {}
        for category in categories:
            shapes = [f"{category}{i:02d}" for i in range(train + test)]
            self.categories[category] = {
                "axes": {shape: _axes(self.generator) for shape in shapes},
                "train": shapes[:train],
                "test": shapes[train:],
            }
            self._write_dataset(category)
            self._write_meshes(category)
            self._write_samples(category)
            self._write_clouds(category)
            self._write_logs(category)
        self._write_index()

    def _folder(self, stage, category):
        return self.artifacts / stage / category

    def images(self, category):
        """Test images: views 0 and 1 of every test shape."""
        return [(shape, view) for shape in self.categories[category]["test"] for view in (0, 1)]

    def _write_index(self):
        categories = {
            name: {
                "synset": f"0{number}",
                "shapes": [{"id": shape, "train_views": [0, 1], "test_views": []} for shape in entry["train"]]
                + [{"id": shape, "train_views": [], "test_views": [0, 1]} for shape in entry["test"]],
            }
            for number, (name, entry) in enumerate(self.categories.items())
        }
        index = {"root": "artifacts/fake/dataset", "source": "synthetic", "seed": 0, "categories": categories}
        storage.write_json(self.artifacts / "dataset" / "index.json", index)

    def _write_dataset(self, category):
        number = list(self.categories).index(category)
        for shape, view in self.images(category):
            folder = self.artifacts / "dataset" / "ShapeNetRendering" / f"0{number}" / shape / "rendering"
            _write_image(folder / f"{view:02d}.png")

    def _write_meshes(self, category):
        ids = list(self.categories[category]["axes"])
        folder = self._folder("meshes", category)
        storage.save_tensors(folder / "000.meshes.safetensors", {}, {"ids": ids})
        storage.write_text(folder / "failures.csv", f"id,stage,reason\n{category}99,meshes,no triangles left\n")
        _write_note(folder, "000.meshes.safetensors")

    def _write_samples(self, category):
        axes = self.categories[category]["axes"]
        points = np.concatenate([_unit(self.generator, NUM_TRUTH) * axes[shape] for shape in axes])
        offsets = np.arange(len(axes) + 1) * NUM_TRUTH
        hidden = np.tile(np.arange(NUM_TRUTH) % 10 == 0, len(axes))
        tensors = {"points": points.astype(np.float32), "offsets": offsets, "hidden": hidden}
        folder = self._folder("samples", category)
        storage.save_tensors(folder / "000.clouds.safetensors", tensors, {"ids": list(axes), "fingerprint": "x"})
        samples = {"U.depth": np.zeros((len(axes), 4), np.uint16)}
        storage.save_tensors(folder / "000.samples.safetensors", samples, {"ids": list(axes)})
        storage.write_text(folder / "failures.csv", "id,stage,reason\n")
        _write_note(folder, "000.clouds.safetensors", "000.samples.safetensors")

    def _surface(self, category, shape, count, noise):
        """Points of the shape in the field frame, moved by `noise` (v1 units)."""
        axes = self.categories[category]["axes"][shape]
        points = _unit(self.generator, count) * axes
        return (points + noise * self.generator.normal(size=points.shape)) / axes.max()

    def _write_clouds(self, category):
        images, axes = self.images(category), self.categories[category]["axes"]
        count = len(images)
        ranges = ((0, 2 * np.pi), (0.43, 0.52), (0.65, 0.95))
        camera = np.stack([self.generator.uniform(*each, count) for each in ranges], axis=1)
        scale = np.array([axes[shape].max() for shape, _ in images])
        common = {"camera_true": camera, "scale_true": scale, "scale_pred": scale * 1.01}
        common["centre_true"] = np.zeros((count, 3))
        record = {"images": [{"id": shape, "view": view} for shape, view in images], "fingerprint": "x", "seed": 0}
        ddf = {
            f"{size}.h{cycles}": self._clouds(category, n, NOISE * (4 - cycles))
            for size, n in SIZES.items()
            for cycles in (1, 3)
        }
        ddf |= common | {
            "camera_pred": camera + np.array([0.1, 0.02, 0.01]),
            "camera_corrected": camera + np.array([0.05, 0.01, 0.005]),
        }
        train_images = [{"id": shape, "view": view} for shape in self.categories[category]["train"] for view in (0, 1)]
        ddf["train_features"] = self.generator.normal(size=(len(train_images), 20))
        nearest = [nearest_train_image(row) % len(train_images) for row in range(count)]
        ddf["features"] = ddf["train_features"][nearest] + 0.1
        ddf |= _renders(count)
        three = {"three_views": (scale[:, None, None] * self._clouds(category, SIZES["L"], NOISE))[[0, 2]]}
        record["three_views"] = [images[0][0], images[2][0]]
        record_ddf = record | {"train_images": train_images, "rendered": list(range(count))}
        folder = self._folder("pointclouds", category)
        storage.save_tensors(folder / "ddf.safetensors", _float32(ddf | three), record_ddf)
        pcs = {size: self._clouds(category, n, 2 * NOISE) for size, n in SIZES.items()}
        pcs |= common | {"camera_pred": camera + np.array([-0.2, 0.03, 0.02])}
        storage.save_tensors(folder / "pcsiren.safetensors", _float32(pcs | three), record)
        by = {"true": 3 * NOISE, "pred": 4 * NOISE, "corrected": 3.5 * NOISE}
        image = {
            f"{size}.{name}": self._clouds(category, n, noise)
            for size, n in SIZES.items()
            for name, noise in by.items()
        }
        image |= common | {"camera_pred": camera + np.array([0.15, 0.02, 0.02])}
        image["camera_corrected"] = image["camera_pred"] - np.array([0.1, 0, 0])
        storage.save_tensors(folder / "ddf_image.safetensors", _float32(image | three), record)

    def _clouds(self, category, count, noise):
        return np.stack([self._surface(category, shape, count, noise) for shape, _ in self.images(category)])

    def _write_logs(self, category):
        step = np.arange(0, 2001, 50)
        for model, start in (("train_ddf", 3.0), ("train_pcsiren", 2.0), ("train_ddf_image", 1.0)):
            decay = start * np.exp(-step / 600) + 0.2
            wiggle = 1 + 0.05 * self.generator.normal(size=len(step))
            columns = {"step": step, "loss": decay * wiggle, "camera": 0.4 * decay, "seconds": 0.1 * step}
            text = pd.DataFrame(columns).to_csv(index=False)
            storage.write_text(self._folder(model, category) / "log.csv", text)

    def write_config(self, text):
        """The experiment file, whose sections are given as YAML text."""
        storage.write_text(self.root / "configs" / "fake.yaml", text)
        return "configs/fake.yaml"


def _write_note(folder, *names):
    """Of a shard that is done."""
    files = dict.fromkeys(names, "")
    storage.write_json(folder / "000.json", {"fingerprint": "x", "files": files, "failures": []})


def _float32(tensors):
    return {name: np.asarray(value, dtype=np.float32) for name, value in tensors.items()}


EVALUATE_SECTION = json.dumps({"oracle_points": 100, "oracle_shortlist": 3})
