"""Pictures."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._camera import Camera

Floats = npt.NDArray[np.float32]


class Picture:
    """A picture: an array (height, width, 4) of uint8, sRGB with straight alpha, rows from the top.

    numpy, matplotlib and PIL take it as an array, notebooks show it. Rendered with `layers=True` it also has the visible
    surface, a value per pixel. Pictures can be pickled.
    """

    def __init__(self, core: _core.Frame) -> None:
        self._core = core

    @cached_property
    def array(self) -> npt.NDArray[np.uint8]:
        """Pixels (height, width, 4): a read-only view."""
        return self._core.pixels

    @property
    def shape(self) -> tuple[int, ...]:
        """Height, width and 4."""
        return self.array.shape

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.array.shape[1], self.array.shape[0]

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> npt.NDArray[Any]:
        if dtype is not None and np.dtype(dtype) != np.uint8:
            if copy is False:
                raise ValueError(f"a picture of {np.dtype(dtype)} is a copy")
            return self.array.astype(dtype)
        return self.array.copy() if copy else self.array

    @cached_property
    def camera(self) -> Camera:
        """The camera that took the picture."""
        return Camera.from_json(self._core.camera)

    @cached_property
    def counts(self) -> dict[str, Any]:
        """Numbers of points by what became of them, and of covered pixels; `value_range` has the ends of the colour
        map."""
        counts: dict[str, Any] = json.loads(self._core.counts)
        return counts

    @cached_property
    def timings(self) -> dict[str, float]:
        """Milliseconds of each stage."""
        timings: dict[str, float] = json.loads(self._core.timings)
        return timings

    @cached_property
    def depth(self) -> Floats:
        """Depth (height, width) along the viewing axis in world units; infinite where no surface is.

        Raises:
            MissingFieldError: If the picture was rendered without `layers=True`. So do all other layers.
        """
        return self._core.depth()

    @cached_property
    def normals(self) -> Floats:
        """Unit normals (height, width, 3) in world space, towards the eye; zero where no surface is."""
        return self._core.normals()

    @cached_property
    def points(self) -> npt.NDArray[np.int64]:
        """Index (height, width) of the point that counts most; -1 where no surface is."""
        return self._core.points()

    @cached_property
    def radius(self) -> Floats:
        """Mean radius (height, width) of the splats in world units; 0 where no surface is."""
        return self._core.radius()

    @cached_property
    def k_radius(self) -> Floats:
        """Mean distance (height, width) to the k-th neighbour in world units; 0 where no surface is."""
        return self._core.k_radius()

    @cached_property
    def curvature(self) -> Floats:
        """Mean surface variation (height, width), 0 to 1/3; 0 where no surface is."""
        return self._core.curvature()

    def xyz(self) -> npt.NDArray[np.float64]:
        """World coordinates (height, width, 3) of the surface; NaN where none is."""
        depth = self.depth
        rows, columns = np.nonzero(np.isfinite(depth))
        world = np.full((*depth.shape, 3), np.nan)
        pixels = np.stack([columns, rows], axis=1)
        world[rows, columns] = self.camera.unproject(pixels, depth[rows, columns], self.size)
        return world

    def save(self, path: str | os.PathLike[str], *, overwrite: bool = True) -> None:
        """Writes the picture as .png or .jpg, or with all layers as .exr. The file appears whole or not at all.

        Raises:
            FileExistsError: If the file is there, unless `overwrite`.
            ArgumentError: If the extension is another one, or a .jpg shall be transparent.
            MissingFieldError: If an .exr shall have layers that the picture does not have.
        """
        self._core.save(os.fspath(path), overwrite)

    def encode(self, format: str = "png") -> bytes:
        """The bytes of a "png", "jpg" or "exr" file."""
        return self._core.encode(format)

    def _repr_png_(self) -> bytes:
        return self._core.encode("png")

    def __reduce__(self) -> tuple[Callable[..., Picture], tuple[dict[str, Any]]]:
        return _unpickled, (self._core.state(),)

    def __repr__(self) -> str:
        width, height = self.size
        return f"<autosplats.Picture of {width}x{height} pixels{', with layers' if self._core.has_layers else ''}>"


def _unpickled(state: dict[str, Any]) -> Picture:
    return Picture(_core.Frame.of_state(**state))
