"""Files, addresses and generated scenes."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from typing import Any, Protocol, Union

import numpy.typing as npt

from . import _core
from ._cloud import Cloud, core_cloud
from ._convert import numbers
from ._errors import ArgumentError, FormatError
from ._progress import ProgressLike, reporting
from ._threads import checked


class Readable(Protocol):
    """A binary file that is open."""

    def read(self) -> bytes: ...


#: A path, a pattern, an address, or scene:NAME.
Source = Union[str, "os.PathLike[str]"]

#: Exit codes of the command.
_BAD_USAGE, _BAD_INPUT, _NO_MEMORY = 2, 3, 6


def reading(
    *,
    exact: bool,
    columns: Sequence[str] | None = None,
    keep: str | None = None,
    keep_no_returns: bool = False,
    headers: Sequence[str] = (),
    whole: bool = False,
    bounds: npt.ArrayLike | None = None,
) -> dict[str, Any]:
    """Options of reading for the native half."""
    if isinstance(columns, str):
        columns = [name.strip() for name in columns.split(",")]
    return {
        "exact": exact,
        "columns": None if columns is None else list(columns),
        "keep": keep,
        "keep_no_returns": keep_no_returns,
        "headers": list(headers),
        "whole": whole,
        "bounds": None if bounds is None else _box(bounds),
    }


def _box(bounds: npt.ArrayLike) -> list[list[float]]:
    corners = numbers(bounds, "bounds")
    if corners.shape != (2, 3):
        raise ArgumentError(f"bounds: an array of shape {corners.shape} given, (2, 3) is wanted")
    if not (corners[0] <= corners[1]).all():
        raise ArgumentError("bounds: the least coordinates come first, and none may be NaN")
    box: list[list[float]] = corners.tolist()
    return box


def shown(source: Source) -> _core.Cloud:
    """The points of a source as the command's pictures show them."""
    return _core.read_source(os.fspath(source), reading(exact=False, keep="usual"), None, None)


def read(
    source: Source | bytes | Readable,
    *,
    name: str | None = None,
    bounds: npt.ArrayLike | None = None,
    columns: Sequence[str] | None = None,
    keep: str | None = None,
    keep_no_returns: bool = False,
    headers: Sequence[str] = (),
    exact: bool = True,
    whole: bool = False,
    progress: ProgressLike = None,
    num_threads: int | None = None,
) -> Cloud:
    """Reads points.

    Args:
        source: A file of any format, recognised by its content; its bytes, or an open binary file; an http, https, s3,
            gs or az address; a folder of files or a recording, whose first frame is read; or "scene:NAME:COUNT".
        name: With bytes, a name that helps to recognise the format, as "scan.xyz" does.
        bounds: Least and largest world coordinates (2, 3) of the points to read, both included; infinite where there is
            no limit. Of octrees (COPC, EPT) only the nodes there are read, of other files all.
        columns: Names of the columns of text and of binary records without a header: x, y, z, red, Intensity ...; "-"
            leaves a column out.
        keep: Which points to keep, such as "ground", "first" or "2..5", as the command's --keep.
        keep_no_returns: Keep points at (0, 0, 0), which scanners write for missing returns.
        headers: Headers of requests to an address, as "NAME: VALUE".
        exact: Keep every digit of coordinates and colours. Without it a cloud takes less memory.
        whole: Raise FormatError if the file is cut off or damaged, where else what is left is read with a warning.
        progress: True for a bar, or a function of the finished fraction.
        num_threads: Number of threads; see `num_threads`.

    Notes on what was left out or guessed go to the logger "autosplats" at level INFO, and what a file has lost at level
    WARNING.

    Raises:
        FileNotFoundError, PermissionError, OSError: If the system does not give the file.
        FormatError: If the file is malformed or of an unknown format.
        ArgumentError: If an option or the name of a scene is wrong.
        OutOfMemoryError: If the points do not fit into memory.
    """
    options = reading(
        exact=exact,
        columns=columns,
        keep=keep,
        keep_no_returns=keep_no_returns,
        headers=headers,
        whole=whole,
        bounds=bounds,
    )
    threads = checked(num_threads)
    with reporting(progress, "reading") as report:
        if isinstance(source, (str, os.PathLike)):
            return Cloud._of(_core.read_source(os.fspath(source), options, threads, report))
        content: object = source
        if not isinstance(source, (bytes, bytearray, memoryview)) and hasattr(source, "read"):
            content = source.read()
            name = name or getattr(source, "name", None)
        if not isinstance(content, (bytes, bytearray, memoryview)):
            raise TypeError(f"source: {type(source).__name__} given; a path, bytes or an open binary file is wanted")
        return Cloud._of(_core.read_bytes(bytes(content), str(name or "bytes"), options, threads, report))


