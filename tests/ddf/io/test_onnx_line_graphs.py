"""The model with image features as two ONNX files: what onnxruntime gives is what the field of the image gives."""

import _models
import numpy as np
import torch
from _support import assert_close

from ddf.io import onnx_file, onnx_graphs, onnx_parity
from ddf.models import line_field


def test_files_give_what_the_field_of_the_image_gives(tmp_path):
    folder, sessions = _models.write_model(tmp_path / "chair", "ddf_image"), {}
    graphs, source = onnx_file.load_graphs(folder, None)
    assert list(graphs) == ["rays", "encode"] and source["config"]["kind"] == line_field.KIND
    for name, graph in graphs.items():
        rows = onnx_file.export(
            graph, name, tmp_path / "graph.onnx", source, onnx_file.ExportConfig(batches=(1, 7, 500))
        )
        assert {row.output for row in rows} == set(graph.meanings)
        sessions[name] = onnx_parity.session((tmp_path / "graph.onnx").read_bytes())
    model = line_field.load(folder).network
    image = onnx_graphs.example_images(1, 32, torch.Generator().manual_seed(5))
    with torch.no_grad():
        views = model.views(image, model.camera_head(model.camera_encoder(image)))
    names = ("features", "context", "opaque", "camera")
    encoded = onnx_parity.run(sessions["encode"], {"images": image}, names)
    for name, part in zip(names, (views.features, views.context, views.opaque, views.cameras), strict=True):
        assert_close(encoded[name], part[:, 0], atol=1e-5, rtol=1e-5)
    positions, directions = _models.points(400)
    inputs = {"image": image, **{name: torch.from_numpy(part) for name, part in encoded.items()}}
    inputs |= {"positions": positions, "directions": directions}
    found = onnx_parity.run(sessions["rays"], inputs, ("visibility", "depth"))
    field = line_field.ImageField.of(model.decoder, views)
    expected = field.evaluate(positions.numpy(), directions.numpy(), ("visibility", "depth"))
    assert 0.05 < (expected["visibility"] > 0.5).mean() < 0.95
    for name, values in found.items():
        assert np.quantile(np.abs(values - expected[name]), 0.99) < 1e-4  # a ray may pass between two pixels
