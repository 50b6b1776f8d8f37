"""Notes of what was made from what. "Is it done?" is asked in these places, and every answer is a fingerprint.

- DVC (dvc.lock): did a file or section that a stage names change? Cheap; it knows folders, not what is used of them.
- `ddf_lab.engine.finished`: does that change matter to the stage? A `Note` of its outputs decides.
- `core.parallel`: is this shard there? A `Note` for each, so that a lost process costs its own shards alone.
- `Portions`: is this portion of a long loop there? A `Note` for each; they go when the whole is written.
- `training_loop`: which step is next? The checkpoint, which is no whole thing and so has no note.
- `fit.fitting` (plan.json): is this the fit that the folder holds, and is its budget spent? Fits run outside of stages,
  and a clock cannot be read off the files.
"""

import contextlib
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ddf.core import storage

if TYPE_CHECKING:
    from torch import Tensor

SUFFIX = ".part.safetensors"


@dataclass(frozen=True)
class Note:
    """A JSON file, written last, that says what the files beside it are made from.

    fingerprint: of all that they depend on.
    """

    path: Path
    fingerprint: str

    def fits(self) -> bool:
        """Whether it is there with this fingerprint, and every file and folder that it names is as it was left."""
        with contextlib.suppress(OSError, ValueError, KeyError, TypeError, AttributeError):
            noted, folder = storage.read_json(self.path), self.path.parent
            if noted["fingerprint"] == self.fingerprint:
                return all(storage.checksum(folder / name) == sha for name, sha in noted["files"].items())
        return False

    def write(self, files: Iterable[str | Path], **told: Any) -> None:
        """Note these files and folders, and whatever else is `told`."""
        names = {Path(os.path.relpath(file, self.path.parent)).as_posix(): file for file in files}
        sums = {name: storage.checksum(file) for name, file in names.items()}
        storage.write_json(self.path, {"fingerprint": self.fingerprint, "files": sums, **told})


@dataclass(frozen=True)
class Portions:
    """A folder of portions of long work. fingerprint: of all that they depend on but their rows."""

    folder: Path
    fingerprint: str

    def get(self, name: str, rows: Sequence[int], make: Callable[[], "dict[str, Tensor]"]) -> "dict[str, Tensor]":
        """What `make` gives for these rows: read if it is there, written if not; on the CPU.

        Args:
          name: of the step, for its files. rows: not empty; no two portions of a step begin with the same.
        """
        path = self.folder / f"{name}.{rows[0]:06d}{SUFFIX}"
        note = Note(path.with_suffix(".json"), f"{self.fingerprint} {[*rows]}")
        if not note.fits():
            storage.save_tensors(path, make(), {})
            note.write([path])
        return storage.load_tensors(path, "torch")[0]

    def clear(self) -> None:
        """Remove all portions, those of other fingerprints too."""
        for path in self.folder.glob("*.part.*"):
            path.unlink()
