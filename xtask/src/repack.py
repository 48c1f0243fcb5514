"""Packs a wheel again, as small as deflate can: maturin packs for speed."""

import sys
import zipfile

import deflate


class Whole:
    """What zipfile takes for a compressor. It keeps what is given, and packs it at the end."""

    def __init__(self) -> None:
        self.kept = bytearray()

    def compress(self, data: bytes) -> bytes:
        self.kept += data
        return b""

    def flush(self) -> bytes:
        return bytes(deflate.deflate_compress(bytes(self.kept), 12))


# There is no public way to give zipfile another compressor.
zipfile._get_compressor = lambda *_: Whole()
with zipfile.ZipFile(sys.argv[1]) as wheel:
    files = [(entry, wheel.read(entry)) for entry in wheel.infolist()]
with zipfile.ZipFile(sys.argv[1], "w", zipfile.ZIP_DEFLATED) as wheel:
    for entry, data in files:
        wheel.writestr(entry, data, zipfile.ZIP_DEFLATED)
# As pip reads it.
with zipfile.ZipFile(sys.argv[1]) as wheel:
    assert wheel.testzip() is None
    assert [wheel.read(entry) for entry, _ in files] == [data for _, data in files]
