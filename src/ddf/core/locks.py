"""Locks on files: the kernel's, which go with the process that holds them, however it ends."""

import contextlib
import errno
import fcntl
import os
import sys
from collections.abc import Iterator
from pathlib import Path

_NO_LOCKS = (errno.ENOLCK, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS)


@contextlib.contextmanager
def held(path: Path, busy: str, wait: bool = True) -> Iterator[int]:
    """Hold the lock of a file, made if needed; gives its descriptor, for child processes to inherit.

    Args:
      busy: said where another process holds it, `{number}` standing for that process. wait: until it ends; else refuse.
    Raises:
      InputError: the file system has no locks, or another process holds it and `wait` is not set.
    """
    from ddf.core import checks  # takes numpy, which bare help does without

    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a+", encoding="utf-8") as file:
        try:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                file.seek(0)
                said = busy.format(number=file.read().strip() or "unknown")
                if not wait:
                    raise checks.InputError(said) from None
                sys.stderr.write(f"{said}; waiting for it to end\n")
                sys.stderr.flush()
                fcntl.flock(file, fcntl.LOCK_EX)
        except OSError as error:
            if error.errno not in _NO_LOCKS:
                raise
            raise checks.InputError(
                f"{path}: its file system has no locks ({error.strerror}), so two runs could mix their files; work "
                "in a folder on a local disk, or have it mounted with locks (NFS: lockd; Lustre: -o flock)"
            ) from error
        file.truncate(0)
        file.write(f"{os.getpid()}\n")
        file.flush()
        try:
            yield file.fileno()
        finally:
            file.truncate(0)
