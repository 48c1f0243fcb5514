"""Tiles: files side by side, or boxes of an octree."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Union

import numpy as np
import numpy.typing as npt

from . import _core
from ._errors import ArgumentError, Error, FormatError
from ._task import is_flaky, told

Doubles = npt.NDArray[np.float64]
#: A folder, a pattern, a file, an address, or a list of files.
Source = Union[str, "os.PathLike[str]", Sequence[Union[str, "os.PathLike[str]"]]]

#: Files that a folder is searched for.
_ENDINGS = (".las", ".laz", ".e57", ".pcd", ".ply", ".xyz", ".pts")
#: Part of its size by which a header's box may be too small: programs round the bounds that they write.
_ROUNDING = 1e-6


@dataclass(frozen=True)
class Tile:
    """A file, or a box of an octree."""

    #: Name without folder and ending.
    name: str
    path: str
    #: Size and time of the file, so that another file is told from it.
    stamp: str
    #: Number of points, and corners of the box around them, as the header states them.
    points: int = 0
    low: tuple[float, float, float] | None = None
    high: tuple[float, float, float] | None = None
    #: Whether parts of the file can be read without the rest.
    is_tree: bool = False
    #: Of an octree the part that is the tile: least x and y, and those behind the largest. None for a whole file.
    box: tuple[float, float, float, float] | None = None
    #: Name of the unit of x and y.
    unit: str | None = None
    #: Why the file cannot be a tile.
    fault: str | None = None


def tiles_of(source: Source, box_points: int) -> list[Tile]:
    """The tiles of a folder, a pattern or a list of files, or the boxes of one octree."""
    if isinstance(source, (str, os.PathLike)):
        name = os.fspath(source)
        if os.path.exists(os.path.join(name, "ept.json")):
            names = [os.path.join(name, "ept.json")]
        elif os.path.isdir(name):
            names = sorted(str(path) for path in Path(name).iterdir() if path.name.lower().endswith(_ENDINGS))
        else:
            names = sorted(glob.glob(name)) if glob.has_magic(name) and not os.path.exists(name) else [name]
    else:
        names = [os.fspath(each) for each in source]
    if not names:
        raise FileNotFoundError(f"{source}: there are no tiles; name a folder or a pattern of files, or an octree")
    files = [name if "://" in name else os.path.abspath(name) for name in names]
    tiles = [_outlined(name) for name in files]
    if len(tiles) == 1 and tiles[0].is_tree:
        tiles = list(_boxes(tiles[0], box_points))
    elif len(tiles) == 1 and tiles[0].fault is not None and not os.path.exists(files[0]):
        raise FileNotFoundError(tiles[0].fault)
    seen: dict[str, str] = {}
    for tile in tiles:
        if tile.box is None and seen.setdefault(tile.name, tile.path) != tile.path:
            raise ArgumentError(f"{tile.path}: {seen[tile.name]} has its name, and so would the outputs; rename one")
    return tiles


def _outlined(path: str) -> Tile:
    name = os.path.basename(path.rstrip("/"))
    if name == "ept.json":
        name = os.path.basename(os.path.dirname(path))
    for ending in (".laz", ".copc", *_ENDINGS):
        name = name[: -len(ending)] if name.lower().endswith(ending) else name
    try:
        stamp = ""
        if "://" not in path:
            found = os.stat(path)
            stamp = f"{found.st_size} {found.st_mtime_ns}"
        outline = _core.outline(path)
        if outline["points"] is None or outline["bounds"] is None:
            raise FormatError(f"{path}: its header states no number of points or no bounds; convert it to .laz")
    except (Error, OSError) as error:
        if is_flaky(error):
            raise
        return Tile(name=name, path=path, stamp="", fault=told(error))
    low, high = (np.array(corner) for corner in outline["bounds"])
    slack = _ROUNDING * (high - low).max()
    return Tile(
        name=name,
        path=path,
        stamp=stamp,
        points=outline["points"],
        low=_triple(low - slack),
        high=_triple(high + slack),
        is_tree=outline["is_tree"],
        unit=outline["unit"],
    )


def _triple(values: Doubles) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


def _boxes(tile: Tile, most: int) -> Iterator[Tile]:
    """Parts of an octree with at most `most` points, if they are not a few nodes anyway.

    Their sides run along the middles of the finest nodes, so no node lies just beside a part: what lies around a part
    is mostly in nodes that the part needs itself.
    """
    nodes = _core.tree_nodes(tile.path)
    assert nodes is not None
    lows, highs, points = nodes[0][:, :2], nodes[1][:, :2], nodes[2].astype(np.float64)
    if len(points) == 0:
        return
    finest = float((highs - lows)[:, 0].min())
    start = lows.min(axis=0) - finest / 2
    side = finest
    while (start + side < highs.max(axis=0)).any():
        side *= 2
    stack = [(0, 0, 0, np.arange(len(points)))]
    while stack:
        level, x, y, there = stack.pop()
        size = side / 2**level
        low = start + np.array([x, y]) * size
        shared = np.minimum(highs[there], low + size) - np.maximum(lows[there], low)
        meets = (shared > 0).all(axis=1)
        there, shared = there[meets], shared[meets]
        count = float((points[there] * (shared / (highs - lows)[there]).prod(axis=1)).sum())
        if len(there) == 0:
            continue
        if count > most and size > 2 * finest:
            stack += [(level + 1, 2 * x + i, 2 * y + j, there) for i in (0, 1) for j in (0, 1)]
            continue
        (x0, y0), (x1, y1) = low.tolist(), (low + size).tolist()
        z0, z1 = (-np.inf, np.inf) if tile.low is None or tile.high is None else (tile.low[2], tile.high[2])
        name = tile.name if level == 0 else f"{tile.name}_{level}_{x}_{y}"
        yield Tile(
            name=name,
            path=tile.path,
            stamp=tile.stamp,
            points=int(count),
            low=(x0, y0, z0),
            high=(x1, y1, z1),
            is_tree=True,
            box=(x0, y0, x1, y1),
            unit=tile.unit,
        )
