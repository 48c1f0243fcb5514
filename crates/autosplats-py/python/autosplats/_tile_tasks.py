"""Work on tiles, exact up to their borders: normals, thinning, and conversion to octrees."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from . import _core
from ._camera import Vector, _vector
from ._cloud import Cloud
from ._errors import ArgumentError, Error
from ._files import write
from ._job import Job, work_of
from ._normals import Normals
from ._task import Task, unfinished
from ._tiles import Around, Balls, Doubles, Index, Mask, Source, Tile, digest, planned, tiles_of

Value = Literal["normals", "curvature", "density"]

#: Fields of each value, as `Cloud.with_normals` names them.
_FIELDS = {"normals": ("NormalX", "NormalY", "NormalZ"), "curvature": ("Curvature",), "density": ("DensityRadius",)}
#: Usual number of points of a box of an octree.
_BOX_POINTS = 4_000_000
#: The first halo, in distances to the k-th neighbour of points that lie evenly in the tile's box.
_FIRST_HALO = 8.0
#: Rounding must not hide a neighbour.
_SLACK = 1.001
#: Growth of the halo of a tile that has too few points.
_GROWTH = 4.0
#: Parts of a coordinate's step to which coordinates are rounded before cubes are told from each other.
_PARTS = 16


@dataclass(frozen=True)
class TileTask(Task):
    """Work on a tile."""

    output: str
    #: File with all tiles, and the tile's place in it.
    index: str
    number: int
    #: Files with the borders of the tiles around.
    borders: tuple[str, ...]

    def outputs(self) -> Sequence[str]:
        return [self.output]

    def needs(self) -> Sequence[str]:
        return self.borders

    def write(self, cloud: Cloud) -> int:
        """Writes the output, unless there are no points. Returns their number."""
        if len(cloud):
            with unfinished(self.output, self.work) as path:
                write(cloud, path)
        return len(cloud)


@dataclass(frozen=True)
class NormalsTask(TileTask):
    """Estimates the normals of a tile as those of all tiles together."""

    k: int
    orient: str
    sensor: Vector | None
    fields: tuple[str, ...]

    def run(self, device: int | str | None) -> tuple[int, int]:
        index = Index.load(self.index)
        area = index.area(self.number, index.halos[self.number])
        around = index.around(self.number, area)
        own = around.own
        if len(own) == 0:
            return 0, 0
        everywhere = float((np.nanmax(index.highs, axis=0) - np.nanmin(index.lows, axis=0))[:2].max())
        radius = max(index.halos[self.number], 1e-9 * everywhere)
        while len(own) + len(around.others) <= self.k and radius < 2 * everywhere:
            # Any k points tell how far the nearest k are at most.
            radius *= _GROWTH
            xyz = _finite(own.xyz)
            balls = Balls(xyz, np.full(len(xyz), radius))
            around = index.around(self.number, area, balls=balls, own=own)
        found = self.estimate(around)
        reach = self.reach(around, found.radius)
        balls = reach[self.is_open(index, reach, area)]
        if len(balls):
            # No neighbour is further away than those that are known, so this look suffices.
            around = index.around(self.number, area, balls=balls, own=own)
            found = self.estimate(around)
            reach = self.reach(around, found.radius)
        lost = [reach.meet(index.lows[other], index.highs[other]) for other in around.lost]
        in_doubt = int(np.logical_or.reduce(lost).sum()) if lost else 0
        result = around.own.with_normals(found)
        kept = {name for name in result.fields if name in own.fields or name in self.fields}
        if len(kept) < len(result.fields):
            state = result._core.state()
            state["fields"] = [(name, values) for name, values in state["fields"] if name in kept]
            result = Cloud._of(_core.Cloud.of_state(**state))
        return self.write(result), in_doubt

    def estimate(self, around: Around) -> Normals:
        """Normals, curvatures and density radii of the tile's own points."""
        cloud = around.own
        if len(around.others):
            cloud = Cloud.merge([cloud, Cloud(around.others)])
        found = _core.estimate_normals(cloud._core, self.k, self.orient, self.sensor, None, None)
        return Normals(*(values[: len(around.own)] for values in found))

    def reach(self, around: Around, radius: npt.NDArray[np.float32]) -> Balls:
        """Balls around the tile's points up to the k-th neighbour."""
        neighbors = min(self.k, len(around.own) + len(around.others) - 1)
        return Balls(around.own.xyz, radius.astype(np.float64) * (0.5 * max(neighbors, 1) ** 0.5 * _SLACK))

    def is_open(self, index: Index, reach: Balls, area: Doubles) -> Mask:
        """Which of them leave the area, where other tiles may have points."""
        inside = np.minimum(reach.centers - area[0], area[1] - reach.centers).min(axis=1)
        leaves: Mask = reach.radii >= inside
        meets = np.zeros(len(reach), dtype=bool)
        for other in index.meeting(reach[leaves].area(area), self.number):
            meets |= reach.meet(index.lows[other], index.highs[other])
        return leaves & meets


