"""Pictures of points that move, and of points that a camera moves around."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from . import _core
from ._camera import Axes, Camera, Size, View, checked_size
from ._cloud import Cloud
from ._errors import ArgumentError, EmptyError
from ._files import shown
from ._job import Job, work_of
from ._play import Recording, play
from ._render import Renderer
from ._task import Task, unfinished
from ._tiles import digest

#: Most frames that the camera is placed by, and fewest points that it can be placed by.
_LOOKS, _LEAST = 5, 2
#: Usual number of consecutive pictures of a task.
_CHUNK = 16
#: Arguments of `render` that pictures share.
_LOOK = (
    "color",
    "value_range",
    "color_map",
    "legend",
    "background",
    "lighting",
    "exposure",
    "occlusion",
    "k",
    "keep_outliers",
    "settings",
    "supersample",
)


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


def frames(
    source: str | os.PathLike[str],
    output: str | os.PathLike[str],
    *,
    frames: tuple[int, int] | None = None,
    size: Size = (1280, 800),
    camera: Camera | None = None,
    view: View = "auto",
    axes: Axes | None = None,
    backend: Literal["auto", "cpu", "gpu"] = "auto",
    chunk: int = _CHUNK,
    playing: Mapping[str, Any] | None = None,
    **look: Any,
) -> Job:
    """A job that renders the frames of points that move.

    Camera, axes, exposure and the ends of the colour map are settled once, by the frames together, and are kept in a
    file beside the pictures.

    Args:
        source: A recording, a folder or a pattern of files, an animated glTF, or an animated scene.
        output: Name of the pictures with a number, such as "out/f_%05d.png".
        frames: The first and the last frame; all by default.
        size: Width and height in pixels.
        camera: The camera; by default one that sees all frames from the side `view`.
        view: The side to look from, if no camera is given.
        axes: Which axis points up.
        backend: "cpu", "gpu", or "auto".
        chunk: Number of consecutive pictures of a task.
        playing: Arguments of `autosplats.play`, such as `dict(topics=["/points"], decay=0.5)`.
        **look: Arguments of `autosplats.render`, such as `color="height"` or `legend=True`. `supersample` is 1 by
            default.

    Raises:
        ArgumentError: If an argument is out of its range.
        FileNotFoundError, FormatError, EmptyError: If the source cannot be played.
    """
    name = os.fspath(source) if "://" in os.fspath(source) or "scene:" in os.fspath(source) else os.path.abspath(source)
    options = dict(playing or {})
    count = len(play(name, **options))
    first, last = (0, count - 1) if frames is None else frames
    if not 0 <= first <= last < count:
        raise ArgumentError(f"frames: {first} to {last} given, {source} has {count} frames, 0 to {count - 1}")
    pictures = Pictures(
        source=name,
        playing=options,
        size=checked_size(size),
        view=view,
        camera=None if camera is None else camera.to_json(),
        axes=axes,
        look=_checked(look),
        backend=backend,
    )
    return _picture_job(pictures, range(first, last + 1), (), output, chunk)


def fly(
    points: str | os.PathLike[str],
    output: str | os.PathLike[str],
    cameras: Sequence[Camera],
    *,
    size: Size = (1280, 800),
    axes: Axes | None = None,
    backend: Literal["auto", "cpu", "gpu"] = "auto",
    chunk: int = _CHUNK,
    **look: Any,
) -> Job:
    """A job that renders points that do not move, with a camera for each picture.

    Args:
        points: A file, an address or a scene.
        cameras: The camera of each picture.
        output, size, axes, backend, chunk, look: As of `frames`.

    Raises:
        ArgumentError: If an argument is out of its range, or there is no camera.
    """
    if not cameras:
        raise ArgumentError("cameras: there is none; give one for each picture")
    return _picture_job(_still(points, size, axes, backend, look), range(len(cameras)), cameras, output, chunk)


def turntable(
    points: str | os.PathLike[str],
    output: str | os.PathLike[str],
    count: int,
    *,
    size: Size = (1280, 800),
    view: View = "auto",
    axes: Axes | None = None,
    backend: Literal["auto", "cpu", "gpu"] = "auto",
    chunk: int = _CHUNK,
    **look: Any,
) -> Job:
    """A job that renders points from all around: a camera that sees them all goes once around them.

    Args:
        points: A file, an address or a scene, which is read here once, to place the camera.
        count: Number of pictures, at least 1.
        view: The side of the first picture.
        output, size, axes, backend, chunk, look: As of `frames`.

    Raises:
        ArgumentError: If an argument is out of its range.
        EmptyError: If no point is finite.
    """
    if count < 1:
        raise ArgumentError(f"count is {count}, must be 1 or more")
    pictures = _still(points, size, axes, backend, look)
    cloud = Cloud._of(shown(pictures.source))
    axes = pictures.axes or _core.axes_of(cloud._core)  # type: ignore[assignment]
    start = Camera.fit(cloud, view, size=pictures.size, axes=axes)
    cameras = list(around(start, count, _up(axes)))
    return _picture_job(pictures, range(count), cameras, output, chunk)


def around(start: Camera, count: int, up: Sequence[float]) -> Iterator[Camera]:
    """Cameras on a circle about the point that the first looks at."""
    axis, middle = np.array(up, dtype=np.float64), np.array(start.look_at)
    for number in range(count):
        angle = 2 * np.pi * number / count
        cos, sin = np.cos(angle), np.sin(angle)

        def turned(vector: Any) -> tuple[float, float, float]:
            # The formula of Rodrigues.
            x, y, z = cos * vector + sin * np.cross(axis, vector) + (1 - cos) * axis * (axis @ vector)
            return float(x), float(y), float(z)

        eye = middle + np.array(turned(np.array(start.eye) - middle))
        yield Camera(tuple(eye), start.look_at, turned(np.array(start.up)), fov=start.fov, height=start.height)


def _up(axes: str | None) -> Sequence[float]:
    """The direction that points up."""
    if axes is None or axes == "camera":
        return (0.0, -1.0, 0.0)
    sign = 1.0 if axes.endswith("up") else -1.0
    return tuple(sign if name == axes[0] else 0.0 for name in "xyz")


def _still(
    points: str | os.PathLike[str],
    size: Size,
    axes: Axes | None,
    backend: Literal["auto", "cpu", "gpu"],
    look: Mapping[str, Any],
) -> Pictures:
    name = os.fspath(points)
    name = name if "://" in name or name.startswith("scene:") else os.path.abspath(name)
    return Pictures(name, None, checked_size(size), "auto", None, axes, _checked(look), backend)


def _checked(look: Mapping[str, Any]) -> dict[str, Any]:
    unknown = [name for name in look if name not in _LOOK]
    if unknown:
        raise TypeError(f"{unknown[0]}: there is no such argument; there are {', '.join(_LOOK)}")
    averaged = (look.get("settings") or {}).get("frames_averaged", 1)
    if averaged != 1:
        raise ArgumentError("settings: with frames_averaged a picture depends on earlier ones, which other tasks render")
    return {"supersample": 1, **look}


def _picture_job(
    pictures: Pictures, numbers: range, cameras: Sequence[Camera], output: str | os.PathLike[str], chunk: int
) -> Job:
    pattern = os.path.abspath(output)
    try:
        files = [(number, pattern % number) for number in numbers]
    except (TypeError, ValueError) as error:
        raise ArgumentError(f"output is '{output}', must be a name with one number, such as f_%05d.png") from error
    if len({path for _, path in files}) < len(files) or any(os.path.dirname(pattern) != os.path.dirname(path) for _, path in files):
        raise ArgumentError(f"output is '{output}', must be a name with one number, such as f_%05d.png")
    if chunk < 1:
        raise ArgumentError(f"chunk is {chunk}, must be 1 or more")
    # A sequence's name is a pattern.
    plain = os.path.splitext(pattern)[0]
    manifest, settled = Path(plain + ".job.jsonl"), plain + ".settled.json"
    work = str(work_of(manifest))
    stamp = _stamp(pictures.source)
    texts = tuple(camera.to_json() for camera in cameras)
    points = 0
    if pictures.playing is None and not pictures.source.startswith("scene:"):
        points = int(_core.outline(pictures.source)["points"] or 0)
    settle = SettleTask(
        name="settling",
        points=points,
        inputs=stamp,
        work=work,
        pictures=pictures,
        first=numbers[0],
        last=numbers[-1],
        camera=texts[0] if texts else None,
        settled=settled,
    )
    tasks = []
    for start in range(0, len(files), chunk):
        part = tuple(files[start : start + chunk])
        name = f"{part[0][0]}..{part[-1][0]}"
        own = texts[start : start + chunk]
        inputs = digest([stamp, own])
        tasks.append(FramesTask(name, points, inputs, work, pictures, part, own, settled))
    settings = {
        "source": pictures.source,
        "playing": pictures.playing,
        "size": pictures.size,
        "view": pictures.view,
        "camera": pictures.camera,
        "axes": pictures.axes,
        "look": pictures.look,
        "backend": pictures.backend,
    }
    return Job("frames", settings, manifest, [[settle], tasks], unit="pictures")


def _stamp(source: str) -> str:
    """Size and time of a file, or of what a folder has."""
    if not os.path.exists(source):
        return ""
    paths = [source]
    if os.path.isdir(source):
        paths += sorted(entry.path for entry in os.scandir(source))
    return digest([[path, os.stat(path).st_size, os.stat(path).st_mtime_ns] for path in paths])



