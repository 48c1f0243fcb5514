"""Jobs on tiles: normals, thinning, and conversion to octrees."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from ._around import index_path, planned
from ._camera import _vector
from ._errors import ArgumentError
from ._job import Job, work_of
from ._task import digest
from ._tile_tasks import (
    SLACK,
    ConvertTask,
    CopcTask,
    NormalsTask,
    SplitTask,
    ThinTask,
    TileTask,
)
from ._tiles import Source, Tile, tiles_of

Value = Literal["normals", "curvature", "density"]

#: Fields of each value, as `Cloud.with_normals` names them.
_FIELDS = {"normals": ("NormalX", "NormalY", "NormalZ"), "curvature": ("Curvature",), "density": ("DensityRadius",)}
#: Usual number of points of a box of an octree.
_BOX_POINTS = 4_000_000
#: The first halo, in distances to the k-th neighbour of points that lie evenly in the tile's box.
_FIRST_HALO = 8.0


def tile_normals(
    tiles: Source,
    output: str | os.PathLike[str],
    *,
    k: int = 10,
    orient: Literal["up", "sensor"] = "up",
    sensor: npt.ArrayLike | None = None,
    values: Sequence[Value] = ("normals", "curvature", "density"),
    format: str = "laz",
    keep: str | None = None,
    halo: float | None = None,
    box_points: int = _BOX_POINTS,
) -> Job:
    """A job that estimates the normals of tiles, each point's from its neighbours in all tiles.

    Points near the border of a tile get neighbours of the tiles around. A normal is exact if its neighbourhood ends
    where all points are known; further points are read until this holds for all. What cannot be read is counted in
    `Row.in_doubt`.

    Args:
        tiles: A folder, a pattern or a list of files, of which borders are read in a first step; or one octree (COPC,
            EPT), which is worked on in boxes.
        output: Folder for the outputs, one a tile and of its name.
        k: Number of neighbours, 3 to 1024.
        orient: The side that normals point to in all tiles: "up", or "sensor" to where the file states that the points
            were seen from.
        sensor: Position (3,) from which all points were seen, in place of `orient`.
        values: What is written: fields NormalX, NormalY, NormalZ; Curvature; DensityRadius.
        format: Ending of the outputs: "laz", "las", "copc.laz", "ply" ...
        keep: Which points to keep, such as "usual" or "ground", as in `autosplats.read`.
        halo: Width around a tile, in world units, in which points are read first. The default suits points that lie
            evenly. It changes the time, and no result.
        box_points: Most points of a box of an octree.

    Raises:
        ArgumentError: If an argument is out of its range, or the coordinates are in degrees.
        FileNotFoundError: If there are no tiles.
    """
    if isinstance(k, bool) or not hasattr(k, "__index__"):
        raise TypeError(f"k: {type(k).__name__} given, a whole number is wanted")
    if not 3 <= k.__index__() <= 1024:
        raise ArgumentError(f"k is {k}, must be within 3 to 1024")
    if orient not in ("up", "sensor"):
        raise ArgumentError(f"orient is '{orient}', must be up or sensor: others differ from tile to tile")
    unknown = [value for value in values if value not in _FIELDS]
    if unknown or not values:
        raise ArgumentError(f"values are {list(values)}, must be some of {', '.join(_FIELDS)}")
    place = None if sensor is None else _vector(sensor, "sensor")
    if halo is not None and not 0 <= halo < np.inf:
        raise ArgumentError(f"halo is {halo}, must be 0 or above")
    found = tiles_of(tiles, box_points)
    degrees = next((tile.path for tile in found if tile.unit == "degree"), None)
    if degrees is not None:
        raise ArgumentError(f"{degrees}: its coordinates are in degrees; convert the tiles to metres first")

    def usual(tile: Tile) -> float:
        if tile.low is None or tile.high is None or tile.points == 0:
            return 0.0
        area = (tile.high[0] - tile.low[0]) * (tile.high[1] - tile.low[1])
        return float(_FIRST_HALO * (area / tile.points * k / np.pi) ** 0.5)

    halos = [usual(tile) if halo is None else float(halo) for tile in found]
    fields = tuple(name for value in _FIELDS if value in values for name in _FIELDS[value])
    own = {"k": k.__index__(), "orient": orient, "sensor": place, "fields": fields}
    return _tile_job("normals", NormalsTask, own, found, halos, output, format, keep)


def thin_tiles(
    tiles: Source,
    output: str | os.PathLike[str],
    voxel: float,
    *,
    format: str = "laz",
    keep: str | None = None,
    box_points: int = _BOX_POINTS,
) -> Job:
    """A job that keeps one point per occupied cube: the one nearest to the mean of its points. Cubes at borders are
    thinned with the points of all tiles.

    Args:
        tiles, output, format, keep, box_points: As of `tile_normals`.
        voxel: Edge of the cubes in world units.

    Raises:
        ArgumentError: If `voxel` is not above 0.
        FileNotFoundError: If there are no tiles.
    """
    if not 0 < voxel < np.inf:
        raise ArgumentError(f"voxel is {voxel}, must be above 0")
    found = tiles_of(tiles, box_points)
    halos = [SLACK * voxel] * len(found)
    return _tile_job("thin", ThinTask, {"voxel": float(voxel)}, found, halos, output, format, keep)


def copc_tiles(
    tiles: Source,
    output: str | os.PathLike[str],
    *,
    side: float | None = None,
    keep: str | None = None,
    box_points: int = _BOX_POINTS,
) -> Job:
    """A job that converts tiles to octrees (COPC).

    Args:
        tiles, output, keep, box_points: As of `tile_normals`.
        side: Side in world units of a grid. Each of its cells becomes a file, from all tiles that have points there: a
            first step divides tiles, a second one joins parts. By default each tile becomes a file.

    Raises:
        ArgumentError: If `side` is not above 0.
        FileNotFoundError: If there are no tiles.
    """
    if side is not None and not 0 < side < np.inf:
        raise ArgumentError(f"side is {side}, must be above 0")
    found = tiles_of(tiles, box_points)
    if side is None:
        return _tile_job("copc", ConvertTask, {}, found, None, output, "copc.laz", keep)
    if any(tile.box is not None for tile in found):
        raise ArgumentError(f"{found[0].path} is an octree already; leave side out to divide it")
    folder = Path(os.path.abspath(output))
    manifest = folder / "job.jsonl"
    work = str(work_of(manifest))
    splits = []
    cells: dict[tuple[int, int], list[int]] = {}
    for number, tile in enumerate(found):
        span = _cells(tile, side)
        inputs = digest([tile.path, tile.stamp])
        splits.append(SplitTask(f"parts of {tile.name}", tile.points, inputs, work, tile.path, keep, side, span))
        for x in range(span[0], span[2] + 1):
            for y in range(span[1], span[3] + 1):
                cells.setdefault((x, y), []).append(number)
    joins = []
    for (x, y), numbers in sorted(cells.items()):
        share = sum(found[number].points // _count(splits[number].span) for number in numbers)
        inputs = digest([[found[number].path, found[number].stamp] for number in numbers])
        name = f"{x}_{y}.copc.laz"
        parts = tuple((found[number].path, splits[number].outputs()[0]) for number in numbers)
        joins.append(CopcTask(name, share, inputs, work, str(folder / name), f"{x} {y}", parts))
    # A file without a header belongs to no cell, and its task tells why.
    faulty = [split for split, tile in zip(splits, found) if tile.fault is not None]
    return Job("copc", {"side": float(side), "keep": keep}, manifest, [splits, [*joins, *faulty]])


def _cells(tile: Tile, side: float) -> tuple[int, int, int, int]:
    """The first and the last cell along x and y that a tile meets; none without a header."""
    if tile.low is None or tile.high is None:
        return 0, 0, -1, -1
    x0, y0, x1, y1 = np.floor(np.array([*tile.low[:2], *tile.high[:2]]) / side).astype(int).tolist()
    return x0, y0, x1, y1


def _count(span: tuple[int, int, int, int]) -> int:
    """Number of cells."""
    return (span[2] - span[0] + 1) * (span[3] - span[1] + 1)


def _tile_job(
    kind: str,
    task: type[TileTask],
    own: Mapping[str, Any],
    tiles: Sequence[Tile],
    halos: Sequence[float] | None,
    output: str | os.PathLike[str],
    format: str,
    keep: str | None,
) -> Job:
    """A job with a task a tile, after those that write the borders of files if there are halos. `own` is what this task
    has beside others."""
    folder = Path(os.path.abspath(output))
    if any(os.path.dirname(tile.path) == str(folder) for tile in tiles):
        raise ArgumentError(f"{folder}: outputs cannot lie beside the tiles; name another folder")
    manifest = folder / "job.jsonl"
    work = work_of(manifest)
    plan = planned(tiles, halos, keep, str(work))
    file = index_path(str(work))
    last = []
    for number, tile in enumerate(tiles):
        name = f"{tile.name}.{format.lstrip('.')}"
        last.append(
            task(
                name=name,
                points=tile.points,
                inputs=plan.inputs[number],
                work=str(work),
                output=str(folder / name),
                index=file,
                number=number,
                borders=plan.needs[number],
                **own,
            )
        )
    settings = {**own, "format": format, "keep": keep}
    return Job(kind, settings, manifest, [plan.borders, last], prepare=lambda: plan.index.save(Path(file)))
