"""Tasks on tiles, exact up to their borders: normals, thinning, and conversion to octrees."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from . import _core
from ._around import Around, Balls, Index, Mask
from ._camera import Vector
from ._cloud import Cloud
from ._errors import Error, FormatError
from ._files import write
from ._normals import Normals
from ._task import Task, unfinished, unseen
from ._tiles import Doubles, Tile

#: Rounding must not hide a neighbour.
SLACK = 1.001
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
        return Balls(around.own.xyz, radius.astype(np.float64) * (0.5 * max(neighbors, 1) ** 0.5 * SLACK))

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
    #: The first and the last cell along x and y, by the file's header.
    span: tuple[int, int, int, int]

    def outputs(self) -> Sequence[str]:
        return [parts_path(self.work, self.inputs)]

    def run(self, device: int | str | None) -> tuple[int, int]:
        tile = Tile(self.name, self.path, "")
        cloud = Index([tile], [0.0], [""], self.keep).read(0)
        xyz = cloud.xyz
        cells = np.floor(xyz[:, :2] / self.side)
        inside = np.isfinite(cells).all(axis=1)
        found = cells[inside]
        if len(found) and ((found < self.span[:2]) | (found > self.span[2:])).any():
            raise FormatError(f"{self.path}: points lie outside of the header's bounds; write the file anew")
        parts: dict[str, str] = {}
        for cell in np.unique(found, axis=0):
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
                raise unseen(tile, "its points are missing; repair or remove it")
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


def _finite(xyz: Doubles) -> Doubles:
    rows: Doubles = xyz[np.isfinite(xyz).all(axis=1)]
    return rows
