"""The outer structure of a Matroska file, and the check sums that it carries itself.

Matroska (RFC 9559) is EBML (RFC 8794): elements of id, size and content.  FFmpeg's muxer begins
each element of level 1 with a CRC-32 of the rest, which its demuxer does not look at.  Here they
are checked, so that a flipped bit is found wherever it is.
"""

import io
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from lfcore.errors import StorageError

HEAD, SEGMENT, CRC32 = 0x1A45DFA3, 0x18538067, 0xBF
NAMES = {
    0x114D9B74: "SeekHead",
    0x1549A966: "Info",
    0x1654AE6B: "Tracks",
    0x1254C367: "Tags",
    0x1F43B675: "Cluster",
    0x1C53BB6B: "Cues",
    0xEC: "Void",
}
HEAD_VALUES = {
    0x4286: b"\1",  # version of EBML
    0x42F7: b"\1",  # version needed to read it
    0x42F2: b"\4",  # longest id
    0x42F3: b"\x08",  # longest size
    0x4282: b"matroska",
    0x4287: b"\4",  # version of Matroska
    0x4285: b"\2",  # version needed to read it
}
CUE_POINT, CUE_TIME = 0xBB, 0xB3
SEEK, SEEK_POSITION = 0x4DBB, 0x53AC
BLOCK_BYTES = 1 << 20


@dataclass(frozen=True)
class Element:
    """One element: ``offset`` of its first byte, ``start`` and ``stop`` of its content.

    ``summed`` tells whether the content begins with a check sum.
    """

    name: str
    offset: int
    start: int
    stop: int
    summed: bool


@dataclass
class Structure:
    """What a scan found: the length that the file says it has (0: unknown), damage with its place,
    and the times in milliseconds of all key frames (empty without the index at the end)."""

    file_bytes: int
    expected_bytes: int = 0
    elements: list[Element] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    keys: list[int] = field(default_factory=list)


def scan(path: Path, *, clusters: bool) -> Structure:
    """Walk over the elements of level 1 and check those that are not video; all with ``clusters``.

    Without ``clusters``, the walk goes from the first cluster of video to the next element that the
    SeekHead knows, however many clusters lie between.
    """
    try:
        with path.open("rb") as file:
            size = path.stat().st_size
            return _scan(file, path, size, clusters)
    except OSError as error:
        raise StorageError(f"cannot be read: {error.strerror or error}", file=path) from error


def _scan(file: BinaryIO, path: Path, size: int, clusters: bool) -> Structure:
    found = Structure(size)
    position = begin = _head(file, path, found)
    known: list[int] = []
    while position < size:
        element = _element(file, position)
        if element is None or element.name not in NAMES.values():
            found.faults.append(f"there is no element of Matroska's at byte {position}")
            break
        if element.stop > size:
            found.faults.append(f"the {element.name} at byte {position} is cut short")
            break
        found.elements.append(element)
        if (clusters or element.name != "Cluster") and _intact(file, element) is False:
            found.faults.append(f"the {element.name} at byte {position} is damaged")
        elif element.name == "Cues":
            found.keys = sorted(_numbers(file, element, CUE_POINT, CUE_TIME))
        elif element.name == "SeekHead":
            known += [begin + offset for offset in _numbers(file, element, SEEK, SEEK_POSITION)]
        position = element.stop
        if element.name == "Cluster" and not clusters:
            position = min((one for one in known if position < one < size), default=position)
    bare = [one for one in found.elements if not one.summed and one.name != "Void"]
    if len(bare) < sum(one.name != "Void" for one in found.elements):
        # FFmpeg's muxer gives every element a check sum; others may give none at all.
        found.faults += [f"the {one.name} at byte {one.offset} is damaged" for one in bare]
    if found.file_bytes < found.expected_bytes:
        found.faults.insert(0, f"the file ends after {size} of {found.expected_bytes} bytes")
    elif size > found.expected_bytes > 0:
        found.faults.insert(0, f"{size - found.expected_bytes} bytes follow the end of the video")
    return found


def _head(file: BinaryIO, path: Path, found: Structure) -> int:
    """Check the EBML head and find the Segment; returns where its content begins."""
    foreign = StorageError(
        "is not a Matroska file",
        file=path,
        remedy="Give a light field file (.mkv), as 'lfcore record' writes it",
    )
    identity, start, stop = _header(file, 0) or (0, 0, 0)
    if identity != HEAD or stop > found.file_bytes or stop > 4096:
        raise foreign
    values = {key: file_range(file, a, b) for key, a, b in _children(file, start, stop)}
    if values.get(0x4282) != b"matroska":
        raise foreign
    if values != HEAD_VALUES:
        found.faults.append("the EBML head at byte 0 is damaged")
    header = _header(file, stop)
    if header is None or header[0] != SEGMENT:
        problem = f"is damaged or cut short at byte {stop}, before anything can be read"
        raise StorageError(problem, file=path)
    found.expected_bytes = header[2]
    return header[1]


def _header(file: BinaryIO, position: int) -> tuple[int, int, int] | None:
    """(id, start, stop) of the element at ``position``; None where there is none."""
    file.seek(position)
    head = file.read(16)
    if not head or not head[0]:
        return None
    id_bytes = 9 - head[0].bit_length()
    if id_bytes > 4 or len(head) <= id_bytes or not head[id_bytes]:
        return None
    size_bytes = 9 - head[id_bytes].bit_length()
    if len(head) < id_bytes + size_bytes:
        return None
    size = int.from_bytes(head[id_bytes : id_bytes + size_bytes], "big")
    start = position + id_bytes + size_bytes
    size &= (1 << (7 * size_bytes)) - 1
    return int.from_bytes(head[:id_bytes], "big"), start, start + size


def _element(file: BinaryIO, position: int) -> Element | None:
    header = _header(file, position)
    if header is None:
        return None
    summed = file_range(file, header[1], header[1] + 2) == bytes([CRC32, 0x84])
    return Element(NAMES.get(header[0], hex(header[0])), position, *header[1:], summed)


def _children(file: BinaryIO, start: int, stop: int) -> Iterator[tuple[int, int, int]]:
    """(id, start, stop) of the elements in that range, as far as they make sense."""
    while start < stop:
        header = _header(file, start)
        if header is None or header[2] > stop:
            return
        yield header
        start = header[2]


def file_range(file: BinaryIO, start: int, stop: int) -> bytes:
    """The bytes start ... stop - 1 of a file."""
    file.seek(start)
    return file.read(stop - start)


def _intact(file: BinaryIO, element: Element) -> bool | None:
    """Whether the CRC-32 of an element agrees; None without one.  Void must be all zero."""
    start = element.start
    if element.name == "Void":
        return not any(file_range(file, start, element.stop))
    if not element.summed:
        return None
    first = _header(file, start)
    if first is None:
        return False
    expected = int.from_bytes(file_range(file, *first[1:]), "little")
    crc, position = 0, first[2]
    while position < element.stop:
        block = file_range(file, position, min(position + BLOCK_BYTES, element.stop))
        crc, position = zlib.crc32(block, crc), position + len(block)
        if not block:
            return False
    return crc == expected


def _numbers(file: BinaryIO, element: Element, outer: int, inner: int) -> Iterator[int]:
    """The ``inner`` numbers in the ``outer`` elements of one that is whole; there may be as many as
    segments, so from memory."""
    memory = io.BytesIO(file_range(file, element.start, element.stop))
    for identity, *place in _children(memory, 0, element.stop - element.start):
        for name, start, stop in _children(memory, *place) if identity == outer else ():
            if name == inner:
                yield int.from_bytes(file_range(memory, start, stop), "big")
