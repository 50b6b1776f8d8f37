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
    folder, rows = run.folder("train_ddf"), []
    graphs, source = onnx_file.load_graphs(folder, section.outputs)
    for name, graph in graphs.items():
        rows += onnx_file.export(graph, name, out_dir / f"{name}.onnx", source, section)
    table = pd.DataFrame(rows)
    table.insert(0, "category", run.category)
    record = provenance.record([section], 0, [folder / model_files.MODEL], onnx_file)
    storage.save_table(out_dir / "onnx_parity.csv", table, record)
