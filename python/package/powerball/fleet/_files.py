"""Files of a store, in a folder or wherever fsspec reaches: whole or not at all."""

from __future__ import annotations

import hashlib
import os
import uuid
from typing import List

import fsspec


def key_of(*parts: str) -> str:
    """A name for what these parts determine: 32 hexadecimal digits."""
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:32]


def write(path: str, data: bytes) -> None:
    """Writes a file whole or not at all: object stores do so by themselves."""
    fs, name = fsspec.url_to_fs(path)
    local = "file" in fs.protocol
    part = f"{name}.{uuid.uuid4().hex}.tmp" if local else name
    fs.makedirs(os.path.dirname(name), exist_ok=True)
    fs.pipe_file(part, data)
    if local:
        os.replace(part, name)


def read(path: str) -> bytes:
    """The bytes of a file."""
    fs, name = fsspec.url_to_fs(path)
    data: bytes = fs.cat_file(name)
    return data


def exists(path: str) -> bool:
    """Whether a file is there."""
    fs, name = fsspec.url_to_fs(path)
    return bool(fs.exists(name))


def remove(path: str) -> None:
    """Removes a file."""
    fs, name = fsspec.url_to_fs(path)
    fs.rm_file(name)


def names(folder: str, suffix: str) -> List[str]:
    """The names of a folder's files that end so, sorted; none where there is no such folder."""
    fs, name = fsspec.url_to_fs(folder)
    # Others write into it too.
    fs.invalidate_cache(name)
    if not fs.exists(name):
        return []
    found = (os.path.basename(path) for path in fs.ls(name, detail=False))
    return sorted(path for path in found if path.endswith(suffix))
