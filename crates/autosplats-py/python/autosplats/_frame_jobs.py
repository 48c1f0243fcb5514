"""Jobs of pictures: of points that move, and of points that a camera moves around."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from . import _core
from ._camera import Axes, Camera, Size, View, checked_size
from ._cloud import Cloud
from ._errors import ArgumentError
from ._files import shown
from ._frame_tasks import FramesTask, Pictures, SettleTask
from ._job import Job, work_of
from ._play import play
from ._task import digest

#: Most consecutive pictures of a task, and number of tasks that is enough for many machines.
_CHUNK, _TASKS = 16, 64
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
    chunk: int | None = None,
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
        chunk: Number of consecutive pictures of a task; by default up to 16, so that there are 64 tasks if there are as
            many pictures.
        playing: Arguments of `autosplats.play`, such as `dict(topics=["/points"], decay=0.5)`.
        **look: Arguments of `autosplats.render`, such as `color="height"` or `legend=True`. `supersample` is 1 by
            default.

    Raises:
        ArgumentError: If an argument is out of its range.
        FileNotFoundError, FormatError, EmptyError: If the source cannot be played.
    """
    name = _absolute(source)
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
    chunk: int | None = None,
    **look: Any,
) -> Job:
    """A job that renders points that do not move, with a camera for each picture.

    Args:
        points: A file, an address or a scene.
        cameras: The camera of each picture.
        output, size, axes, backend, look: As of `frames`.
        chunk: As of `frames`, but 16 by default, since each task reads all points.

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
    chunk: int | None = None,
    **look: Any,
) -> Job:
    """A job that renders points from all around: a camera that sees them all goes once around them.

    Args:
        points: A file, an address or a scene, which is read here once, to place the camera.
        count: Number of pictures, at least 1.
        view: The side of the first picture.
        output, size, axes, backend, look: As of `frames`.
        chunk: As of `frames`, but 16 by default, since each task reads all points.

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
        # The formula of Rodrigues, for the sight and for the direction that is up.
        vectors = np.array([start.eye - middle, start.up])
        along = np.outer(vectors @ axis, axis)
        sight, above = cos * vectors + sin * np.cross(axis, vectors) + (1 - cos) * along
        yield replace(start, eye=tuple(middle + sight), up=tuple(above))


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
    return Pictures(_absolute(points), None, checked_size(size), "auto", None, axes, _checked(look), backend)


def _absolute(source: str | os.PathLike[str]) -> str:
    """The name of a source, wherever a task runs."""
    name = os.fspath(source)
    return name if "://" in name or name.startswith("scene:") else os.path.abspath(name)


def _checked(look: Mapping[str, Any]) -> dict[str, Any]:
    unknown = [name for name in look if name not in _LOOK]
    if unknown:
        raise TypeError(f"{unknown[0]}: there is no such argument; there are {', '.join(_LOOK)}")
    averaged = (look.get("settings") or {}).get("frames_averaged", 1)
    if averaged != 1:
        raise ArgumentError("settings: with frames_averaged pictures depend on earlier ones, of other tasks")
    return {"supersample": 1, **look}


def _picture_job(
    pictures: Pictures, numbers: range, cameras: Sequence[Camera], output: str | os.PathLike[str], chunk: int | None
) -> Job:
    folder, name = os.path.split(os.path.abspath(output))
    if re.fullmatch(r"[^%]*%0?\d*d[^%]*", name) is None:
        raise ArgumentError(f"output is '{output}', must be a name with a number, such as f_%05d.png")
    files = [(number, os.path.join(folder, name % number)) for number in numbers]
    if chunk is None:
        chunk = _CHUNK if pictures.playing is None else max(1, min(_CHUNK, len(files) // _TASKS))
    if chunk < 1:
        raise ArgumentError(f"chunk is {chunk}, must be 1 or more")
    plain = os.path.join(folder, os.path.splitext(name)[0])
    manifest, settled = Path(plain + ".job.jsonl"), plain + ".settled.json"
    work = str(work_of(manifest))
    texts = tuple(camera.to_json() for camera in cameras)
    points = 0
    if pictures.playing is None and not pictures.source.startswith("scene:"):
        points = int(_core.outline(pictures.source)["points"] or 0)
    settle = SettleTask(
        name="settling",
        points=points,
        inputs="",
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
        span = f"{part[0][0]}..{part[-1][0]}"
        tasks.append(FramesTask(span, points, "", work, pictures, part, texts[start : start + chunk], settled))
    settings = {
        "source": pictures.source,
        "playing": pictures.playing,
        "size": pictures.size,
        "view": pictures.view,
        "camera": pictures.camera,
        "axes": pictures.axes,
        "look": pictures.look,
        "backend": pictures.backend,
        # A recording may grow: its pictures stay as they are.
        "stamp": _stamp(pictures.source) if pictures.playing is None else "",
        "cameras": digest(texts),
    }
    return Job("frames", settings, manifest, [[settle], tasks], unit="pictures")


def _stamp(source: str) -> str:
    """Size and time of a file."""
    if not os.path.isfile(source):
        return ""
    found = os.stat(source)
    return f"{found.st_size} {found.st_mtime_ns}"
