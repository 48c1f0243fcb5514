"""The view of a notebook: what the mouse does, and the pictures that come back."""

from __future__ import annotations

import io
import sys

import numpy as np
import pytest

import autosplats
from autosplats._view import Orbit, _answer


def test_the_camera_turns_about_the_points(points):
    orbit = Orbit(points, size=(160, 120))
    first = orbit.camera
    distance = np.linalg.norm(np.subtract(first.eye, first.look_at))
    orbit.turn(0.25, 0.1)
    assert orbit.camera != first and orbit.camera.look_at == first.look_at
    np.testing.assert_allclose(np.linalg.norm(np.subtract(orbit.camera.eye, first.look_at)), distance)
    for _ in range(50):
        orbit.turn(0.01, 0.3)
    # At the pole the view neither turns over nor is lost.
    up = np.subtract(orbit.camera.eye, orbit.camera.look_at) @ np.array(orbit.camera.up)
    assert up > 0.99 * distance
    orbit.zoom(2)
    np.testing.assert_allclose(np.linalg.norm(np.subtract(orbit.camera.eye, first.look_at)), distance / 2)
    orbit.reset()
    assert orbit.camera == first


def test_points_move_with_the_mouse(points):
    orbit = Orbit(points, size=(200, 100))
    middle = np.array([orbit.camera.look_at])
    before, _ = orbit.camera.project(middle, orbit.size)
    orbit.turn(0.1, 0)
    side = middle + np.array([[0, 0, 0.0]])
    orbit.pan(0.2, -0.1)
    after, _ = orbit.camera.project(side, orbit.size)
    np.testing.assert_allclose(after - before, [[20, -10]], atol=0.01)


def test_turning_follows_the_mouse(points):
    orbit = Orbit(points, size=(200, 100))
    eye, look_at = np.array(orbit.camera.eye), np.array(orbit.camera.look_at)
    # A place before the middle, towards the eye.
    near = look_at + 0.2 * (eye - look_at)
    orbit.turn(0.05, 0)
    after, _ = orbit.camera.project(near[None], orbit.size)
    assert after[0, 0] > 99.5 + 1, "what is near goes right with the mouse"
    orbit.reset()
    orbit.turn(0, 0.05)
    after, _ = orbit.camera.project(near[None], orbit.size)
    assert after[0, 1] > 49.5 + 1, "and down"


def test_pictures_are_small_while_the_view_moves(points):
    orbit = Orbit(points, size=(160, 120), color="height")
    assert orbit.picture(moving=True).size == (96, 72)
    np.testing.assert_array_equal(
        orbit.picture().array,
        autosplats.render(points, size=(160, 120), color="height", camera=orbit.camera).array,
    )
    many = Orbit(np.random.rand(1_200_000, 3), size=(64, 48))
    assert 900_000 < len(many._few) < 1_100_000


def test_messages_are_answered(points):
    sent = []

    class Widget:
        def send(self, content, buffers):
            sent.append((content["kind"], buffers[0]))

    orbit = Orbit(points, size=(160, 120))
    first = orbit.camera
    _answer(Widget(), orbit, {"moves": [["turn", [0.1, 0]], ["picture", []], ["zoom", [1.1]]], "moving": True})
    assert orbit.camera != first
    _answer(Widget(), orbit, {"moves": [["reset", []]], "moving": False})
    assert orbit.camera == first
    assert [kind for kind, _ in sent] == ["jpg", "png"]
    assert sent[0][1].startswith(b"\xff\xd8") and sent[1][1].startswith(b"\x89PNG")


def test_without_a_widget_it_is_a_picture(points, monkeypatch):
    monkeypatch.setitem(sys.modules, "anywidget", None)
    assert isinstance(autosplats.view(points, size=(64, 48)), autosplats.Picture)


def test_the_widget_has_the_orbit(points):
    pytest.importorskip("anywidget")
    widget = autosplats.view(points, size=(160, 120))
    assert widget.width == 160 and isinstance(widget.orbit, Orbit)
    assert "pointermove" in str(widget._esm)
    assert io.BytesIO(widget.orbit.picture().encode("png")).read(4) == b"\x89PNG"
