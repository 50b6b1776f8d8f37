"""Whether a stage's outputs are those that it would make now: the one place that decides it.

DVC notices that something changed: a file of a package, a config section, data. What the stage really uses is told by a
fingerprint: its config sections, its data, and the syntax trees of its script and of every module that the script
reaches outside this room. A finished stage notes it together with the checksums of its outputs.
"""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ddf.core import config, provenance, storage
from ddf_lab.engine import experiments, graph
from ddf_lab.run import Run

FRAME = "ddf_lab/engine"  # the room around the stages: no result depends on it


def find(stage: str, run: Run) -> graph.Item | None:
    """The item of a stage that runs in the repository; None elsewhere, and for any other script."""
    entry = graph.load().get(stage) if graph.PIPELINE.is_file() else None
    if entry is None:
        return None
    return graph.make_item(stage, entry["do"], "", experiments.item(run.file, run.category, run.seed))


def read(path: Path) -> dict[str, Any]:
    """The note of a stage's last run; empty where there is none, or none that can be read."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def note(item: graph.Item) -> dict[str, Any]:
    """What a stage writes down when it has finished."""
    return {"fingerprint": fingerprint(item), "outputs": {out: storage.checksum(out) for out in item.outs}}


def is_done(item: graph.Item, noted: Mapping[str, Any]) -> bool:
    """Whether the note of the last run fits: the same fingerprint, and outputs as they were left."""
    try:
        outputs = {out: storage.checksum(out) for out in item.outs}
        return noted.get("outputs") == outputs and noted.get("fingerprint") == fingerprint(item)
    except FileNotFoundError:
        return False


def fingerprint(item: graph.Item) -> str:
    """Hex digest over config sections, data and code that an item uses."""
    content = {
        "config": [{name: config.read(file)[name] for name in names} for file, names in item.sections.items()],
        "data": [storage.checksum(path) for path in item.data],
        "code": provenance.script_version(item.script, without=FRAME),
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True, default=str).encode()).hexdigest()
