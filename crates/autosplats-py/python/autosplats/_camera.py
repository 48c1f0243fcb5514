"""Cameras."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from . import _core
from ._convert import numbers
from ._errors import ArgumentError

Floats = npt.NDArray[np.float64]
Vector = tuple[float, float, float]
Size = tuple[int, int]
View = Literal["auto", "iso", "front", "back", "left", "right", "top", "bottom"]
Axes = Literal["z-up", "y-up", "x-up", "z-down", "y-down", "x-down", "camera"]

_USUAL_FOV = 40.0
_MAX_SIDE = 16384
#: Largest deviation of a rotation's products from those of unit vectors.
_MAX_SKEW = 1e-3


def checked_size(size: object, name: str = "size") -> Size:
    """Width and height in pixels."""
    try:
        width, height = (side.__index__() for side in size)  # type: ignore[attr-defined]
    except (TypeError, ValueError, AttributeError):
        raise TypeError(f"{name}: {size!r} given, (width, height) in whole pixels is wanted") from None
    if not (1 <= width <= _MAX_SIDE and 1 <= height <= _MAX_SIDE):
        raise ArgumentError(f"{name}: {width}x{height} given, each side must be within 1 to {_MAX_SIDE}")
    return width, height


def _vector(values: object, name: str) -> Vector:
    found = numbers(values, name)
    if found.shape != (3,):
        raise ArgumentError(f"{name}: an array of shape {found.shape} given, three numbers are wanted")
    if not np.isfinite(found).all():
        raise ArgumentError(f"{name}: {found} given, three finite numbers are wanted")
    x, y, z = (float(value) for value in found)
    return x, y, z


@dataclass(frozen=True)
class Camera:
    """Which part of the world a picture shows. Cameras do not depend on the size of a picture.

    Args:
        eye: Position of the eye, world coordinates.
        look_at: Point in the middle of the view, world coordinates; differs from the eye.
        up: Direction that is upward in the picture, of any length; not along the line of sight.
        fov: Vertical field of view in degrees, 0.01 to 170; 40 if nothing else is given.
        height: Height of the picture in world units, for parallel lines of sight, in place of `fov`.
        focal: Focal lengths along x and y as parts of the picture's width and height, in place of `fov`: those of a
            calibrated camera, see `from_matrix`.
        center: With `focal`, where the optical axis meets the picture, as parts of its width and height from the outer
            corner of the first pixel.

    Raises:
        ArgumentError: If a value is out of its range.
    """

    eye: Vector
    look_at: Vector
    up: Vector = (0.0, 0.0, 1.0)
    fov: float | None = None
    height: float | None = None
    focal: tuple[float, float] | None = None
    center: tuple[float, float] = (0.5, 0.5)

    def __post_init__(self) -> None:
        for name in ("eye", "look_at", "up"):
            object.__setattr__(self, name, _vector(getattr(self, name), name))
        if sum(value is not None for value in (self.fov, self.height, self.focal)) > 1:
            raise ArgumentError("camera: give one of fov, height and focal")
        if self.fov is None and self.height is None and self.focal is None:
            object.__setattr__(self, "fov", _USUAL_FOV)
        _core.check_camera(self.to_json())

    def to_json(self) -> str:
        """The camera as the command reads it with --camera."""
        projection: dict[str, Any]
        if self.focal is not None:
            focal, center = ([float(value) for value in pair] for pair in (self.focal, self.center))
            projection = {"pinhole": {"focal": focal, "center": center}}
        elif self.height is not None:
            projection = {"orthographic_height": float(self.height)}
        else:
            projection = {"perspective_fov_deg": float(self.fov or 0.0)}
        return json.dumps({"eye": self.eye, "look_at": self.look_at, "up": self.up, "projection": projection})

    @classmethod
    def from_json(cls, text: str) -> Camera:
        """The camera of a text that `to_json` or the command's --save-camera has written.

        Raises:
            ArgumentError: If the text is none.
        """
        try:
            read = json.loads(text)
            projection = read["projection"]
            pinhole = projection.get("pinhole", {})
            return cls(
                eye=read["eye"],
                look_at=read["look_at"],
                up=read["up"],
                fov=projection.get("perspective_fov_deg"),
                height=projection.get("orthographic_height"),
                focal=tuple(pinhole["focal"]) if pinhole else None,
                center=tuple(pinhole["center"]) if pinhole else (0.5, 0.5),
            )
        except (KeyError, AttributeError, TypeError, json.JSONDecodeError) as error:
            raise ArgumentError(f"camera: not the text of a camera ({error})") from error

    @classmethod
    def fit(
        cls,
        points: object,
        view: View = "auto",
        *,
        size: Size = (1280, 800),
        fov: float | None = None,
        orthographic: bool = False,
        axes: Axes | None = None,
    ) -> Camera:
        """A camera that sees all points from a side.

        Args:
            points: A cloud, or whatever `render` takes.
            view: The side, by the points' axes; "auto" chooses by what the points are.
            size: Width and height of the picture, of which only the ratio counts.
            fov: Vertical field of view in degrees; 40 by default.
            orthographic: Parallel lines of sight.
            axes: Which axis points up; by default what the points state, or a guess.

        Raises:
            EmptyError: If no point is finite.
        """
        from ._cloud import core_cloud

        size = checked_size(size)
        return cls.from_json(_core.fit_camera(core_cloud(points), view, size, axes, fov, orthographic))

    @classmethod
    def from_matrix(
        cls,
        world_from_camera: npt.ArrayLike,
        K: npt.ArrayLike,
        size: Size,
        *,
        convention: Literal["opencv", "opengl"] = "opencv",
    ) -> Camera:
        """The camera of a pose and of intrinsics.

        Args:
            world_from_camera: Pose (4, 4) or (3, 4): the columns are the camera's axes and its position in world
                coordinates. Many libraries give the inverse, "extrinsics".
            K: Intrinsics (3, 3) in pixels, by OpenCV's convention: the centre of the first pixel is at (0, 0). The
                axis may meet the picture anywhere, and pixels may be of any shape.
            size: Width and height in pixels of the pictures that K is of.
            convention: "opencv" for axes right, down, forward; "opengl" for right, up, backward.

        Raises:
            ArgumentError: If the pose is no rotation and translation, or K no intrinsics.
        """
        width, height = checked_size(size)
        pose = numbers(world_from_camera, "world_from_camera").astype(np.float64)
        if pose.shape not in ((4, 4), (3, 4)):
            raise ArgumentError(f"world_from_camera: shape {pose.shape} given, (4, 4) or (3, 4) is wanted")
        rotation, eye = pose[:3, :3], pose[:3, 3]
        if convention == "opengl":
            rotation = rotation * np.array([1.0, -1.0, -1.0])
        elif convention != "opencv":
            raise ArgumentError(f"convention is '{convention}', must be opencv or opengl")
        skew = np.abs(rotation.T @ rotation - np.eye(3)).max()
        if not (skew <= _MAX_SKEW and np.linalg.det(rotation) > 0):
            raise ArgumentError("world_from_camera: its upper left (3, 3) is no rotation")
        k = numbers(K, "K").astype(np.float64)
        if k.shape != (3, 3):
            raise ArgumentError(f"K: shape {k.shape} given, (3, 3) is wanted")
        fx, fy, cx, cy = k[0, 0], k[1, 1], k[0, 2], k[1, 2]
        if not (np.isfinite(k).all() and fx > 0 and fy > 0 and abs(k[0, 1]) < 1e-9 * fx):
            raise ArgumentError("K: [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] with positive focal lengths is wanted")
        down, forward = rotation[:, 1], rotation[:, 2]
        camera = cls(_vector(eye, "eye"), _vector(eye + forward, "look_at"), _vector(-down, "up"))
        if fx == fy and cx == 0.5 * width - 0.5 and cy == 0.5 * height - 0.5:
            return replace(camera, fov=float(np.degrees(2 * np.arctan(0.5 * height / fy))))
        focal = (float(fx / width), float(fy / height))
        center = (float((cx + 0.5) / width), float((cy + 0.5) / height))
        camera = replace(camera, fov=None, focal=focal, center=center)
        # Of what shape pixels are is known here.
        _core.project(camera.to_json(), (width, height), np.zeros((0, 3)))
        return camera

    def matrix(self, size: Size) -> tuple[Floats, Floats]:
        """The pose (4, 4), world from camera with axes right, down, forward, and the intrinsics (3, 3) in pixels, as
        `from_matrix` takes them.

        Raises:
            ArgumentError: If the camera is orthographic, which has no intrinsics.
        """
        width, height = checked_size(size)
        if self.height is not None:
            raise ArgumentError("camera: an orthographic camera has no intrinsics; project and unproject work")
        eye, look_at, up = (np.array(values, dtype=np.float64) for values in (self.eye, self.look_at, self.up))
        forward = (look_at - eye) / np.linalg.norm(look_at - eye)
        right = np.cross(forward, up)
        right /= np.linalg.norm(right)
        pose = np.eye(4)
        pose[:3] = np.stack([right, np.cross(forward, right), forward, eye], axis=1)
        if self.focal is not None:
            fx, fy = self.focal[0] * width, self.focal[1] * height
            cx, cy = self.center[0] * width - 0.5, self.center[1] * height - 0.5
        else:
            fx = fy = 0.5 * height / np.tan(0.5 * np.radians(self.fov or _USUAL_FOV))
            cx, cy = 0.5 * width - 0.5, 0.5 * height - 0.5
        return pose, np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])

    def project(self, points: npt.ArrayLike, size: Size) -> tuple[Floats, Floats]:
        """Where world coordinates are in a picture.

        Args:
            points: World coordinates (n, 3).
            size: Width and height of the picture in pixels.

        Returns:
            Pixels (n, 2), x and y with the centre of the first pixel at (0, 0), also beyond the picture's edges; and
            depths (n,) along the viewing axis in world units. NaN for what is not in front of the eye.
        """
        from ._convert import held

        positions = held(points).positions.astype(np.float64)
        return _core.project(self.to_json(), checked_size(size), positions)

    def unproject(self, pixels: npt.ArrayLike, depths: npt.ArrayLike, size: Size) -> Floats:
        """World coordinates (n, 3) of pixels (n, 2) at depths (n,): the reverse of `project`."""
        at, depth = numbers(pixels, "pixels").astype(np.float64), numbers(depths, "depths").astype(np.float64)
        if at.ndim != 2 or at.shape[1] != 2:
            raise ArgumentError(f"pixels: shape {at.shape} given, (n, 2) is wanted")
        if depth.shape != at.shape[:1]:
            raise ArgumentError(f"depths: shape {depth.shape} given, {at.shape[:1]} is wanted")
        return _core.unproject(self.to_json(), checked_size(size), at, depth)