def write(
    points: object,
    path: str | os.PathLike[str],
    *,
    overwrite: bool = False,
    progress: ProgressLike = None,
    num_threads: int | None = None,
) -> None:
    """Writes points in the format of the path's extension: .ply, .las, .laz, .copc.laz, .e57, .pcd, .xyz ... The file
    appears whole or not at all.

    Args:
        points: A cloud, or whatever `render` takes.
        path: The file.
        overwrite: Replace a file that is there.
        progress: True for a bar, or a function of the finished fraction.
        num_threads: Number of threads; see `num_threads`.

    Raises:
        FileExistsError: If the file is there, unless `overwrite`.
        ArgumentError: If no format has this extension.
        FormatError: If the format cannot hold these points.
    """
    core = core_cloud(points, exact=True)
    with reporting(progress, "writing") as report:
        _core.write(core, os.fspath(path), overwrite, checked(num_threads), report)


def info(
    source: Source,
    *,
    scan: bool = False,
    columns: Sequence[str] | None = None,
    num_threads: int | None = None,
) -> dict[str, Any]:
    """What a file is: format, points, bounds, attributes, coordinate system, scans. This is the report of the command's
    `info --json`.

    Args:
        source: A file, an address, or "scene:NAME:COUNT".
        scan: Read all points, for spacing, density, duplicates and the ranges of attributes.
        columns: Names of the columns of text.
        num_threads: Number of threads; see `num_threads`.

    Raises:
        FileNotFoundError, OSError: If the system does not give the file.
        FormatError: If the file is malformed or of an unknown format.
    """
    name = os.fspath(source)
    arguments = ["info", "--json", *(["--scan"] if scan else [])]
    if columns is not None:
        arguments += ["--columns", ",".join(columns)]
    if "://" not in name and not name.startswith("scene:"):
        # An exception of the system, as reading the file has.
        os.stat(name)
    code, printed, said = _core.command([*arguments, "--", name], checked(num_threads))
    if code == 0:
        report: dict[str, Any] = json.loads(printed)
        return report
    message = said.strip().rpartition("\n")[2].removeprefix("error: ")
    if code == _BAD_USAGE:
        raise ArgumentError(message)
    if code == _NO_MEMORY:
        from ._errors import OutOfMemoryError

        raise OutOfMemoryError(message)
    if code == _BAD_INPUT and os.path.exists(name) and not os.access(name, os.R_OK):
        raise PermissionError(message)
    raise FormatError(message)


def scene(
    name: str,
    count: int | None = None,
    *,
    progress: ProgressLike = None,
    num_threads: int | None = None,
) -> Cloud:
    """Generates the points of a built-in scene, such as "statue", "figure" or "cathedral".

    Args:
        name: Name of the scene, or its whole address, such as "scene:figure:1M@0.5".
        count: Number of points; by default the scene's usual one.
        progress: True for a bar, or a function of the finished fraction.
        num_threads: Number of threads; see `num_threads`.

    Raises:
        ArgumentError: If there is no such scene; the message lists them.
    """
    address = name if name.startswith("scene:") else f"scene:{name}"
    if count is not None:
        address += f":{count.__index__()}"
    with reporting(progress, "generating") as report:
        return Cloud._of(_core.read_source(address, reading(exact=True), checked(num_threads), report))
