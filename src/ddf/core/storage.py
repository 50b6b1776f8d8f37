"""Files that are whole or absent: atomic writing, a checksum inside every file, and the record of what made it.

- Arrays: safetensors. One metadata entry, `ddf`, holds JSON: the caller's metadata, format version, package versions
  and a SHA-256 over names, types, shapes, contents and that metadata.
- Tables: CSV, with the same record beside it in `<name>.json`.
Equal input gives equal bytes. No pickle anywhere.
"""

import collections
import contextlib
import csv
import hashlib
import importlib.metadata
import io
import json
import math
import os
import re
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ddf.core import arrays, checks

if TYPE_CHECKING:
    import pandas as pd
    import safetensors

FORMAT_VERSION = 1
RECORDS = "[0-9]*.json"  # pattern of the notes that tell which shards of a folder are done, see `parallel`
# Packages whose version can change the numbers in an artefact.
RECORDED_PACKAGES = ("numba", "numpy", "open3d", "pymeshlab", "torch", "torchvision")
_LARGEST_RECORD = 16 << 20  # characters


_READ: dict[tuple[int, int], Path] = {}  # files that this process reads and must not replace, by device and number


def protect(paths: Iterable[Path]) -> None:
    """Let nothing here replace these files, under whatever name; in place of those of an earlier call."""
    _READ.clear()
    _READ.update({(path.stat().st_dev, path.stat().st_ino): path for path in paths})


def require_not_read(path: Path) -> None:
    """Raise where a file to write is one that is read."""
    if path.exists() and (source := _READ.get((path.stat().st_dev, path.stat().st_ino))):
        raise checks.InputError(f"{source} is read and would be replaced by the output; give another name to write")


@contextlib.contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """A temporary sibling of `path`, flushed to disk and renamed to it if the body succeeds, removed if it fails.

    A link is followed; devices and folders are refused, because renaming would put a file in place of /dev/null. An
    error of the disk names `path`.
    """
    given, path = path, Path(os.path.realpath(path))
    if path.exists() and not path.is_file():
        raise checks.InputError(f"{path} is not a regular file; give the name of a file to write")
    require_not_read(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=f".tmp{path.suffix}", dir=path.parent)
    os.close(handle)
    temporary = Path(name)
    try:
        with naming(given):
            yield temporary
            # mkstemp makes private files; give the file what open() would have given it.
            mask = os.umask(0)
            os.umask(mask)
            temporary.chmod(0o666 & ~mask)
            with temporary.open("rb+") as file:
                os.fsync(file.fileno())
            temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


@contextlib.contextmanager
def naming(path: str | Path) -> Iterator[None]:
    """Give `path` as the file's name to an error of the operating system that has none: `write` says no more than
    that the disk is full.
    """
    try:
        yield
    except OSError as error:
        if error.errno is not None and error.filename is None:
            error.filename = str(path)
        raise


