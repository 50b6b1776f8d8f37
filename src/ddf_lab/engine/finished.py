"""Whether a stage's outputs are those that it would make now: the one place that decides it.

DVC notices that something changed: a file of a package, a config section, data. What the stage really uses is told by a
fingerprint: its config sections, its data, and the syntax trees of its script and of every module that the script
reaches outside this room. A finished stage notes it with the checksums of its outputs (`ddf.core.notes`).
"""

import hashlib
import json
from pathlib import Path
from typing import Any

from ddf.core import config, notes, provenance, storage
from ddf_lab.engine import experiments, graph
from ddf_lab.run import Run, class_of, time_path

FRAME = "ddf_lab/engine"  # the room around the stages: no result depends on it


def find(stage: str, run: Run) -> graph.Item | None:
    """The item of a stage that runs in the repository; None elsewhere, and for any other script."""
    entry = graph.load().get(stage) if graph.PIPELINE.is_file() else None
    if entry is None:
        return None
    return graph.make_item(stage, entry["do"], "", experiments.item(run.file, run.category, run.seed))


def note(item: graph.Item) -> notes.Note:
    """Of the item's last run, as it would be written now; beside it stand time and memory."""
    content = {
        "config": [_settings(file, names) for file, names in item.sections.items()],
        "data": [storage.checksum(path) if Path(path).exists() else None for path in item.data],
        "code": provenance.script_version(item.script, without=FRAME),
    }
    fingerprint = hashlib.sha256(json.dumps(content, sort_keys=True, default=str).encode()).hexdigest()
    return notes.Note(time_path(item.experiment, item.stage, item.category, item.seed), fingerprint)


def _settings(file: str, names: tuple[str, ...]) -> dict[str, Any]:
    """What sections of an experiment say, whoever said it: its file, one below it, or a default."""
    given = Run.read(file)
    return {name: config.plain(given.section(class_of(name))) for name in names}
