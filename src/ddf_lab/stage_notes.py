"""The stages of an experiment, and where each notes the time and memory of its last run, and what it made of what."""

import json
from pathlib import Path
from typing import Any

# In the order of the pipeline; without those beside it (export_onnx) and the report itself.
STAGES = ("dataset", "meshes", "samples", "train_ddf", "train_pcsiren", "pointclouds", "evaluate")
WHOLE = ("dataset", "evaluate")  # these run once, all others for each category


def time_path(config_path: Path, stage: str, category: str | None = None, seed: int = 0) -> Path:
    """Where a stage notes time and memory of its last run, for the report; not an artefact: they differ each time."""
    name = "-".join([stage, *([category] if category else []), *([str(seed)] if seed else [])])
    return Path("artifacts") / Path(config_path).stem / "times" / f"{name}.json"


def read(path: Path) -> dict[str, Any]:
    """A note; empty where there is none, or none that can be read."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}
