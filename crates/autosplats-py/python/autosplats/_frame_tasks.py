"""Tasks of pictures: settling what they share, and rendering consecutive ones."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from . import _core
from ._camera import Axes, Camera, Size, View
from ._cloud import Cloud
from ._errors import EmptyError
from ._files import shown
from ._play import Recording, play
from ._render import Renderer
from ._task import Task, unfinished, unseen

#: Most frames that the camera is placed by, and fewest points that it can be placed by.
_LOOKS, _LEAST = 5, 2


@dataclass(frozen=True)
class Pictures:
    """What all pictures of a job share, as far as it is known beforehand."""

    #: A source that moves, or one that does not, with a camera a picture.
    source: str
    #: Arguments of `autosplats.play`; None for points that do not move.
    playing: Mapping[str, Any] | None
    size: Size
    view: View
    #: Camera as JSON; None for one that sees all.
    camera: str | None
    axes: Axes | None
    #: Further arguments of `Renderer.render`.
    look: Mapping[str, Any]
    backend: Literal["auto", "cpu", "gpu"]

    def open(self) -> Recording | Cloud:
        """The points."""
        if self.playing is None:
            return Cloud._of(shown(self.source))
        return play(self.source, **self.playing)


@dataclass(frozen=True)
class SettleTask(Task):
    """Settles once what all pictures share: camera, axes, exposure, and the ends of the colour map."""

    pictures: Pictures
    first: int
    last: int
    camera: str | None
    #: File for the result, which stays beside the pictures.
    settled: str

    def outputs(self) -> Sequence[str]:
        return [self.settled]

    def run(self, device: int | str | None) -> tuple[int, int]:
        pictures = self.pictures
        first, everything = self.clouds(pictures.open())
        if not _has(everything, _LEAST):
            raise EmptyError(f"{pictures.source}: there are no points in these frames")
        axes = pictures.axes or _core.axes_of(everything._core)
        camera = self.camera or pictures.camera
        if camera is None:
            camera = _core.fit_camera(everything._core, pictures.view, pictures.size, axes, None, False)
        renderer = Renderer(pictures.backend, device=_chosen(pictures, device))
        exposure, value_range = renderer._settled(
            first, Camera.from_json(camera), pictures.size, axes, pictures.look
        )
        values = {"camera": camera, "axes": axes, "exposure": exposure, "value_range": value_range}
        with unfinished(self.settled, self.work) as path:
            Path(path).write_text(json.dumps(values), encoding="utf-8")
        return 1, 0

    def clouds(self, points: Recording | Cloud) -> tuple[Cloud, Cloud]:
        """The first frame with points, and the points of some frames, as the command looks at them."""
        if isinstance(points, Cloud):
            return points, points
        start = next((frame for frame in range(self.first, self.last + 1) if _has(points[frame], _LEAST)), self.first)
        count = min(self.last - start + 1, _LOOKS)
        looks = sorted({start + (self.last - start) * look // max(count - 1, 1) for look in range(count)})
        clouds = [points[frame] for frame in looks]
        everything = Cloud._of(_core.Cloud.merged([cloud._core for cloud in clouds]))
        return next((cloud for cloud in clouds if _has(cloud, _LEAST)), everything), everything


def _has(cloud: Cloud, count: int) -> bool:
    return len(cloud) >= count and int(np.isfinite(cloud.positions).all(axis=1).sum()) >= count


def _chosen(pictures: Pictures, device: int | str | None) -> int | str | None:
    return None if pictures.backend == "cpu" else device


@dataclass(frozen=True)
class FramesTask(Task):
    """Renders consecutive pictures. Those that are there are left alone."""

    pictures: Pictures
    #: Number and file of each picture.
    files: tuple[tuple[int, str], ...]
    #: Camera of each picture as JSON, if each has its own.
    cameras: tuple[str, ...]
    settled: str

    def outputs(self) -> Sequence[str]:
        return [path for _, path in self.files]

    def needs(self) -> Sequence[str]:
        return [self.settled]

    def run(self, device: int | str | None) -> tuple[int, int]:
        pictures = self.pictures
        if not os.path.exists(self.settled):
            raise unseen(self.settled, "what pictures share is not settled")
        settled = json.loads(Path(self.settled).read_text(encoding="utf-8"))
        look = {**pictures.look, "exposure": settled["exposure"], "value_range": settled["value_range"]}
        points = pictures.open()
        renderer = Renderer(pictures.backend, device=_chosen(pictures, device))
        for place, (frame, output) in enumerate(self.files):
            if os.path.exists(output):
                continue
            cloud = points if isinstance(points, Cloud) else points[frame]
            camera = Camera.from_json(self.cameras[place] if self.cameras else settled["camera"])
            picture = renderer.render(cloud, camera=camera, size=pictures.size, axes=settled["axes"], **look)
            with unfinished(output, self.work) as path:
                picture.save(path)
        return len(self.files), 0
