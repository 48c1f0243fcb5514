"""Points that move."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import autosplats


def test_scenes_are_played():
    recording = autosplats.play("scene:figure:2K", fps=5)
    assert len(recording) == 10 and "10 frames" in repr(recording)
    assert list(np.diff(recording.stamps)) == [200_000_000] * 9
    frames = [cloud.xyz for cloud in recording]
    assert not np.array_equal(frames[0], frames[5])
    for index in (7, 2, -1):
        np.testing.assert_array_equal(recording[index].xyz, frames[index])
    assert [len(cloud) for cloud in recording[2:5]] == [2000] * 3
    with pytest.raises(IndexError):
        recording[10]
    assert len(autosplats.play("scene:figure:2K", fps=5, decay=0.3)[3]) == 4000


def test_folders_are_played(tmp_path):
    for number in range(3):
        autosplats.write(np.full((number + 1, 3), float(number)), tmp_path / f"f{number}.ply")
    recording = autosplats.play(tmp_path)
    assert [len(cloud) for cloud in recording] == [1, 2, 3]
    again = autosplats.play(f"{tmp_path}/f*.ply", fps=2)
    assert list(again.stamps) == [0, 500_000_000, 1_000_000_000]
    assert [len(cloud) for cloud in itertools.islice(again, 2)] == [1, 2]


def test_pipes_are_live(python, tmp_path):
    for number in range(3):
        autosplats.write(np.full((number + 1, 3), float(number)), tmp_path / f"f{number}.ply")
    piped = b"".join((tmp_path / f"f{number}.ply").read_bytes() for number in range(3))
    (tmp_path / "pipe").write_bytes(piped)
    with open(tmp_path / "pipe", "rb") as pipe:
        done = python(
            """
            import autosplats
            live = autosplats.play("-")
            assert live.stamps is None
            try:
                len(live)
            except TypeError as error:
                assert "live" in str(error)
            print([len(cloud) for cloud in live])
            """,
            stdin=pipe,
        )
    assert done.stdout.strip() == "[1, 2, 3]", done.stderr


def test_bad_sources(tmp_path):
    with pytest.raises(autosplats.EmptyError):
        autosplats.play(tmp_path)
    with pytest.raises(FileNotFoundError):
        len(autosplats.play(tmp_path / "none.mcap"))
    with pytest.raises(ValueError, match="decay"):
        autosplats.play("scene:figure:1K", decay=-1)
    with pytest.raises(ValueError):
        autosplats.play("scene:figure:1K", fps=0)
