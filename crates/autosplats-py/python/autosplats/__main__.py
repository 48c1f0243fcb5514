"""The command `autosplats`, in this process. It has everything but the window, and imports neither numpy nor anything
else that it does not need."""

import sys


def main() -> int:
    """Runs the command with the arguments of the process, and returns its exit code."""
    from . import _core, _drivers

    _drivers.silence()
    return _core.main(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
