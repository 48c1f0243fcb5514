"""The command, in the process of Python."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest

import autosplats


def run(*arguments: object, **options: object) -> subprocess.CompletedProcess:
    command = [sys.executable, "-m", "autosplats", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False, **options)


def test_it_is_the_command(tmp_path):
    assert run("--version").stdout.split() == ["autosplats", autosplats.__version__]
    assert run("render", "scene:statue:2K", "-o", tmp_path / "a.png", "--size", "64x48").returncode == 0
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    missing = run("info", tmp_path / "none.ply")
    assert missing.returncode == 3 and missing.stderr.startswith("error: ") and missing.stderr.count("\n") == 1
    assert run("nonsense").returncode == 2
    assert "Usage" in run("--help").stdout or "COMMAND" in run("--help").stdout


def test_it_starts_without_what_it_does_not_need(python):
    done = python("import sys; sys.argv[1:] = ['--version']; import autosplats.__main__ as m; m.main(); print('numpy' in sys.modules)")
    assert done.stdout.splitlines()[-1] == "False", "numpy takes longer than all else"


@pytest.mark.skipif(os.name == "nt", reason="signals are different there")
def test_ctrl_c_leaves_nothing(tmp_path):
    command = [sys.executable, "-m", "autosplats", "convert", "scene:statue:8M", tmp_path / "a.laz"]
    started = subprocess.Popen(list(map(str, command)), stderr=subprocess.PIPE, text=True)
    time.sleep(1.5)
    started.send_signal(signal.SIGINT)
    _, said = started.communicate(timeout=20)
    assert started.returncode == 130 and "interrupted" in said
    assert not list(tmp_path.iterdir())