@dataclass(frozen=True)
class ThinTask(TileTask):
    """Keeps a tile's share of the points that thinning all tiles together leaves."""

    voxel: float

    def run(self, device: int | str | None) -> tuple[int, int]:
        index = Index.load(self.index)
        around = index.around(self.number, index.area(self.number, index.halos[self.number]))
        if around.lost:
            tile = index.tiles[around.lost[0]]
            raise Error(f"{tile.path} cannot be read, which tells what its neighbours keep; repair or remove it")
        xyz = np.concatenate([around.own.xyz, around.others])
        step = around.own._core.state()["resolution"]
        if step is not None and all(step):
            # Readers may round the last bit of a coordinate otherwise in another part of an octree.
            fine = np.array(step) / _PARTS
            xyz = np.rint(xyz / fine) * fine
        keep = thinned(xyz, around.order, self.voxel)[: len(around.own)]
        return self.write(around.own[keep]), 0


def thinned(xyz: Doubles, order: npt.NDArray[np.int64], voxel: float) -> Mask:
    """Which points are kept: of each cube the one nearest to the mean of the cube's points, of several the first by
    `order`. Points of the same cubes give the same, wherever the others are."""
    keep = np.zeros(len(xyz), dtype=bool)
    there = np.flatnonzero(np.isfinite(xyz).all(axis=1))
    if len(there) == 0:
        return keep
    cubes = np.floor(xyz[there] / voxel)
    sequence = np.lexsort((order[there], *cubes.T))
    cubes, there = cubes[sequence], there[sequence]
    first = np.flatnonzero(np.append(True, (cubes[1:] != cubes[:-1]).any(axis=1)))
    counts = np.diff(np.append(first, len(cubes)))
    place = xyz[there] - (cubes + 0.5) * voxel
    mean = np.repeat(np.add.reduceat(place, first) / counts[:, None], counts, axis=0)
    distance = ((place - mean) ** 2).sum(axis=1)
    nearest = np.flatnonzero(distance == np.repeat(np.minimum.reduceat(distance, first), counts))
    _, which = np.unique(np.repeat(np.arange(len(first)), counts)[nearest], return_index=True)
    keep[there[nearest[which]]] = True
    return keep


@dataclass(frozen=True)
class SplitTask(Task):
    """Divides the points of a file among the cells of a grid."""

    path: str
    keep: str | None
    side: float

    def outputs(self) -> Sequence[str]:
        return [parts_path(self.work, self.inputs)]

    def run(self, device: int | str | None) -> tuple[int, int]:
        tile = Tile(self.name, self.path, "")
        cloud = Index([tile], [0.0], [""], self.keep).read(0)
        xyz = cloud.xyz
        cells = np.floor(xyz[:, :2] / self.side)
        inside = np.isfinite(cells).all(axis=1)
        parts: dict[str, str] = {}
        for cell in np.unique(cells[inside], axis=0):
            x, y = cell.astype(int).tolist()
            path = os.path.join(self.work, f"part-{self.inputs}-{x}-{y}.las")
            with unfinished(path, self.work) as place:
                write(cloud[(cells == cell).all(axis=1)], place)
            parts[f"{x} {y}"] = path
        with unfinished(self.outputs()[0], self.work) as place:
            Path(place).write_text(json.dumps(parts), encoding="utf-8")
        return int(inside.sum()), 0


def parts_path(work: str, inputs: str) -> str:
    """The file that lists the parts that a tile was divided into."""
    return os.path.join(work, f"parts-{inputs}.json")