def write_bytes(path: str | Path, data: bytes) -> None:
    """`data` under its final name at once."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(data)


def write_text(path: str | Path, text: str) -> None:
    """`text` as UTF-8 with its line ends untouched, under its final name at once."""
    write_bytes(path, text.encode("utf-8"))


def write_rows(path: str | Path, rows: Iterable[Iterable[Any]]) -> None:
    """Rows, the first of which names the columns, as CSV with LF."""
    buffer = io.StringIO()
    csv.writer(buffer, lineterminator="\n").writerows(rows)
    write_text(path, buffer.getvalue())


def write_json(path: str | Path, data: Any) -> None:
    """`data` as indented JSON with a final newline; NaN (a mean over nothing) is null, infinity is an error."""
    write_text(path, json.dumps(_null_for_nan(data), indent=2, allow_nan=False) + "\n")


def _null_for_nan(data: Any) -> Any:
    if isinstance(data, Mapping):
        return {key: _null_for_nan(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_null_for_nan(value) for value in data]
    return None if isinstance(data, float) and math.isnan(data) else data


def read_json(path: str | Path) -> Any:
    """The content of a JSON file; InputError names it when it is not JSON, or has a key twice: one would be lost."""
    checks.require_content(path)
    try:
        return json.loads(Path(path).read_text(encoding="utf-8-sig"), object_pairs_hook=_once)
    except (ValueError, RecursionError) as error:
        raise checks.InputError(f"{path}: not valid JSON ({error}); make it anew") from error


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) < len(pairs):
        ((twice, _),) = collections.Counter(key for key, _ in pairs).most_common(1)
        raise ValueError(f"{twice!r} is given twice")
    return content


def save_tensors(path: str | Path, tensors: Mapping[str, Any], metadata: Mapping[str, Any]) -> None:
    """Arrays and their record as one safetensors file.

    Args:
      tensors: name to array or torch tensor; types are kept (bfloat16 is not supported, because NumPy has none).
      metadata: anything JSON can hold; by convention `fingerprint`, `seed` and `sources` (path to checksum).
    """
    import safetensors.numpy

    arrays = {name: _as_array(value) for name, value in tensors.items()}
    record = _record(metadata)
    record["checksum"] = _content_checksum(arrays, record)
    with atomic_path(path) as temporary:
        try:  # from the arrays' own memory to the disk
            safetensors.numpy.save_file(arrays, temporary, {"ddf": _dump(record)})
        except safetensors.SafetensorError as error:
            raise _of_the_disk(error) from error


def load_tensors(
    path: str | Path, framework: Literal["numpy", "torch"] = "numpy"
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Arrays and metadata of a file from `save_tensors`, checksum verified; torch tensors are memory-mapped."""
    with _opened(path, "pt" if framework == "torch" else "numpy") as file:
        record = _parsed((file.metadata() or {})["ddf"], path)
        tensors = {name: file.get_tensor(name) for name in file.keys()}
        arrays = {name: _as_array(value) for name, value in tensors.items()}
        if record.pop("checksum") != _content_checksum(arrays, record):
            raise _damaged(path, "its checksum does not fit")
    return tensors, record


def map_tensors(path: str | Path) -> dict[str, np.ndarray]:
    """Arrays of a file from `save_tensors` as views of the mapped file: only what is read of them takes memory, and
    nothing is verified. The map ends with the last view.
    """
    with _opened(path, "pt") as file:
        return {name: file.get_tensor(name).numpy() for name in file.keys()}


def load_metadata(path: str | Path) -> dict[str, Any]:
    """The record of a file from `save_tensors`, without reading its arrays (and so without verifying them)."""
    with _opened(path, "numpy") as file:
        return _parsed((file.metadata() or {})["ddf"], path)


def shapes(path: str | Path) -> dict[str, tuple[int, ...]]:
    """The shapes of the arrays of a file from `save_tensors`, by name, from its head alone."""
    with _opened(path, "numpy") as file:
        return {name: tuple(file.get_slice(name).get_shape()) for name in file.keys()}


@contextlib.contextmanager
def _opened(path: str | Path, framework: str) -> Iterator[Any]:
    """A safetensors file; what is wrong with it while it is read is told as damage.

    The library takes names in UTF-8 alone, so files of other names are opened by their descriptors.
    """
    import safetensors

    path = _existing(path)
    try:
        with path.open("rb") as stream:
            is_odd = any("\ud800" <= letter <= "\udfff" for letter in str(path))
            name = f"/proc/self/fd/{stream.fileno()}" if is_odd else path
            with safetensors.safe_open(name, framework=framework) as file:
                yield file
    except checks.InputError:
        raise
    except (safetensors.SafetensorError, KeyError, ValueError, TypeError) as error:
        raise _damaged(path, error) from error


def _parsed(text: str | bytes, path: str | Path) -> dict[str, Any]:
    """A record, of the version that is read."""
    try:
        record = json.loads(text) if len(text) <= _LARGEST_RECORD else None
    except (ValueError, RecursionError) as error:
        raise _damaged(path, error) from error
    if not isinstance(record, dict):
        raise _damaged(path, "its record is none")
    version = record.get("format_version")
    if version != FORMAT_VERSION:
        raise checks.InputError(
            f"{path}: its format version is {str(version)[:20]}; this version of ddf reads {FORMAT_VERSION}: update ddf"
        )
    return record


