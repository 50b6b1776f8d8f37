"""Notes of what was made from what. "Is it done?" is asked in these places, and every answer is a fingerprint.

- `ddf_lab.engine.stage`: has this stage anything to do? A `Note` of its outputs decides.
- `core.parallel`: is this shard there? A `Note` for each, so that a lost process costs its own shards alone.
- `training_loop`: which step is next? The checkpoint, which is no whole thing and so has no note.
- `fit.fitting` (plan.json): is this the fit that the folder holds, and is its budget spent? Fits run outside of stages,
  and a clock cannot be read off the files.
"""

import contextlib
import json
import os
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ddf.core import storage

Checksum = Callable[[str | Path], str]  # of a file or a folder


class Checksums:
    """Checksums of files, kept from run to run in a JSON file with the size, times and number that each file had.

    A file is read again where one of these differs, or where it was so young that another change might not show.
    """

    YOUNG = 2 * 10**9  # nanoseconds

    def __init__(self, path: Path) -> None:
        self._path, self._known, self._new = path, dict[str, Any](), dict[str, Any]()
        with contextlib.suppress(OSError, ValueError):
            found = storage.read_json(path)
            self._known = found if isinstance(found, dict) else {}

    def __call__(self, path: str | Path) -> str:
        """As `storage.checksum`."""
        return storage.checksum(path, self._of_file)

    def _of_file(self, path: Path) -> str:
        found = path.stat()
        seen = [found.st_size, found.st_mtime_ns, found.st_ctime_ns, found.st_ino]
        known = self._known.get(path.as_posix())
        if isinstance(known, list) and known[1:] == seen:
            return known[0]
        told = storage.checksum(path)
        if time.time_ns() - max(seen[1:3]) > self.YOUNG:
            self._known[path.as_posix()] = self._new[path.as_posix()] = [told, *seen]
        return told

    def write(self) -> None:
        """Keep what was read, beside what other processes have kept meanwhile."""
        if self._new:
            storage.write_text(self._path, json.dumps(Checksums(self._path)._known | self._new))


@dataclass(frozen=True)
class Note:
    """A JSON file, written last, that says what the files beside it are made from.

    fingerprint: of all that they depend on. checksum: how the contents of files are told.
    """

    path: Path
    fingerprint: str
    checksum: Checksum = storage.checksum

    def fits(self) -> bool:
        """Whether it is there with this fingerprint, and every file and folder that it names is as it was left."""
        with contextlib.suppress(OSError, ValueError, KeyError, TypeError, AttributeError):
            noted, folder = storage.read_json(self.path), self.path.parent
            if noted["fingerprint"] == self.fingerprint:
                return all(self.checksum(folder / name) == sha for name, sha in noted["files"].items())
        return False

    def write(self, files: Iterable[str | Path], **told: Any) -> None:
        """Note these files and folders, and whatever else is `told`."""
        names = {Path(os.path.relpath(file, self.path.parent)).as_posix(): file for file in files}
        sums = {name: self.checksum(file) for name, file in names.items()}
        storage.write_json(self.path, {"fingerprint": self.fingerprint, "files": sums, **told})
