"""Points in whatever form they are held, to arrays. Libraries are told by what their objects look like, so that none is
imported."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ._errors import ArgumentError

Array = npt.NDArray[Any]

#: Fields by the names that files and libraries use, in small letters, and as they are called here.
_FIELD_NAMES = {
    "intensity": "Intensity",
    "intensities": "Intensity",
    "reflectance": "Reflectance",
    "classification": "Classification",
    "gps_time": "GpsTime",
    "return_number": "ReturnNumber",
    "number_of_returns": "NumberOfReturns",
    "point_source_id": "PointSourceId",
    "user_data": "UserData",
    "nx": "NormalX",
    "ny": "NormalY",
    "nz": "NormalZ",
    "normal_x": "NormalX",
    "normal_y": "NormalY",
    "normal_z": "NormalZ",
    "curvature": "Curvature",
}
_COLOR_NAMES = (("red", "green", "blue"), ("r", "g", "b"))
#: Devices of DLPack whose memory the processor reads: its own, and pinned memory.
_CPU_DEVICES = (1, 3, 11)
_BITS_OF_16 = 65535


class Held(NamedTuple):
    """Points as arrays."""

    positions: Array
    colors: Array | None
    fields: list[tuple[str, Array]]


def held(points: object, name: str = "points") -> Held:
    """The arrays in an object that holds points."""
    if isinstance(points, (str, bytes, os.PathLike)):
        raise TypeError(f"{name}: {type(points).__name__} given, points are wanted; autosplats.read reads a file")
    if isinstance(points, np.ndarray):
        if points.dtype.names is not None:
            return _columns({field: points[field] for field in points.dtype.names}, name)
        return Held(_positions(points, name), None, [])
    if isinstance(points, Mapping):
        return _columns(points, name)
    if hasattr(points, "columns") and not callable(points.columns) and hasattr(points, "__getitem__"):
        # Data frames: pandas, polars.
        columns = {str(column): points[column] for column in points.columns}
        if _axes(columns) is not None:
            return _columns(columns, name)
    elif hasattr(points, "xyz") and hasattr(points, "point_format"):
        return _of_laspy(points, name)
    elif hasattr(points, "points") and hasattr(points, "point_data"):
        return _of_pyvista(points, name)
    elif hasattr(points, "point") and hasattr(points.point, "positions"):
        return _of_open3d_tensor(points, name)
    elif hasattr(points, "points") and hasattr(points, "has_colors"):
        return _of_open3d(points, name)
    elif hasattr(points, "vertices"):
        # Meshes and clouds of trimesh.
        return Held(_positions(points.vertices, name), None, [])
    return Held(_positions(points, name), None, [])


def array(values: object, name: str) -> Array:
    """An array of what numpy takes, a view where it can be. Arrays of other devices are refused: copying them is the
    caller's choice."""
    if getattr(values, "requires_grad", False) and hasattr(values, "detach"):
        values = values.detach()
    if _is_elsewhere(values):
        kind = f"{type(values).__module__.partition('.')[0]}.{type(values).__name__}"
        raise TypeError(
            f"{name}: the values of this {kind} are in the memory of a graphics card; copy them first, "
            "as tensor.cpu() or cupy.asnumpy(array) do"
        )
    if type(values).__module__.startswith("numpy.ma"):
        # Masked points have no position. Asking numpy.ma itself would import it, also in a process that was forked
        # while another thread was doing so, which waits for ever.
        return np.asarray(np.ma.filled(np.ma.asarray(values, dtype=np.float64), np.nan))
    try:
        return np.asarray(values)
    except (ValueError, TypeError, RuntimeError) as error:
        raise TypeError(f"{name}: {type(values).__name__} given, an array of numbers is wanted ({error})") from error


def _is_elsewhere(values: object) -> bool:
    """Whether the values are in memory that the processor does not read."""
    if isinstance(values, np.ndarray):
        return False
    try:
        if hasattr(values, "__cuda_array_interface__"):
            return True
        device = getattr(values, "__dlpack_device__", None)
        return callable(device) and int(device()[0]) not in _CPU_DEVICES
    except (ValueError, TypeError, RuntimeError, BufferError):
        # Tensors without memory have no device; why they are no array is what numpy is told.
        return False


