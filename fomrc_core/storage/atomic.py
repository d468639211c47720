"""Bytes in and out of files: reading is bounded, writing is whole or not at all."""

from __future__ import annotations

import gzip
import os
import secrets
import zlib
from collections.abc import Iterator
from pathlib import Path

from fomrc_core.errors import StorageError

_GZIP_MAGIC = b"\x1f\x8b"
_UTF16_MARKS = (b"\xff\xfe", b"\xfe\xff")
_CONTROL = bytes(k for k in range(32) if k not in b"\t\n\f\r")


def read_bytes(path: str | os.PathLike[str], *, n_bytes_max: int) -> bytes:
    """Read a file whole, unpacking gzip wherever the content says so.

    Args:
        path: file to read.
        n_bytes_max: most bytes accepted, counted after unpacking, so that a small archive cannot fill memory.

    Raises:
        StorageError: no such file, a folder, a pipe or device, unreadable, too large, or damaged gzip.
    """
    where = os.fspath(path)
    if os.path.isdir(where):
        raise StorageError("is a folder", where=where, allowed="a file")
    # A pipe nobody writes to would be waited for without end, and a device has no end.
    if is_pipe_or_device(where):
        raise StorageError("is a pipe or a device", where=where, allowed="a file")
    try:
        with open(where, "rb") as file:
            content = file.read(n_bytes_max + 1)
            if content.startswith(_GZIP_MAGIC):
                file.seek(0)
                content = gzip.GzipFile(fileobj=file).read(n_bytes_max + 1)
    except FileNotFoundError:
        raise StorageError("no such file", where=where) from None
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise StorageError(f"damaged gzip file ({error})", where=where) from None
    except OSError as error:
        raise StorageError(f"cannot be read ({error.strerror or error})", where=where) from None
    if len(content) > n_bytes_max:
        raise StorageError("file too large", where=where, allowed=f"at most {n_bytes_max} bytes, unpacked")
    return content


def read_text(path: str | os.PathLike[str], *, n_bytes_max: int) -> str:
    """Read a text file in UTF-8, with or without a byte-order mark; see :func:`read_bytes`."""
    content = read_bytes(path, n_bytes_max=n_bytes_max)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise StorageError(
            f"not a text file (byte {error.start} is not UTF-8)", where=os.fspath(path), allowed="UTF-8 text"
        ) from None
    if "\0" in text:
        raise StorageError("not a text file (zero bytes)", where=os.fspath(path), allowed="UTF-8 text")
    return text


def read_table_text(path: str | os.PathLike[str], *, n_bytes_max: int) -> str:
    """Read a text as programs write it: UTF-8, UTF-16 with its mark, or Windows-1252; see :func:`read_bytes`."""
    content = read_bytes(path, n_bytes_max=n_bytes_max)
    encoding = "utf-16" if content.startswith(_UTF16_MARKS) else "utf-8-sig"
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError as error:
        # One byte a letter, as Windows writes it where it does not write UTF-8; no text holds control characters.
        if encoding == "utf-16" or content.translate(None, _CONTROL) != content:
            raise StorageError(
                f"not a text file (byte {error.start} is not {encoding.removesuffix('-sig').upper()})",
                where=os.fspath(path),
                allowed="UTF-8, UTF-16 or Windows-1252 text",
            ) from None
        text = content.decode("cp1252", errors="replace")
    if "\0" in text:
        raise StorageError("not a text file (zero bytes)", where=os.fspath(path), allowed="UTF-8 text")
    return text


def text_blocks(path: str | os.PathLike[str], n_characters: int) -> Iterator[str]:
    """Yield a text file, unpacked where it is gzip, in blocks of whole lines.

    Args:
        path: file to read.
        n_characters: of a block, up to the end of a line.

    Raises:
        OSError: what the system says; nothing is told in its own words here.
        ValueError: not text in UTF-8.
    """
    with open(path, "rb") as file:
        is_packed = file.read(2) == _GZIP_MAGIC
    with gzip.open(path, "rt", encoding="utf-8-sig") if is_packed else open(path, encoding="utf-8-sig") as text:
        while block := text.read(n_characters):
            yield block + text.readline()


def make_directory(path: Path, *, where: str = "--output") -> Path:
    """Make a folder for results, and those it stands in.

    Args:
        path: the folder; may be there already.
        where: the option or field that names it, for the message.

    Raises:
        StorageError: it cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = error.strerror or str(error)
        raise StorageError(f"folder cannot be made ({reason})", where=where, value=str(path)) from None
    return path


def is_pipe_or_device(path: str | os.PathLike[str]) -> bool:
    """Tell whether a path leads to something that is there but neither a file nor a folder, such as /dev/stdout."""
    return os.path.exists(path) and not os.path.isfile(path) and not os.path.isdir(path)


def target_of(path: str | os.PathLike[str]) -> Path:
    """Return what would be written in the end: a link keeps pointing where it did, what it points to is replaced.

    Raises:
        StorageError: it is a folder, or lies in one that is missing or cannot be written to.
    """
    where = os.fspath(path)
    if is_pipe_or_device(where):
        return Path(where)  # cannot be replaced, and its real path leads nowhere
    target = Path(os.path.realpath(where))
    if target.is_dir():
        raise StorageError("is a folder", where=where, allowed="a file name")
    if not target.parent.is_dir():
        raise StorageError("no such folder", where=str(target.parent), allowed="an existing folder")
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise StorageError("cannot be written (folder is closed to writing)", where=where, allowed="an open folder")
    return target


def write_bytes(content: bytes, path: str | os.PathLike[str]) -> None:
    """Write a file so that a reader sees the old content or the new, never a part.

    Raises:
        StorageError: the folder is missing or cannot be written.
    """
    where = os.fspath(path)
    target = target_of(path)
    try:
        if is_pipe_or_device(path):
            target.write_bytes(content)
            return
        temporary = target.with_name(f".{target.name}.{secrets.token_hex(6)}.tmp")
        try:
            with open(temporary, "xb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            os.replace(temporary, target)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise StorageError(f"cannot be written ({error.strerror or error})", where=where) from None


def write_text(text: str, path: str | os.PathLike[str]) -> None:
    """Write a text file whole or not at all, gzip where its name ends in ``.gz``; see :func:`write_bytes`."""
    content = text.encode()
    if os.fspath(path).endswith(".gz"):
        # No time stamp inside: the same content gives the same file.
        content = gzip.compress(content, mtime=0)
    write_bytes(content, path)
