"""Files written whole or not at all."""

from __future__ import annotations

import contextlib
import os
import secrets
import stat
from pathlib import Path

from dnacheck.numerics.outcome import InputError


def atomic_write(path: str | os.PathLike[str], content: bytes | str) -> None:
    """Write a file so that a reader sees the old content or the new, never a part.

    The content goes to a new file in the same directory, reaches the disk, and takes the name of
    the old one. A symbolic link keeps pointing where it did; an existing file keeps its
    permissions; a device or a pipe, such as ``/dev/stdout``, is written directly.

    Parameters
    ----------
    path : path
        Where to write; its directory must exist.
    content : bytes or str
        Text is written as UTF-8 with its line ends unchanged.

    Raises
    ------
    InputError
        The file cannot be written there; names the path and the reason.
    """
    data = content.encode() if isinstance(content, str) else content
    try:
        _write(Path(os.path.realpath(path)), data)
    except BrokenPipeError:
        raise
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(
            f"cannot write {os.fspath(path)!r}: {reason}; name a file in a writable directory"
        ) from error


def _write(target: Path, data: bytes) -> None:
    try:
        mode: int | None = target.stat().st_mode
    except FileNotFoundError:
        mode = None
    if mode is not None and not stat.S_ISREG(mode):
        target.write_bytes(data)
        return
    scratch = target.with_name(f".{secrets.token_hex(8)}.part")
    # 0o666 lets the umask decide, as for any file that a program creates.
    handle = os.open(scratch, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        if mode is not None:
            scratch.chmod(stat.S_IMODE(mode))
        scratch.replace(target)
    except BaseException:
        with contextlib.suppress(OSError):
            scratch.unlink()
        raise
