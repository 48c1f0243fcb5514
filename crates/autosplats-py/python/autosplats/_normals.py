"""Normals."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from . import _core
from ._camera import _vector
from ._cloud import core_cloud
from ._errors import ArgumentError
from ._progress import ProgressLike, reporting
from ._threads import checked

Floats = npt.NDArray[np.float32]


class Normals(NamedTuple):
    """One of each per point, in the points' order. NaN for points that are not finite."""

    #: Unit vectors (n, 3).
    normals: Floats
    #: Surface variation (n,): 0 where flat, to 1/3.
    curvature: Floats
    #: Twice the radius (n,) of the circle that a neighbour covers on average, in world units.
    radius: Floats


def estimate_normals(
    points: object,
    k: int = 10,
    *,
    orient: Literal["auto", "sensor", "up", "outward"] = "auto",
    sensor: npt.ArrayLike | None = None,
    progress: ProgressLike = None,
    num_threads: int | None = None,
) -> Normals:
    """Estimates the normal of every point from its k nearest neighbours, exactly, whatever its coordinates.

    Args:
        points: Positions (n, 3), a cloud, or whatever `render` takes.
        k: Number of neighbours, 3 to 1024.
        orient: The side that normals point to: "sensor" to where the points were seen from, "up" along z, "outward"
            from the middle; "auto" to the sensor if it is known, up for terrain, else outward.
        sensor: Position (3,) from which all points were seen.
        progress: True for a bar, or a function of the finished fraction.
        num_threads: Number of threads; see `num_threads`. The result does not depend on it.

    Returns:
        Normals (n, 3), curvatures (n,) and radii (n,) of float32.

    Raises:
        ArgumentError: If `k` is out of its range, or the points have a wrong shape.
        TypeError: If the points are no numbers.
        OutOfMemoryError: If 40 bytes a point are not free.
    """
    if isinstance(k, bool) or not hasattr(k, "__index__"):
        raise TypeError(f"k: {type(k).__name__} given, a whole number is wanted")
    if not 3 <= k.__index__() <= 1024:
        raise ArgumentError(f"k is {k}, must be within 3 to 1024")
    core = core_cloud(points)
    place = None if sensor is None else _vector(sensor, "sensor")
    with reporting(progress, "normals") as report:
        return Normals(*_core.estimate_normals(core, k.__index__(), orient, place, checked(num_threads), report))
