"""Exceptions. Each is also the builtin exception that one expects; files that are missing, unreadable or in the way raise
OSError itself, with its number and the file's name."""

from __future__ import annotations


class Error(Exception):
    """Base of all exceptions of this package."""


class ArgumentError(Error, ValueError):
    """An argument is out of its range or has a wrong shape. The message names it."""


class FormatError(Error, ValueError):
    """A file is malformed, or its format cannot be read or written."""


class EmptyError(Error, ValueError):
    """There is nothing to show or to keep: no finite point, no frame, no surface."""


class MissingFieldError(Error, KeyError):
    """The points have no such colours or field, or the picture has no such layer."""

    def __str__(self) -> str:
        # KeyError shows its message in quotes.
        return str(self.args[0]) if self.args else ""


class DeviceError(Error, RuntimeError):
    """There is no such device, or it does not work."""


class OutOfMemoryError(Error, MemoryError):
    """The memory of the machine or of a device does not suffice; nothing was allocated."""


for _class in (Error, ArgumentError, FormatError, EmptyError, MissingFieldError, DeviceError, OutOfMemoryError):
    _class.__module__ = "autosplats"
del _class