@dataclass(frozen=True)
class CopcTask(Task):
    """Joins the parts of a cell of a grid to an octree."""

    output: str
    cell: str
    #: Lists of the parts of each tile that may have points there, with the tile's path.
    parts: tuple[tuple[str, str], ...]

    def outputs(self) -> Sequence[str]:
        return [self.output]

    def needs(self) -> Sequence[str]:
        return [listed for _, listed in self.parts]

    def run(self, device: int | str | None) -> tuple[int, int]:
        clouds = []
        for tile, listed in self.parts:
            if not os.path.exists(listed):
                raise Error(f"{tile} cannot be read, which has points here; repair or remove it")
            part = json.loads(Path(listed).read_text(encoding="utf-8")).get(self.cell)
            if part is not None:
                clouds.append(Index([Tile("", part, "")], [0.0], [""], None).read(0))
        if not clouds:
            return 0, 0
        cloud = clouds[0] if len(clouds) == 1 else Cloud.merge(clouds)
        with unfinished(self.output, self.work) as path:
            write(cloud, path)
        return len(cloud), 0


@dataclass(frozen=True)
class ConvertTask(TileTask):
    """Writes a tile in another format."""

    def run(self, device: int | str | None) -> tuple[int, int]:
        index = Index.load(self.index)
        return self.write(index.own(self.number)), 0


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
    found = _metric(tiles_of(tiles, box_points))

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
    halos = [_SLACK * voxel] * len(found)
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
    splits = [
        SplitTask(f"parts of {tile.name}", tile.points, digest([tile.path, tile.stamp]), work, tile.path, keep, side)
        for tile in found
    ]
    cells: dict[tuple[int, int], list[int]] = {}
    for number, tile in enumerate(found):
        if tile.low is None or tile.high is None:
            continue
        (x0, y0), (x1, y1) = (np.floor(np.array(end[:2]) / side).astype(int).tolist() for end in (tile.low, tile.high))
        for x in range(x0, x1 + 1):
            for y in range(y0, y1 + 1):
                cells.setdefault((x, y), []).append(number)
    joins = []
    for (x, y), numbers in sorted(cells.items()):
        share = sum(found[number].points // max(_cells_of(found[number], side), 1) for number in numbers)
        inputs = digest([[found[number].path, found[number].stamp] for number in numbers])
        name = f"{x}_{y}.copc.laz"
        parts = tuple((found[number].path, splits[number].outputs()[0]) for number in numbers)
        joins.append(CopcTask(name, share, inputs, work, str(folder / name), f"{x} {y}", parts))
    # A file without a header belongs to no cell, and its task tells why.
    faulty = [split for split, tile in zip(splits, found) if tile.fault is not None]
    return Job("copc", {"side": float(side), "keep": keep}, manifest, [splits, [*joins, *faulty]])


def _cells_of(tile: Tile, side: float) -> int:
    if tile.low is None or tile.high is None:
        return 0
    return int(np.prod([np.floor(tile.high[axis] / side) - np.floor(tile.low[axis] / side) + 1 for axis in (0, 1)]))


def _metric(tiles: list[Tile]) -> list[Tile]:
    """The tiles, if their coordinates have one unit along all axes."""
    for tile in tiles:
        if tile.unit == "degree":
            raise ArgumentError(f"{tile.path}: its coordinates are in degrees; convert the tiles to metres first")
    return tiles


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
    file = work / "index.json"
    index, first, inputs = planned(tiles, halos, keep, str(work))
    written = {border.number: border.outputs()[0] for border in first}
    last = []
    for number, tile in enumerate(tiles):
        name = f"{tile.name}.{format.lstrip('.')}"
        last.append(
            task(
                name=name,
                points=tile.points,
                inputs=inputs[number],
                work=str(work),
                output=str(folder / name),
                index=str(file),
                number=number,
                borders=tuple(written[other] for other in index.near(number) if other in written),
                **own,
            )
        )
    settings = {**own, "format": format, "keep": keep}
    return Job(kind, settings, manifest, [first, last], prepare=lambda: index.save(file))


def _finite(xyz: Doubles) -> Doubles:
    rows: Doubles = xyz[np.isfinite(xyz).all(axis=1)]
    return rows
