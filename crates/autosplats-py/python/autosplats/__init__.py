"""Raw points in, a lit surface out: pictures and normals of point clouds, without a driver, a window or a mesh.

>>> import autosplats
>>> picture = autosplats.render("scene:statue:20K", size=(320, 200))
>>> picture.shape
(200, 320, 4)

Functions take points in whatever form they are held: arrays (n, 3), structured arrays, data frames, tensors, objects of
Open3D, laspy and PyVista, files and addresses. Results are numpy arrays. Long work leaves other threads running, ends
at Ctrl-C and reports its progress.

Importing this package starts nothing and imports nothing beside it; numpy is imported when something is used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ._camera import Camera as Camera
    from ._cloud import Cloud as Cloud
    from ._cloud import Crs as Crs
    from ._cloud import Scan as Scan
    from ._errors import ArgumentError as ArgumentError
    from ._errors import DeviceError as DeviceError
    from ._errors import EmptyError as EmptyError
    from ._errors import Error as Error
    from ._errors import FormatError as FormatError
    from ._errors import MissingFieldError as MissingFieldError
    from ._errors import OutOfMemoryError as OutOfMemoryError
    from ._files import info as info
    from ._files import read as read
    from ._files import scene as scene
    from ._files import write as write
    from ._normals import Normals as Normals
    from ._normals import estimate_normals as estimate_normals
    from ._picture import Picture as Picture
    from ._play import Recording as Recording
    from ._play import play as play
    from ._render import Device as Device
    from ._render import Renderer as Renderer
    from ._render import devices as devices
    from ._render import render as render
    from ._threads import num_threads as num_threads
    from ._threads import set_num_threads as set_num_threads
    from ._view import view as view

    __version__: str

#: Where each public name is defined.
_HOMES = {
    "_camera": ("Camera",),
    "_cloud": ("Cloud", "Crs", "Scan"),
    "_errors": (
        "ArgumentError",
        "DeviceError",
        "EmptyError",
        "Error",
        "FormatError",
        "MissingFieldError",
        "OutOfMemoryError",
    ),
    "_files": ("info", "read", "scene", "write"),
    "_normals": ("Normals", "estimate_normals"),
    "_picture": ("Picture",),
    "_play": ("Recording", "play"),
    "_render": ("Device", "Renderer", "devices", "render"),
    "_threads": ("num_threads", "set_num_threads"),
    "_view": ("view",),
}

__all__ = [
    "ArgumentError",
    "Camera",
    "Cloud",
    "Crs",
    "Device",
    "DeviceError",
    "EmptyError",
    "Error",
    "FormatError",
    "MissingFieldError",
    "Normals",
    "OutOfMemoryError",
    "Picture",
    "Recording",
    "Renderer",
    "Scan",
    "devices",
    "estimate_normals",
    "info",
    "num_threads",
    "play",
    "read",
    "render",
    "scene",
    "set_num_threads",
    "view",
    "write",
]


def __getattr__(name: str) -> object:
    from importlib import import_module

    if name == "__version__":
        from ._core import VERSION

        return VERSION
    for home, names in _HOMES.items():
        if name in names:
            value: object = getattr(import_module("." + home, __name__), name)
            globals()[name] = value
            return value
    raise AttributeError(f"module 'autosplats' has no attribute '{name}'")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
