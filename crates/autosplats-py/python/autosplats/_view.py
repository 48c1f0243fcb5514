"""A view in a notebook that turns with the mouse."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._camera import Camera, Size, checked_size
from ._cloud import Cloud, core_cloud
from ._picture import Picture
from ._render import Backend, Renderer

#: Most points of a picture while the view moves; more are thinned.
_MOVING_POINTS = 1_000_000
#: Share of the picture's width and height that is rendered while the view moves.
_MOVING_SCALE = 0.6
#: Degrees that the view turns by as the mouse crosses the picture's height.
_TURN_DEGREES = 180.0
_MAX_PITCH = np.radians(89.0)

Floats = npt.NDArray[np.float64]


class Orbit:
    """A camera that turns about a point, and pictures of what it sees. The view of a notebook is one, with a mouse."""

    def __init__(
        self,
        points: object,
        colors: object = None,
        *,
        size: Size = (800, 500),
        camera: Camera | None = None,
        backend: Backend = "auto",
        device: int | str | None = None,
        **options: Any,
    ) -> None:
        self.size = checked_size(size)
        self._cloud = Cloud._of(core_cloud(points, colors))
        self._few = _thinned(self._cloud)
        self._renderer = Renderer(backend, device=device)
        self._options = options
        first = camera or Camera.fit(self._cloud, options.pop("view", "auto"), size=self.size, axes=options.get("axes"))
        if first.focal is not None:
            # A calibrated camera is of one picture; the view turns, so that its lens is in the middle.
            first = replace(first, focal=None, fov=float(np.degrees(2 * np.arctan(0.5 / first.focal[1]))))
        self._first = first
        self.reset()

    def reset(self) -> None:
        """Goes back to the first view."""
        self.camera = self._first
        self._up = _unit(np.array(self._first.up))

    def turn(self, right: float, down: float) -> None:
        """Turns the points with the mouse, which moves by these parts of the picture's height."""
        eye, pivot = np.array(self.camera.eye), np.array(self.camera.look_at)
        offset = eye - pivot
        distance = float(np.linalg.norm(offset))
        side = _unit(np.cross(self._up, offset))
        if not np.isfinite(side).all():
            side = _unit(np.cross(np.roll(self._up, 1), self._up))
        level = np.cross(side, self._up)
        pitch = np.arctan2(offset @ self._up, offset @ level) + np.radians(_TURN_DEGREES) * down
        pitch = np.clip(pitch, -_MAX_PITCH, _MAX_PITCH)
        yaw = -np.radians(_TURN_DEGREES) * right
        ahead = np.cos(yaw) * level + np.sin(yaw) * side
        eye = pivot + distance * (np.cos(pitch) * ahead + np.sin(pitch) * self._up)
        self.camera = replace(self.camera, eye=tuple(eye), up=tuple(self._up))

    def pan(self, right: float, down: float) -> None:
        """Moves the points with the mouse, by these parts of the picture's height."""
        eye, pivot = np.array(self.camera.eye), np.array(self.camera.look_at)
        forward = pivot - eye
        height = self.camera.height or 2.0 * float(np.linalg.norm(forward)) * np.tan(
            0.5 * np.radians(self.camera.fov or 40.0)
        )
        side = _unit(np.cross(forward, self._up))
        under = _unit(np.cross(forward, side))
        shift = -height * (right * side + down * under)
        self.camera = replace(self.camera, eye=tuple(eye + shift), look_at=tuple(pivot + shift))

    def zoom(self, factor: float) -> None:
        """Goes nearer by a factor above 1, or away by one below."""
        factor = float(np.clip(factor, 0.1, 10.0))
        if self.camera.height is not None:
            self.camera = replace(self.camera, height=self.camera.height / factor)
            return
        eye, pivot = np.array(self.camera.eye), np.array(self.camera.look_at)
        self.camera = replace(self.camera, eye=tuple(pivot + (eye - pivot) / factor))

    def picture(self, moving: bool = False) -> Picture:
        """What the camera sees: at once and smaller while the view moves, else as `render` shows it."""
        width, height = self.size
        if not moving:
            return self._renderer.render(self._cloud, size=self.size, camera=self.camera, **self._options)
        size = (max(1, round(width * _MOVING_SCALE)), max(1, round(height * _MOVING_SCALE)))
        options = {**self._options, "supersample": 1}
        return self._renderer.render(self._few, size=size, camera=self.camera, **options)


def _unit(vector: Floats) -> Floats:
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(vector / np.linalg.norm(vector), dtype=np.float64)


def _thinned(cloud: Cloud) -> Cloud:
    """At most so many points that pictures keep up with a mouse, chosen at random and always the same."""
    if len(cloud) <= _MOVING_POINTS:
        return cloud
    keep = np.random.default_rng(0).random(len(cloud), dtype=np.float32) < _MOVING_POINTS / len(cloud)
    return cloud[keep]


def view(
    points: object,
    colors: object = None,
    *,
    size: Size = (800, 500),
    camera: Camera | None = None,
    backend: Backend = "auto",
    device: int | str | None = None,
    **options: Any,
) -> Any:
    """A view in a notebook: turns with the left button, moves with the right one or with Shift, zooms with the wheel; a
    double click goes back.

    It needs anywidget (`pip install autosplats[jupyter]`); without it the result is a picture. While the view moves,
    pictures are smaller and show at most a million points.

    Args:
        points, colors, camera, backend, device: As in `render`.
        size: Width and height in pixels.
        options: Further arguments of `render`, such as `color="height"`.

    Returns:
        A widget, whose `orbit` has the camera; without anywidget a `Picture`.
    """
    orbit = Orbit(points, colors, size=size, camera=camera, backend=backend, device=device, **options)
    try:
        import anywidget
        import traitlets
    except ImportError:
        return orbit.picture()

    class View(anywidget.AnyWidget):
        """The widget."""

        _esm = Path(__file__).with_name("_view.js").read_text()
        width = traitlets.Int(orbit.size[0]).tag(sync=True)
        height = traitlets.Int(orbit.size[1]).tag(sync=True)

    widget = View()
    widget.orbit = orbit
    widget.on_msg(lambda sender, message, buffers: _answer(sender, orbit, message))
    return widget


def _answer(widget: Any, orbit: Orbit, message: dict[str, Any]) -> None:
    """Does what the mouse has done, and sends the picture."""
    for name, values in message.get("moves", ()):
        if name in ("turn", "pan", "zoom", "reset"):
            getattr(orbit, name)(*values)
    moving = bool(message.get("moving"))
    picture = orbit.picture(moving)
    kind = "jpg" if moving else "png"
    data = _core.encode_picture(picture.array, "jpg") if moving else picture.encode("png")
    widget.send({"kind": kind}, buffers=[data])
