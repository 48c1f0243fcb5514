"""The points around a tile, and what each task finds them by."""

from __future__ import annotations

import io
import json
import logging
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ._cloud import Cloud
from ._errors import FormatError
from ._files import read
from ._task import Task, digest, is_flaky, unfinished, unseen
from ._tiles import Doubles, Tile

Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Around:
    """Points of a tile and around it."""

    own: Cloud
    #: World coordinates (n, 3) of points of other tiles.
    others: Doubles
    #: Place of each point, own ones first, in an order that is the same in every task.
    order: npt.NDArray[np.int64]
    #: Numbers of tiles that cannot be read.
    lost: Sequence[int] = ()


class Index:
    """All tiles of a job, as each task finds them in a file."""

    def __init__(self, tiles: Sequence[Tile], halos: Sequence[float], borders: list[str], keep: str | None) -> None:
        self.tiles = tiles
        #: Width around each tile, in world units, in which points of other tiles are looked for first.
        self.halos = halos
        #: Files with the points of each tile that lie near others; empty if nobody needs one.
        self.borders = borders
        self.keep = keep
        nowhere = (np.nan,) * 3
        self.lows: Doubles = np.array([tile.low or nowhere for tile in tiles]).reshape(-1, 3)
        self.highs: Doubles = np.array([tile.high or nowhere for tile in tiles]).reshape(-1, 3)

    def save(self, path: Path) -> None:
        """Writes the file that `load` reads."""
        values = {
            "tiles": [asdict(tile) for tile in self.tiles],
            "halos": list(self.halos),
            "borders": list(self.borders),
            "keep": self.keep,
        }
        with unfinished(str(path), str(path.parent)) as place:
            Path(place).write_text(json.dumps(values), encoding="utf-8")

    @staticmethod
    def load(path: str) -> Index:
        """Reads the file once a process."""
        try:
            found = os.stat(path)
        except FileNotFoundError:
            raise unseen(path, "the list of tiles is missing") from None
        return _loaded(path, found.st_mtime_ns, found.st_size)

    def area(self, number: int, halo: float) -> Doubles:
        """Corners (2, 3) of a tile's box with a halo along x and y, and without end along z."""
        low, high = self.lows[number] - halo, self.highs[number] + halo
        low[2], high[2] = -np.inf, np.inf
        return np.array([low, high])

    def meeting(self, area: Doubles, number: int) -> list[int]:
        """Numbers of the other tiles that meet a box."""
        meets = (self.lows <= area[1]).all(axis=1) & (self.highs >= area[0]).all(axis=1)
        meets[number] = False
        found: list[int] = np.flatnonzero(meets).tolist()
        return found

    def near(self, number: int) -> list[int]:
        """Numbers of the other files within a tile's halo."""
        if self.tiles[number].box is not None:
            return []
        return self.meeting(self.area(number, self.halos[number]), number)

    def towards(self, number: int) -> list[int]:
        """Numbers of the tiles in whose halos a tile lies."""
        halo = np.array(self.halos)[:, None]
        meets = (self.lows[number] <= self.highs + halo) & (self.highs[number] >= self.lows - halo)
        found = meets[:, :2].all(axis=1)
        found[number] = False
        numbers: list[int] = np.flatnonzero(found).tolist()
        return numbers

    def read(self, number: int, bounds: Doubles | None = None) -> Cloud:
        """Points of a tile's file, of an octree only those within bounds."""
        tile = self.tiles[number]
        if tile.fault is not None:
            raise FormatError(tile.fault)
        cloud = read(tile.path, keep=self.keep, whole=True, bounds=bounds if tile.is_tree else None)
        ends = cloud.bounds if tile.box is None and bounds is None else None
        if ends is not None and ((ends[0] < self.lows[number]) | (ends[1] > self.highs[number])).any():
            what = "%s: there are points outside of the header's bounds, which tiles around do not look for"
            logging.getLogger("autosplats").info(what, tile.path)
        return cloud

    def own(self, number: int) -> Cloud:
        """Points of a tile."""
        if self.tiles[number].box is None:
            return self.read(number)
        return self._around_box(number, self.area(number, 0.0), None).own

    def around(self, number: int, area: Doubles, *, balls: Balls | None = None, own: Cloud | None = None) -> Around:
        """A tile with the points of others in an area, and with those in balls."""
        if self.tiles[number].box is not None:
            return self._around_box(number, area, balls)
        own = self.read(number) if own is None else own
        parts, order, lost = [np.empty((0, 3))], [np.full(len(own), number)], []
        everything = area if balls is None else balls.area(area)
        for other in self.meeting(everything, number):
            try:
                xyz = self._points(other, area, balls)
            except (FormatError, OSError) as error:
                if is_flaky(error):
                    raise
                lost.append(other)
                continue
            parts.append(xyz)
            order.append(np.full(len(xyz), other))
        return Around(own, np.concatenate(parts), np.concatenate(order), lost)

    def _around_box(self, number: int, area: Doubles, balls: Balls | None) -> Around:
        tile = self.tiles[number]
        assert tile.box is not None
        cloud = self.read(number, area if balls is None else balls.area(area))
        xyz = cloud.xyz
        low, high = np.array(tile.box).reshape(2, 2)
        own = ((xyz[:, :2] >= low) & (xyz[:, :2] < high)).all(axis=1)
        other = _within(xyz, area) & ~own
        if balls is not None:
            other |= balls.hold(cloud) & ~own
        order = np.concatenate([np.flatnonzero(own), np.flatnonzero(other)])
        return Around(cloud[own], xyz[other], order)

    def _points(self, number: int, area: Doubles, balls: Balls | None) -> Doubles:
        """World coordinates of a tile's points in an area or in balls."""
        tile = self.tiles[number]
        balls = None if balls is None else balls.meeting(self.lows[number], self.highs[number])
        if balls is not None and len(balls):
            cloud = self.read(number, balls.area(area))
            xyz = cloud.xyz
            return xyz[_within(xyz, area) | balls.hold(cloud)]
        if tile.is_tree:
            return self.read(number, area).xyz
        try:
            xyz = np.load(self.borders[number])
        except FileNotFoundError:
            # Its task has failed, or the share does not show the file to this machine yet.
            xyz = self.read(number).xyz
        return np.asarray(xyz[_within(xyz, area)], dtype=np.float64)


