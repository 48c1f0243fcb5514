"""Points that several tests take."""

from __future__ import annotations

import signal
import subprocess
import sys
import textwrap
from collections.abc import Callable

import numpy as np
import pytest

# What runs in the background of a script ignores Ctrl-C, and so would all that the tests start.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def torus(count: int, seed: int = 7) -> np.ndarray:
    """Points on a torus of radii 2 and 0.7 about z, in float64."""
    u, v = np.random.default_rng(seed).random((2, count)) * 2 * np.pi
    ring = 2 + 0.7 * np.cos(v)
    return np.stack([ring * np.cos(u), ring * np.sin(u), 0.7 * np.sin(v)], axis=1)


def torus_normals(points: np.ndarray) -> np.ndarray:
    """Outward normals of points on the torus."""
    ring = points * [1, 1, 0]
    normals = points - 2 * ring / np.linalg.norm(ring, axis=1, keepdims=True)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


@pytest.fixture(scope="session")
def points() -> np.ndarray:
    # Of 42 binary digits, so that clouds keep all of them.
    return np.round(torus(20_000) * 2**40) / 2**40


@pytest.fixture(scope="session")
def colors() -> np.ndarray:
    return np.random.default_rng(1).integers(40, 255, (20_000, 3), dtype=np.uint8)


@pytest.fixture
def python() -> Callable[..., subprocess.CompletedProcess]:
    """Runs a text in a Python of its own, which ends within `timeout` seconds."""

    def run(text: str, timeout: float = 60, **options: object) -> subprocess.CompletedProcess:
        return subprocess.run(
            [sys.executable, "-c", textwrap.dedent(text)],
            capture_output=True,
            text=True,
            timeout=timeout,
            check=False,
            **options,
        )

    return run