def numbers(values: object, name: str) -> Array:
    """An array of numbers in this machine's order of bytes, aligned in memory."""
    found = array(values, name)
    if found.dtype.kind not in "fiu":
        raise TypeError(f"{name}: {found.dtype} given, numbers are wanted")
    return np.require(found.astype(found.dtype.newbyteorder("="), copy=False), requirements="A")


def _positions(values: object, name: str) -> Array:
    """Positions as (n, 3) of float32 or float64."""
    found = numbers(values, name)
    if found.ndim != 2 or found.shape[1] != 3:
        raise ArgumentError(f"{name}: {_shape(found)} given, (n, 3) is wanted{_hint(found, name)}")
    if found.dtype in (np.float32, np.float64):
        return found
    # Half floats are exact in single ones; whole numbers and long floats need all digits there are.
    return found.astype(np.float32 if found.dtype == np.float16 else np.float64)


def _hint(found: Array, name: str) -> str:
    if found.ndim == 2 and found.shape[0] == 3:
        return f"; {name}.T has a point per row"
    if found.ndim == 2 and found.shape[1] > 3:
        return f"; {name}[:, :3] leaves out what is not a position"
    if found.ndim == 3 and found.shape[2] == 3:
        return f"; {name}.reshape(-1, 3) has a point per row"
    return ""


def _shape(found: Array) -> str:
    return f"an array of shape {found.shape}"


