"""Export the trained models of one category as ONNX files, each compared with its model before it is written."""

import pandas as pd

from ddf.core import provenance, storage
from ddf.fields import model_files
from ddf.io import onnx_file
from ddf_lab.engine import stage
from ddf_lab.run import Run


@stage.main(category=True)
def make(run: Run) -> None:
    section = onnx_file.ExportConfig()
    out_dir = run.folder("export_onnx")
    sources, rows = [], []
    for model in ("ddf", "ddf_image"):
        folder = run.folder(f"train_{model}")
        graphs, source = onnx_file.load_graphs(folder, section.outputs)
        sources.append(folder / model_files.MODEL)
        for name, graph in graphs.items():
            rows += onnx_file.export(graph, name, out_dir / f"{name}.onnx", source, section)
    table = pd.DataFrame(rows)
    table.insert(0, "category", run.category)
    record = provenance.record([section], 0, sources, onnx_file)
    storage.save_table(out_dir / "onnx_parity.csv", table, record)
