"""The stored corpus: an archive a target, of inputs that together reach all that any reached."""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections.abc import Iterable
from pathlib import Path

#: In the repository: what a run begins with.
CORPUS = Path(__file__).resolve().parent / "corpus"
#: The same inputs are the same bytes, whenever they are stored.
_DATE = (1980, 1, 1, 0, 0, 0)


def archive(name: str) -> Path:
    """Where the inputs of a target are."""
    return CORPUS / f"{name}.zip"


def stored(name: str) -> list[bytes]:
    """The inputs of a target, in the order of their names; none if none are stored."""
    if not archive(name).is_file():
        return []
    with zipfile.ZipFile(archive(name)) as inputs:
        return [inputs.read(one) for one in sorted(inputs.namelist())]


def store(name: str, inputs: Iterable[bytes]) -> None:
    """Replace the inputs of a target."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as packed:
        for key, data in sorted({hashlib.sha1(one).hexdigest(): one for one in inputs}.items()):
            packed.writestr(zipfile.ZipInfo(key, _DATE), data, zipfile.ZIP_DEFLATED)
    CORPUS.mkdir(exist_ok=True)
    archive(name).write_bytes(buffer.getvalue())


def unpack(name: str, folder: Path) -> None:
    """Write the inputs of a target into a folder, a file each, as libFuzzer reads them."""
    for data in stored(name):
        (folder / hashlib.sha1(data).hexdigest()).write_bytes(data)