def bytes_of(colors: object, count: int, name: str = "colors") -> Array:
    """Colours as (n, 3) or (n, 4) of bytes: bytes as they are, floats of 0 to 1, and numbers of 16 bits."""
    found = numbers(colors, name)
    if found.ndim != 2 or found.shape[1] not in (3, 4) or found.shape[0] != count:
        raise ArgumentError(f"{name}: {_shape(found)} given, ({count}, 3) or ({count}, 4) is wanted")
    if found.dtype == np.uint8 or not len(found):
        return found.astype(np.uint8, copy=False)
    if found.dtype.kind == "f":
        _within(found, 1, name, "floats", "; 0 to 255 are colours as uint8")
        return np.asarray(np.rint(found * np.float32(255)), dtype=np.uint8)
    if found.dtype == np.uint16:
        return np.asarray((found.astype(np.uint32) * 255 + _BITS_OF_16 // 2) // _BITS_OF_16, dtype=np.uint8)
    _within(found, 255, name, "whole numbers", "; 16 bits are colours as uint16")
    return found.astype(np.uint8)


def _within(found: Array, most: int, name: str, kind: str, hint: str) -> None:
    low, high = found.min(), found.max()
    # NaN fails the comparison.
    if not (low >= 0 and high <= most):
        raise ArgumentError(f"{name}: {kind} from {low} to {high} given, 0 to {most} are wanted{hint}")


def field(values: object, count: int, name: str) -> Array:
    """Values of a field: one number per point."""
    found = array(values, f"field {name}")
    if found.dtype == np.bool_:
        found = found.astype(np.uint8)
    elif found.dtype == np.float16:
        found = found.astype(np.float32)
    elif found.dtype.kind == "f" and found.dtype.itemsize > 8:
        found = found.astype(np.float64)
    found = numbers(found, f"field {name}")
    if found.shape != (count,):
        raise ArgumentError(f"field {name}: {_shape(found)} given, ({count},) is wanted")
    return found


def field_name(name: str) -> str:
    """The name of a field as files call it."""
    return _FIELD_NAMES.get(name.lower(), name)


def _axes(columns: Mapping[str, object]) -> tuple[str, str, str] | None:
    """The columns of the positions, in any letter case."""
    return _three(columns, ("x", "y", "z"))


def _three(columns: Mapping[str, object], names: tuple[str, str, str]) -> tuple[str, str, str] | None:
    small = {str(column).lower(): column for column in columns}
    x, y, z = names
    return (small[x], small[y], small[z]) if all(name in small for name in names) else None


def _columns(columns: Mapping[str, Any], name: str) -> Held:
    """Points by the names of their values: x, y, z, colours, and fields."""
    left = dict(columns)
    axes = _axes(left)
    if axes is None:
        whole = next((key for key in ("points", "positions", "xyz", "position") if key in left), None)
        if whole is None:
            listed = ", ".join(map(str, columns)) or "nothing"
            raise ArgumentError(f"{name}: {listed} given, fields x, y and z are wanted")
        positions = _positions(left.pop(whole), name)
    else:
        parts = [numbers(left.pop(axis), f"{name}: {axis}").reshape(-1) for axis in axes]
        if len({len(part) for part in parts}) > 1:
            raise ArgumentError(f"{name}: x, y and z have {', '.join(str(len(part)) for part in parts)} values")
        positions = _positions(np.stack(parts, axis=1), name)
    count = len(positions)
    colors = None
    for names in _COLOR_NAMES:
        three = _three(left, names)
        if three is not None:
            channels = [numbers(left.pop(channel), f"{name}: {channel}").reshape(-1) for channel in three]
            colors = bytes_of(_eight_bits(np.stack(channels, axis=1)), count)
            break
    fields = []
    for key, values in left.items():
        found = array(values, f"field {key}")
        small = str(key).lower()
        if small in ("rgb", "rgba") and found.ndim == 1 and found.dtype.itemsize == 4 and colors is None:
            colors = _unpacked(found)
        elif small in ("rgb", "rgba", "colors", "color") and found.ndim == 2 and colors is None:
            colors = bytes_of(found, count)
        elif small in ("normals", "normal") and found.shape == (count, 3):
            fields += [(f"Normal{axis}", field(found[:, i], count, str(key))) for i, axis in enumerate("XYZ")]
        elif found.shape in ((count,), (count, 1)) and found.dtype.kind in "fiub":
            fields.append((field_name(str(key)), field(found.reshape(-1), count, str(key))))
    return Held(positions, colors, fields)


def _eight_bits(colors: Array) -> Array:
    """Channels of 16 bits of which only the lower eight are used, as many writers do, are bytes."""
    if colors.dtype == np.uint16 and len(colors) and colors.max() <= 255:
        return colors.astype(np.uint8)
    return colors


def _unpacked(packed: Array) -> Array:
    """Colours of 0xrrggbb in four bytes, whatever their type is said to be, as PCL and ROS pack them."""
    bits = np.ascontiguousarray(packed.astype(packed.dtype.newbyteorder("="), copy=False)).view(np.uint32)
    return np.stack([bits >> 16 & 255, bits >> 8 & 255, bits & 255], axis=1).astype(np.uint8)


def _of_laspy(points: Any, name: str) -> Held:
    columns = {dimension: np.asarray(points[dimension]) for dimension in points.point_format.dimension_names}
    for axis in "XYZ":
        # Whole numbers, of which x, y and z are made.
        columns.pop(axis, None)
    return _columns({"xyz": points.xyz, **columns}, name)


def _of_pyvista(points: Any, name: str) -> Held:
    data = {key: points.point_data[key] for key in points.point_data}
    return _columns({"points": points.points, **data}, name)


def _of_open3d(points: Any, name: str) -> Held:
    columns: dict[str, object] = {"points": np.asarray(points.points)}
    if points.has_colors():
        columns["colors"] = np.asarray(points.colors)
    if points.has_normals():
        columns["normals"] = np.asarray(points.normals)
    return _columns(columns, name)


def _of_open3d_tensor(points: Any, name: str) -> Held:
    columns = {}
    for key in points.point:
        values = points.point[key]
        if "cuda" in str(getattr(values, "device", "")).lower():
            raise TypeError(
                f"{name}: these points are in the memory of a graphics card; points.cpu() copies them to the processor"
            )
        columns["points" if key == "positions" else key] = values.numpy()
    return _columns(columns, name)
