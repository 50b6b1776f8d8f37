"""Which script is which stage of an experiment, and where a stage notes the time and memory of its last run."""

from pathlib import Path

SCRIPTS = {  # by stage, in the order of the pipeline; without those beside it (export_onnx) and the report itself
    "dataset": "make_dataset",
    "meshes": "prepare_meshes",
    "samples": "extract_samples",
    "train_ddf": "train_ddf",
    "train_pcsiren": "train_pcsiren",
    "pointclouds": "make_pointclouds",
    "evaluate": "evaluate_clouds",
}
WHOLE = ("dataset", "evaluate")  # these run once, all others for each category


def time_path(config_path: Path, script: str, category: str | None = None, seed: int = 0) -> Path:
    """Where a stage notes time and memory of its last run, for the report; not an artefact: they differ each time."""
    name = "-".join([script, *([category] if category else []), *([str(seed)] if seed else [])])
    return Path("artifacts") / Path(config_path).stem / "times" / f"{name}.json"
