"""Export both trained models of one category as ONNX files, each compared with its model before it is written."""

from pathlib import Path

import pandas as pd

from ddf.core import config, provenance, storage
from ddf.io import exportable, onnx_file
from ddf.training import training_loop
from ddf_lab.engine import stage


def run(config_path: Path, category: str) -> None:
    """Write one file per graph and onnx_parity.csv, which also says what smaller weights would cost."""
    section = config.load(config_path, onnx_file.ExportConfig)
    out_dir = config.artifact_dir(config_path, "export_onnx", category)
    sources, rows = [], []
    for model in ("ddf", "pcsiren"):
        folder = config.artifact_dir(config_path, f"train_{model}", category)
        graphs, source = exportable.load(folder, section.outputs)
        sources.append(folder / training_loop.MODEL)
        for name, graph in graphs.items():
            out = out_dir / f"{name}.onnx"
            rows += onnx_file.export(graph, name, out, source, section)
            rows += onnx_file.measure_precisions(graph, name, out.read_bytes(), section)
    table = pd.DataFrame([row.to_dict() for row in rows])
    table.insert(0, "category", category)
    record = provenance.record(provenance.fingerprint([section], sources, exportable), section.seed, sources)
    storage.save_table(out_dir / "onnx_parity.csv", table, record)


if __name__ == "__main__":
    stage.main(run, __doc__, category=True)
