"""Packages of shapes: found, checked, and the members that the manifest names kept in one archive of the user's cache.

A wanted member is the path of a mesh, with which the looks beside it are kept, or a folder of looks, which ends in /.

A kept archive is whole or absent; it is read by the names of its members, so nothing is ever unpacked to a path that a
package chose. With it in place nothing is fetched again.
"""

import csv
import io
import lzma
import os
import re
import shutil
import subprocess
import tarfile
import tempfile
import zipfile
import zlib
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from ddf.core import checks, storage

_NESTED = (".sh3f", ".zip", ".pk3", ".jar")  # members that are archives themselves
_LOOKS = re.compile(r"\.(mtl|png|jpe?g|bmp|tga|gif|rgba?)$", re.IGNORECASE)  # kept from the folders of shapes
_HEADER = 60  # bytes of an entry of an ar archive
_DAMAGED = (tarfile.TarError, zipfile.BadZipFile, lzma.LZMAError, zlib.error, EOFError, ValueError)


@dataclass(frozen=True)
class Package:
    """A pinned package: its file's size in bytes and SHA-256, and the folder inside that paths are relative to."""

    name: str
    version: str
    size: int
    sha256: str
    root: str

    def __str__(self) -> str:
        return f"{self.name} {self.version}"


def _pinned() -> dict[str, Package]:
    """Those of `packages.csv`, by name."""
    lines = csv.DictReader(Path(__file__).with_suffix(".csv").read_text(encoding="utf-8").splitlines())
    return {line["name"]: Package(**{**line, "size": int(line["size"])}) for line in lines}


PACKAGES = _pinned()


