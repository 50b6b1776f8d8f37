"""Work on many images in portions that are kept in a folder until all is done: a run that was killed goes on."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from torch import Tensor

from ddf.core import checks, storage

SUFFIX = ".part.safetensors"


@dataclass(frozen=True)
class Kept:
    """A folder of portions. fingerprint: of all that they depend on but their rows; those of another are not used."""

    folder: Path
    fingerprint: str

    def get(self, name: str, rows: Sequence[int], make: Callable[[], dict[str, Tensor]]) -> dict[str, Tensor]:
        """What `make` gives for these rows: read if it is there, written if not; on the CPU.

        Args:
          name: of the step, for its files. rows: not empty; no two portions of a step begin with the same.
        """
        path, wanted = self.folder / f"{name}.{rows[0]:06d}{SUFFIX}", {"fingerprint": self.fingerprint, "rows": [*rows]}
        found = _read(path, wanted)
        if found is None:
            storage.save_tensors(path, make(), wanted)
            found = storage.load_tensors(path, "torch")[0]
        return found

    def clear(self) -> None:
        """Remove all portions, those of other fingerprints too."""
        for path in self.folder.glob(f"*{SUFFIX}"):
            path.unlink()


def _read(path: Path, wanted: dict[str, Any]) -> dict[str, Tensor] | None:
    """The tensors of a file, if it is there and whole and its record has all of this."""
    if not path.exists():
        return None
    try:
        tensors, record = storage.load_tensors(path, "torch")
    except checks.InputError:  # damaged
        return None
    return tensors if wanted.items() <= record.items() else None
