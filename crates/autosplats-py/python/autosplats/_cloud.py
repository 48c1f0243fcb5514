"""Clouds."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from . import _core
from ._camera import Axes, Vector, _vector
from ._convert import array, bytes_of, field, field_name, held
from ._errors import ArgumentError
from ._progress import ProgressLike, reporting
from ._threads import checked

Array = npt.NDArray[Any]


class Scan(NamedTuple):
    """Points that one sensor saw from one place."""

    #: Name in the file.
    name: str | None
    #: Pose (4, 4) of the sensor, world from sensor.
    world_from_sensor: npt.NDArray[np.float64]
    #: The first of its points, and the one behind its last.
    start: int
    stop: int


class Crs(NamedTuple):
    """The coordinate system that a file states."""

    name: str | None
    epsg: int | None
    #: Complete definition as well-known text.
    wkt: str | None
    #: Unit of x and y: "metre", "foot", "degree" ...
    unit: str | None


class Cloud:
    """Points and their attributes, which do not change.

    Positions are float32 about an origin in float64, so that survey coordinates keep their digits. Arrays of this class
    are read-only views of its memory. Clouds can be pickled, indexed by masks, numbers and slices, and given to every
    function that takes points.

    Args:
        points: Positions (n, 3) of any type of number, in world coordinates; or a structured array, a mapping, a data
            frame, a tensor, or an object of Open3D, laspy or PyVista, whose attributes are taken too.
        colors: Colours (n, 3) or (n, 4) of uint8, of floats from 0 to 1, or of uint16.
        fields: Further values by name, each (n,), such as "Intensity" or "Classification".
        axes: Which axis points up, such as "z-up"; None if it is unknown.
        sensor: Position (3,) from which the points were seen, in world coordinates.
        crs: Coordinate system as well-known text.
        exact: Keep what float32 loses, in 12 bytes a point more if it loses anything: coordinates then have 48 binary
            digits about the origin, which are all digits of a survey.

    Raises:
        ArgumentError: If shapes do not fit, or colours are out of their range.
        TypeError: If something is no array of numbers, or lies in the memory of a graphics card.
        OutOfMemoryError: If there are more points than memory, or than 4,294,967,294.
    """

    __slots__ = ("_core", "_fields")

    def __init__(
        self,
        points: object,
        colors: npt.ArrayLike | None = None,
        *,
        fields: Mapping[str, npt.ArrayLike] | None = None,
        axes: Axes | None = None,
        sensor: npt.ArrayLike | None = None,
        crs: str | None = None,
        exact: bool = True,
    ) -> None:
        self._core = _core_of(points, colors, fields, axes, sensor, crs, exact)
        self._fields: Mapping[str, Array] | None = None

    @classmethod
    def _of(cls, core: _core.Cloud) -> Cloud:
        cloud = cls.__new__(cls)
        cloud._core = core
        cloud._fields = None
        return cloud

    def __len__(self) -> int:
        return len(self._core)

    @property
    def positions(self) -> npt.NDArray[np.float32]:
        """Positions (n, 3) about the origin: a view."""
        return self._core.positions

    @property
    def origin(self) -> npt.NDArray[np.float64]:
        """Origin (3,) of the positions in world coordinates."""
        return np.array(self._core.origin)

    @property
    def xyz(self) -> npt.NDArray[np.float64]:
        """World coordinates (n, 3): a new array."""
        return self._core.xyz()

    @property
    def colors(self) -> npt.NDArray[np.uint8] | None:
        """Colours (n, 3), sRGB: a view; None if the points have none."""
        return self._core.colors

    @property
    def fields(self) -> Mapping[str, Array]:
        """Further values by name, each (n,): views."""
        if self._fields is None:
            self._fields = MappingProxyType({name: self._core.field(name) for name in self._core.field_names})
        return self._fields

    def field(self, name: str) -> Array:
        """Values (n,) of a field, in any letter case of its name: a view.

        Raises:
            MissingFieldError: If there is none of this name.
        """
        return self._core.field(name)

    @property
    def bounds(self) -> npt.NDArray[np.float64] | None:
        """The least and the largest finite world coordinates (2, 3); None without a finite point."""
        ends = self._core.bounds()
        return None if ends is None else np.array(ends)

    @property
    def axes(self) -> str | None:
        """Which axis points up, if it is known."""
        return self._core.axes

    @property
    def scans(self) -> Sequence[Scan]:
        """Which points were seen from where, as far as it is known."""
        return tuple(Scan(name, np.array(pose), *points) for name, pose, points in self._core.scans)

    @property
    def crs(self) -> Crs:
        """The coordinate system, as far as it is known."""
        return Crs(*self._core.crs)

    @property
    def nbytes(self) -> int:
        """Size in memory, in bytes."""
        return self._core.nbytes

    def __getitem__(self, which: Any) -> Cloud:
        """The points of a mask (n,) of bool, of numbers, or of a slice. Scans are kept while points keep their order."""
        if isinstance(which, slice):
            start, stop, step = which.indices(len(self))
            if step > 0:
                mask = np.zeros(len(self), dtype=bool)
                mask[start:stop:step] = True
                return self._of(self._core.masked(mask))
            which = np.arange(len(self))[which]
        chosen = array(which, "index")
        if chosen.dtype == np.bool_:
            return self._of(self._core.masked(np.ascontiguousarray(chosen.reshape(-1))))
        if chosen.ndim != 1 or chosen.dtype.kind not in "iu":
            raise TypeError(f"index: {chosen.dtype} of shape {chosen.shape} given, a mask, numbers or a slice is wanted")
        state = self._core.state()
        for name in ("positions", "residuals", "colors"):
            if state[name] is not None:
                state[name] = np.ascontiguousarray(state[name][chosen])
        state["fields"] = [(name, np.ascontiguousarray(values[chosen])) for name, values in state["fields"]]
        state["scans"] = []
        return self._of(_core.Cloud.of_state(**state))

    def with_field(self, name: str, values: npt.ArrayLike) -> Cloud:
        """The same points with a field more, or with another in place of the one of this name."""
        return self._of(self._core.with_field(field_name(name), field(values, len(self), name)))

    def with_normals(self, normals: tuple[npt.ArrayLike, npt.ArrayLike, npt.ArrayLike]) -> Cloud:
        """The same points with the result of `estimate_normals` as fields NormalX, NormalY, NormalZ, Curvature and
        DensityRadius."""
        directions, curvature, radius = normals
        rows = array(directions, "normals")
        if rows.shape != (len(self), 3):
            raise ArgumentError(f"normals: shape {rows.shape} given, ({len(self)}, 3) is wanted")
        cloud = self
        values = [*(rows[:, axis] for axis in range(3)), curvature, radius]
        for name, value in zip(("NormalX", "NormalY", "NormalZ", "Curvature", "DensityRadius"), values):
            cloud = cloud.with_field(name, value)
        return cloud

    def thin(self, voxel: float, *, progress: ProgressLike = None, num_threads: int | None = None) -> Cloud:
        """One point per occupied cube with edges of `voxel` world units: the one nearest to the mean of its points.

        Raises:
            ArgumentError: If `voxel` is not above 0.
        """
        with reporting(progress, "thinning") as report:
            return self._of(self._core.thinned(float(voxel), checked(num_threads), report))

    @staticmethod
    def merge(clouds: Sequence[object]) -> Cloud:
        """All clouds as one. Fields are kept that all have; points without colours beside others with colours become
        grey."""
        return Cloud._of(_core.Cloud.merged([core_cloud(cloud, exact=True) for cloud in clouds]))

    def to_structured(self) -> Array:
        """A structured array (n,): x, y, z of float64 in world coordinates, red, green, blue, and the fields."""
        names = [("x", "f8"), ("y", "f8"), ("z", "f8")]
        colors = self.colors
        if colors is not None:
            names += [("red", "u1"), ("green", "u1"), ("blue", "u1")]
        taken = {name for name, _ in names}
        kept = {name: values for name, values in self.fields.items() if name.lower() not in taken}
        rows = np.empty(len(self), dtype=[*names, *((name, values.dtype) for name, values in kept.items())])
        xyz = self.xyz
        for axis, name in enumerate("xyz"):
            rows[name] = xyz[:, axis]
        if colors is not None:
            for channel, name in enumerate(("red", "green", "blue")):
                rows[name] = colors[:, channel]
        for name, values in kept.items():
            rows[name] = values
        return rows

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> Array:
        """World coordinates (n, 3)."""
        if copy is False:
            raise ValueError("world coordinates are made anew; positions is a view")
        return self.xyz if dtype is None else self.xyz.astype(dtype, copy=False)

    def __iter__(self) -> Iterator[Any]:
        raise TypeError("a cloud is not iterable; iterate over cloud.xyz or cloud.positions")

    def __reduce__(self) -> tuple[Callable[..., Cloud], tuple[dict[str, Any]]]:
        return _unpickled, (self._core.state(),)

    def __repr__(self) -> str:
        has = [] if self.colors is None else ["colors"]
        has += self._core.field_names
        return f"<autosplats.Cloud of {len(self)} points{' with ' if has else ''}{', '.join(has)}>"

    def _repr_png_(self) -> bytes | None:
        """A picture, as notebooks show it."""
        from ._errors import EmptyError
        from ._render import render

        try:
            return render(self, size=(640, 400))._repr_png_()
        except EmptyError:
            return None


def _unpickled(state: dict[str, Any]) -> Cloud:
    return Cloud._of(_core.Cloud.of_state(**state))


def _core_of(
    points: object,
    colors: object,
    fields: Mapping[str, object] | None,
    axes: str | None,
    sensor: object,
    crs: str | None,
    exact: bool,
) -> _core.Cloud:
    found = held(points)
    count = len(found.positions)
    own = found.colors if colors is None else bytes_of(colors, count)
    named = dict(found.fields)
    for name, values in (fields or {}).items():
        named[field_name(name)] = field(values, count, name)
    scans = []
    if sensor is not None:
        x, y, z = _vector(sensor, "sensor")
        pose = [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, y], [0.0, 0.0, 1.0, z], [0.0, 0.0, 0.0, 1.0]]
        scans.append((None, pose, (0, count)))
    return _core.Cloud(found.positions, own, list(named.items()), axes, scans, crs, exact)


def core_cloud(
    points: object, colors: object = None, *, sensor: Vector | None = None, exact: bool = False, name: str = "points"
) -> _core.Cloud:
    """The native cloud of whatever holds points: a cloud, an object, or the name of a source."""
    if isinstance(points, Cloud):
        if colors is not None:
            raise ArgumentError("colors: a cloud has its own; make one as Cloud(cloud.xyz, colors)")
        return points._core
    if isinstance(points, (str, os.PathLike)):
        if colors is not None:
            raise ArgumentError("colors: a file has its own; read it, and make a cloud as Cloud(cloud.xyz, colors)")
        from ._files import shown

        return shown(points)
    return _core_of(points, colors, None, None, sensor, None, exact)
