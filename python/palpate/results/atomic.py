"""Files that are complete or absent: written under a temporary name, then renamed."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A temporary path beside ``path`` to write to; renamed to it on success, else removed."""
    target = Path(path)
    with naming(target):
        handle, name = tempfile.mkstemp(
            dir=target.parent, prefix=f".{target.stem}-", suffix=target.suffix
        )
        os.close(handle)
        temporary = Path(name)
        try:
            # mkstemp makes files that only the owner can read; results are for everyone.
            temporary.chmod(0o666 & ~_umask())
            yield temporary
            temporary.replace(target)
        finally:
            with suppress(FileNotFoundError):
                temporary.unlink()


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Errors of the file system name ``path``, not a temporary file or none."""
    try:
        yield
    except OSError as error:
        if error.errno is None:  # numpy's, of arrays that it could not write to the end
            reason = f"not written to its end, is the disk full? ({error})"
            raise OSError(errno.EIO, reason, str(path)) from None
        raise OSError(error.errno, error.strerror, str(path)) from None


def remove_leftovers(folder: Path, pattern: str) -> None:
    """Remove what a process that was killed left of files of these names."""
    stem, suffix = Path(pattern).stem, Path(pattern).suffix
    for old in folder.glob(f".{stem}-????????{suffix}"):
        old.unlink(missing_ok=True)


def write_bytes(path: str | os.PathLike[str], content: bytes) -> None:
    """Write a whole file, complete or absent."""
    with replacing(path) as temporary:
        temporary.write_bytes(content)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
