"""What drivers of graphics devices are told."""

from __future__ import annotations

import os
import sys


def silence() -> None:
    """Keeps Mesa from printing errors for each device. Without a session it cannot ask for the screen's device, and says
    so on standard error. A choice that the user made stays."""
    if sys.platform == "linux" and "XDG_RUNTIME_DIR" not in os.environ:
        os.environ.setdefault("NODEVICE_SELECT", "1")