def save_table(path: str | Path, table: "pd.DataFrame", metadata: Mapping[str, Any]) -> None:
    """A table as CSV (no index column, shortest digits that give the same floats), its record in `<path>.json`."""
    data = table.to_csv(index=False, lineterminator="\n").encode("utf-8")
    record = _record(metadata)
    record["checksum"] = hashlib.sha256(data).hexdigest()
    write_bytes(path, data)
    write_json(_table_record(path), record)


def load_table(path: str | Path, **options: Any) -> tuple["pd.DataFrame", dict[str, Any]]:
    """Table and metadata of a file from `save_table`, checksum verified; `options` go to pandas.read_csv."""
    import pandas as pd

    path = _existing(path)
    data = path.read_bytes()
    record = read_json(_existing(_table_record(path)))
    if not isinstance(record, dict) or record.pop("checksum", None) != hashlib.sha256(data).hexdigest():
        raise _damaged(path, f"its checksum in {_table_record(path).name} does not fit")
    return pd.read_csv(io.BytesIO(data), **options), record


def shard_files(folder: str | Path, suffix: str, stage: str) -> list[Path]:
    """The files of one kind that the shards of a folder wrote, in order, as their notes `NNN.json` name them;
    FileNotFoundError, where there are none, names `stage`, which makes them.
    """
    folder = Path(folder)
    records = sorted(folder.glob(RECORDS))
    names = sorted(name for record in records for name in read_json(record)["files"] if name.endswith(suffix))
    if not names:
        raise FileNotFoundError(f"{folder}: no shards with *{suffix}; run the {stage} stage")
    return [folder / name for name in names]


def checksum(path: str | Path, of_file: Callable[[Path], str] | None = None) -> str:
    """SHA-256 of a file, or of a folder: of its files' relative names and checksums in sorted order.

    Args:
      of_file: tells the checksum of a file, where one is known without reading it.
    """
    path = _existing(path)
    if path.is_dir():
        digest = hashlib.sha256()
        for file in sorted(entry for entry in path.rglob("*") if entry.is_file()):
            digest.update(f"{file.relative_to(path).as_posix()}\0{(of_file or checksum)(file)}\n".encode())
        return digest.hexdigest()
    if of_file is not None:
        return of_file(path)
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def package_versions() -> dict[str, str]:
    """Versions of the installed packages that can change the numbers in an artefact."""
    versions = {name: version_of(name) for name in RECORDED_PACKAGES}
    return {name: version for name, version in versions.items() if version is not None}


def version_of(package: str) -> str | None:
    """The installed version, None where it is not there; Open3D's package for CPUs holds the same module."""
    for distribution in (package, f"{package}-cpu"):
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            return importlib.metadata.version(distribution)
    return None


def _record(metadata: Mapping[str, Any]) -> dict[str, Any]:
    return {"format_version": FORMAT_VERSION, "packages": package_versions(), **metadata}


def _dump(record: Mapping[str, Any]) -> str:
    return json.dumps(record, sort_keys=True, separators=(",", ":"), allow_nan=False)


def _as_array(value: Any) -> np.ndarray:
    array = arrays.to_numpy(value)
    return array if array.flags.c_contiguous else np.ascontiguousarray(array)


def _content_checksum(arrays: Mapping[str, np.ndarray], record: Mapping[str, Any]) -> str:
    digest = hashlib.sha256(_dump(record).encode())
    for name in sorted(arrays):
        array = arrays[name]
        digest.update(f"\n{name} {array.dtype.str} {array.shape}\n".encode())
        digest.update(array.reshape(-1).view(np.uint8).data)
    return digest.hexdigest()


def _of_the_disk(error: "safetensors.SafetensorError") -> Exception:
    """The operating system's error that safetensors wrapped into its own, which tells it in words; else the same."""
    number = re.search(r"\(os error (\d+)\)", str(error))
    return error if number is None else OSError(int(number[1]), os.strerror(int(number[1])))


def _table_record(path: str | Path) -> Path:
    return Path(f"{path}.json")


def _existing(path: str | Path) -> Path:
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"{path} does not exist; run the stage that makes it (`make help` lists the stages)")
    if path.is_file():
        checks.require_content(path)
    return path


def _damaged(path: str | Path, reason: object) -> checks.InputError:
    text = " ".join(str(reason).split()) or type(reason).__name__
    return checks.InputError(f"{path} is damaged or not one of our files ({text}); fetch it again or make it anew")