@lru_cache(maxsize=4)
def _loaded(path: str, _time: int, _size: int) -> Index:
    values: dict[str, Any] = json.loads(Path(path).read_text(encoding="utf-8"))
    tiles = [Tile(**{name: _tuple(value) for name, value in tile.items()}) for tile in values["tiles"]]
    return Index(tiles, values["halos"], values["borders"], values["keep"])


def _tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _within(xyz: Doubles, area: Doubles) -> Mask:
    inside: Mask = ((xyz >= area[0]) & (xyz <= area[1])).all(axis=1)
    return inside


@dataclass(frozen=True)
class Balls:
    """Places (n, 3) and distances (n) around them, in which all points are to be known."""

    centers: Doubles
    radii: Doubles

    def __len__(self) -> int:
        return len(self.radii)

    def __getitem__(self, which: Mask) -> Balls:
        return Balls(self.centers[which], self.radii[which])

    def meet(self, low: Doubles, high: Doubles) -> Mask:
        """Which of them meet a box."""
        nearest = np.clip(self.centers, low, high)
        meets: Mask = ((self.centers - nearest) ** 2).sum(axis=1) <= self.radii**2
        return meets

    def meeting(self, low: Doubles, high: Doubles) -> Balls:
        """Those that meet a box."""
        return self[self.meet(low, high)]

    def area(self, area: Doubles) -> Doubles:
        """Corners (2, 3) of a box around all of them and an area."""
        if not len(self):
            return area
        low = (self.centers - self.radii[:, None]).min(axis=0)
        high = (self.centers + self.radii[:, None]).max(axis=0)
        return np.array([np.minimum(area[0], low), np.maximum(area[1], high)])

    def hold(self, cloud: Cloud) -> Mask:
        """Which points of a cloud lie in one of them."""
        return cloud._core.near(np.ascontiguousarray(self.centers), np.ascontiguousarray(self.radii))


@dataclass(frozen=True)
class BorderTask(Task):
    """Writes the points of a file that lie near other tiles, so that these need not read all of it."""

    index: str
    number: int

    def outputs(self) -> Sequence[str]:
        return [os.path.join(self.work, f"border-{self.number}-{self.inputs}.npy")]

    def run(self, device: int | str | None) -> tuple[int, int]:
        index = Index.load(self.index)
        xyz = index.read(self.number).xyz
        near = np.zeros(len(xyz), dtype=bool)
        for other in index.towards(self.number):
            near |= _within(xyz, index.area(other, index.halos[other]))
        buffer = io.BytesIO()
        np.save(buffer, xyz[near])
        with unfinished(self.outputs()[0], self.work) as path:
            Path(path).write_bytes(buffer.getbuffer())
        return int(near.sum()), 0


@dataclass(frozen=True)
class Plan:
    """What each tile reads of others."""

    index: Index
    #: Tasks that write the borders of files.
    borders: Sequence[BorderTask]
    #: Digest of what each tile reads.
    inputs: Sequence[str]
    #: Files with borders that each tile reads.
    needs: Sequence[tuple[str, ...]]


def planned(tiles: Sequence[Tile], halos: Sequence[float] | None, keep: str | None, work: str) -> Plan:
    """What tiles read of others within their halos. Without halos, they have nothing to do with each other."""
    index = Index(tiles, halos or [-np.inf] * len(tiles), [""] * len(tiles), keep)
    near = [index.near(number) for number in range(len(tiles))]
    towards: list[list[int]] = [[] for _ in tiles]
    for number, others in enumerate(near):
        for other in others:
            towards[other].append(number)
    borders = []
    for number, tile in enumerate(tiles):
        if towards[number] and not tile.is_tree:
            areas = [index.area(other, index.halos[other]).tolist() for other in towards[number]]
            read = digest([tile.path, tile.stamp, areas])
            task = BorderTask(f"border of {tile.name}", tile.points, read, work, index_path(work), number)
            index.borders[number] = task.outputs()[0]
            borders.append(task)
    stamps = [[tile.path, tile.stamp] for tile in tiles]
    inputs = [
        digest([stamps[number], index.halos[number], *(stamps[other] for other in others)])
        for number, others in enumerate(near)
    ]
    needs = [tuple(index.borders[other] for other in others if index.borders[other]) for others in near]
    return Plan(index, borders, inputs, needs)


def index_path(work: str) -> str:
    """The file with the index of a job."""
    return os.path.join(work, "index.json")