def cache() -> Path:
    """The folder of kept archives: `ddf/shapes` in XDG_CACHE_HOME, or in ~/.cache."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "ddf" / "shapes"


def kept(package: Package) -> Path:
    """Where the members of a package are kept."""
    return cache() / f"{package.name}_{package.version.replace(':', '-')}.zip"


def has(package: Package, wanted: Collection[str]) -> bool:
    """Whether these members of a package are kept."""
    if not kept(package).is_file():
        return False
    with reading(kept(package)) as archive:
        return _missing(wanted, archive) is None


def require(package: Package, wanted: Collection[str], folder: Path | None = None) -> Path:
    """The kept archive with these members of a package: as it is, else out of `folder`, else fetched by apt-get.
    InputError says what to put where.
    """
    if not has(package, wanted):
        if folder is not None:
            keep(package, wanted, _file_in(package, folder))
        else:
            loads = cache() / "packages"
            loads.mkdir(parents=True, exist_ok=True)
            file = next(loads.glob(f"{package.name}_*.deb"), None)  # of a run that was killed while it unpacked
            if file is None or not _is_right(package, file):
                file = _fetched(package, loads)
            keep(package, wanted, file)
            file.unlink()
    return kept(package)


def keep(package: Package, wanted: Collection[str], file: Path) -> None:
    """Write the wanted members of a package's file, and the looks beside them, to its archive: all, or nothing.
    InputError where the file is damaged or another one, or a member is not in it.
    """
    if not _is_right(package, file):
        raise checks.InputError(
            f"{file}: damaged, or not {package}: must have {package.size} bytes and SHA-256 {package.sha256}"
        )
    folders = {name.rpartition("/")[0] for name in wanted}
    with storage.atomic_path(kept(package)) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as out:
        try:
            for name, data in _members(file, package.root, folders):
                if name in wanted or (name.rpartition("/")[0] in folders and _LOOKS.search(name)):
                    out.writestr(zipfile.ZipInfo(name), data, zipfile.ZIP_DEFLATED)
        except _DAMAGED as error:
            raise checks.InputError(f"{file}: not a package that can be unpacked ({error})") from error
        missing = _missing(wanted, out)
        if missing:
            raise checks.InputError(f"{file}: has no {missing}")


def _missing(wanted: Collection[str], archive: zipfile.ZipFile) -> str | None:
    """One of the wanted members that an archive lacks."""
    names = set(archive.namelist())
    names |= {f"{name.rpartition('/')[0]}/" for name in names}
    return min(set(wanted) - names, default=None)


def reading(path: Path) -> zipfile.ZipFile:
    """A kept archive, open; a member that was damaged since does not read."""
    try:
        return zipfile.ZipFile(path)
    except zipfile.BadZipFile as error:
        raise checks.InputError(f"{path}: damaged; remove it and call `ddf shapes get`") from error


def _is_right(package: Package, file: Path) -> bool:
    return file.is_file() and file.stat().st_size == package.size and storage.checksum(file) == package.sha256


def _file_in(package: Package, folder: Path) -> Path:
    """The package's file in a folder of the user's: the one of its size, else the one of its name."""
    files = sorted(file for file in folder.glob("*") if file.is_file()) if folder.is_dir() else []
    named = [file for file in files if file.name.startswith(f"{package.name}_") and file.suffix == ".deb"]
    found = [file for file in files if file.stat().st_size == package.size] + named
    if not found:
        raise checks.InputError(f"{folder}: has no file of {package}; {_what_to_put(package)}")
    return found[0]


def _fetched(package: Package, folder: Path) -> Path:
    """The file as apt-get downloads it, which needs no rights and checks its own signatures."""
    require_means([package])
    with tempfile.TemporaryDirectory(dir=folder) as within:
        call = ["apt-get", "download", f"{package.name}={package.version}"]
        done = subprocess.run(call, cwd=within, capture_output=True, text=True, check=False)
        file = next(Path(within).glob("*.deb"), None)
        if done.returncode or file is None:
            said = next((line for line in done.stderr.splitlines() if line.startswith("E:")), "no file came")
            raise checks.InputError(
                f"apt-get could not fetch {package} ({said}); `apt-get update` may help, or {_what_to_put(package)}"
            )
        return file.replace(folder / file.name)


def require_means(lacking: Sequence[Package]) -> None:
    """Raise InputError, which says what to put where, if packages are lacking and there is no apt-get to fetch them."""
    if lacking and shutil.which("apt-get") is None:
        raise checks.InputError(f"no apt-get to fetch what is missing; {_what_to_put(*lacking)}")


def _what_to_put(*lacking: Package) -> str:
    """The files by name; few with what tells whether they are the right ones, which `--from` looks at anyway."""
    files = [f"{each.name}_{each.version.partition(':')[2] or each.version}_all.deb" for each in lacking]
    if len(files) <= 2:
        sums = [f"({each.size} bytes, SHA-256 {each.sha256})" for each in lacking]
        files = [" ".join(both) for both in zip(files, sums, strict=True)]
    return f"put of Debian's archive {', '.join(files)} into a folder and call `ddf shapes get --from FOLDER`"


def _members(file: Path, root: str, folders: Collection[str]) -> Iterator[tuple[str, bytes]]:
    """Names below `root` and contents of the files of a package, those in archives inside it too: `a.zip/b/c`."""
    with file.open("rb") as stream, tarfile.open(fileobj=_data_of(stream), mode="r|*") as archive:
        for entry in archive:
            name = entry.name.removeprefix("./")
            if not entry.isfile() or not name.startswith(f"{root}/"):
                continue
            name = name[len(root) + 1 :]
            opened = archive.extractfile(entry)
            if opened is None:
                continue
            if not name.endswith(_NESTED):
                if name.rpartition("/")[0] in folders:
                    yield name, opened.read()
            elif any(folder.startswith(f"{name}/") for folder in folders):
                with zipfile.ZipFile(io.BytesIO(opened.read())) as inner:
                    for path in inner.namelist():
                        if f"{name}/{path}".rpartition("/")[0] in folders and not path.endswith("/"):
                            yield f"{name}/{path}", inner.read(path)


def _data_of(stream: IO[bytes]) -> IO[bytes]:
    """The member data.tar of a package, which is an ar archive, as a stream."""
    if stream.read(8) != b"!<arch>\n":
        raise ValueError("no ar archive")
    while header := stream.read(_HEADER):
        name, size = header[:16].strip().rstrip(b"/").decode("ascii", "replace"), int(header[48:58])
        if name.startswith("data.tar"):
            if name.endswith(".zst"):
                raise ValueError("its data is packed by zstd, which is not read")
            return stream  # tar ends by itself, before whatever follows
        stream.seek(size + size % 2, os.SEEK_CUR)
    raise ValueError("it has no data.tar")
