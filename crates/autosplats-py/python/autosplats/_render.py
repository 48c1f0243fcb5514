"""Rendering."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

from . import _core, _drivers
from ._camera import Axes, Camera, Size, View, checked_size
from ._cloud import Cloud, core_cloud
from ._errors import ArgumentError
from ._picture import Picture
from ._progress import ProgressLike, reporting
from ._threads import checked

Backend = Literal["auto", "cpu", "gpu"]
ColorMap = Literal["viridis", "inferno", "turbo", "gray", "reds"]

_COLOR_MAPS = ("viridis", "inferno", "turbo", "gray", "reds")


class Device(NamedTuple):
    """A graphics device."""

    #: Its place in the list, which `device=` takes.
    number: int
    #: Its place on the bus, such as "0000:3b:00.0", which `device=` takes too; empty if the driver tells none.
    pci_bus_id: str
    name: str
    #: Vulkan, Metal or Dx12.
    api: str
    #: DiscreteGpu, IntegratedGpu, Cpu (software) ...
    kind: str
    driver: str
    #: Whether it is a program on the processor, slower than the backend "cpu".
    software: bool


def devices() -> list[Device]:
    """All graphics devices that can render, hardware first. The processor always can."""
    _drivers.silence()
    return [_device(number, found) for number, found in enumerate(json.loads(_core.devices()))]


def _device(number: int, found: Mapping[str, Any]) -> Device:
    return Device(
        number=number,
        pci_bus_id=found["pci_bus_id"],
        name=found["name"],
        api=found["backend"],
        kind=found["kind"],
        driver=found["driver"],
        software=found["software"],
    )


class Renderer:
    """Renders pictures on the processor or on a graphics device, and keeps its buffers for the next picture.

    Several threads may share a renderer; one renders at a time. A renderer on a device works in the process that made
    it, not in one that was forked from it. Pickled, it is made anew where it arrives.

    Args:
        backend: "cpu"; "gpu" for the best graphics device, also a software one; "auto" for a hardware device if there
            is one, else the processor.
        device: Which device, by its number in `devices()` or its PCI bus id.

    Raises:
        DeviceError: If there is no such device.
    """

    def __init__(self, backend: Backend = "auto", *, device: int | str | None = None) -> None:
        if device is not None and backend == "cpu":
            raise ArgumentError("device: the backend 'cpu' has no devices")
        _drivers.silence()
        self._asked = (backend, device)
        self._core = _core.Renderer(backend, None if device is None else str(device))

    @property
    def device(self) -> Device | None:
        """The device that renders; None for the processor."""
        found = self._core.device()
        if found is None:
            return None
        device = json.loads(found)
        places = [place for place, known in enumerate(json.loads(_core.devices())) if known == device]
        return _device(places[0] if places else -1, device)

    def render(
        self,
        points: object,
        colors: object = None,
        *,
        size: Size = (1280, 800),
        view: View = "auto",
        camera: Camera | None = None,
        axes: Axes | None = None,
        color: str = "auto",
        value_range: tuple[float, float] | None = None,
        color_map: ColorMap | None = None,
        legend: bool = False,
        background: str | None = None,
        lighting: bool = True,
        exposure: float | None = None,
        occlusion: float = 1.0,
        k: int | Literal["auto"] = "auto",
        keep_outliers: bool = False,
        settings: Mapping[str, object] | None = None,
        supersample: int | None = None,
        layers: bool = False,
        progress: ProgressLike = None,
        num_threads: int | None = None,
    ) -> Picture:
        """Renders a picture; the arguments are those of `autosplats.render`."""
        core = core_cloud(points, colors)
        size = checked_size(size)
        if camera is not None and not isinstance(camera, Camera):
            raise TypeError(f"camera: {type(camera).__name__} given, an autosplats.Camera is wanted")
        if supersample is not None and not 1 <= supersample.__index__() <= 16:
            raise ArgumentError(f"supersample is {supersample}, must be within 1 to 16")
        if layers and supersample not in (None, 1):
            raise ArgumentError("supersample: layers cannot be averaged; render them without")
        whole = _settings(
            color=color,
            value_range=value_range,
            color_map=color_map,
            legend=legend,
            background=background,
            lighting=lighting,
            exposure=exposure,
            occlusion=occlusion,
            k=k,
            keep_outliers=keep_outliers,
            settings=settings,
            layers=layers,
        )
        with reporting(progress, "rendering") as report:
            frame = self._core.render(
                core,
                None if camera is None else camera.to_json(),
                view,
                axes,
                size,
                whole,
                color,
                None if supersample is None else supersample.__index__(),
                checked(num_threads),
                report,
            )
        return Picture(frame)

    def _settled(
        self, points: Cloud, camera: Camera, size: Size, axes: str | None, look: Mapping[str, Any]
    ) -> tuple[float | None, list[float] | None]:
        """The exposure and the value range that suit a picture, for all pictures of a job. `look` has arguments of
        `render`; what they state is returned. The range is None if colours show no values."""
        arguments = dict(look)
        factor = arguments.pop("supersample", None) or 1
        rendered = (factor * size[0], factor * size[1])
        color = arguments.get("color", "auto")
        return self._core.settle(points._core, camera.to_json(), axes, rendered, _settings(**arguments), color)

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpickled, self._asked

    def __repr__(self) -> str:
        device = self.device
        return f"<autosplats.Renderer on {'the processor' if device is None else device.name}>"


def _settings(
    *,
    color: object = "auto",
    value_range: tuple[float, float] | None = None,
    color_map: ColorMap | None = None,
    legend: bool = False,
    background: str | None = None,
    lighting: bool = True,
    exposure: float | None = None,
    occlusion: float = 1.0,
    k: int | Literal["auto"] = "auto",
    keep_outliers: bool = False,
    settings: Mapping[str, object] | None = None,
    layers: bool = False,
) -> str:
    """The settings of a picture, but for the colour mode, as JSON."""
    if color_map is not None and color_map not in _COLOR_MAPS:
        raise ArgumentError(f"color_map is '{color_map}', must be one of {', '.join(_COLOR_MAPS)}")
    if not isinstance(color, str):
        what = "the name of a mode or a field is wanted; colours of points are colors="
        raise TypeError(f"color: {type(color).__name__} given, {what}")
    reconstruction: dict[str, object] = {}
    if k != "auto":
        if isinstance(k, (bool, str)) or not hasattr(k, "__index__"):
            raise TypeError(f"k: {k!r} given, a whole number or 'auto' is wanted")
        reconstruction.update(k=k.__index__(), adaptive=False)
    if keep_outliers:
        reconstruction["outlier_expansions"] = None
    reconstruction.update(settings or {})
    shading: dict[str, object] = {
        "range": None if value_range is None else [float(end) for end in value_range],
        "color_map": color_map,
        "legend": bool(legend),
        "lighting": bool(lighting),
        "exposure": None if exposure is None else float(exposure),
        "occlusion": float(occlusion),
    }
    if background is not None:
        shading["background"] = background
    return json.dumps({"reconstruction": reconstruction, "shading": shading, "all_layers": bool(layers)})


def _unpickled(backend: Backend, device: int | str | None) -> Renderer:
    return Renderer(backend, device=device)


#: Renderers of graphics devices, which take long to start, by process and by what was asked for.
_started: dict[tuple[int, Backend, int | str | None], Renderer] = {}


def _renderer(backend: Backend, device: int | str | None) -> Renderer:
    if backend == "cpu" and device is None:
        return Renderer("cpu")
    asked = (os.getpid(), backend, device)
    renderer = _started.get(asked)
    if renderer is None:
        renderer = Renderer(backend, device=device)
        _started[asked] = renderer
    return renderer


def render(
    points: object,
    colors: object = None,
    *,
    size: Size = (1280, 800),
    view: View = "auto",
    camera: Camera | None = None,
    axes: Axes | None = None,
    color: str = "auto",
    value_range: tuple[float, float] | None = None,
    color_map: ColorMap | None = None,
    legend: bool = False,
    background: str | None = None,
    lighting: bool = True,
    exposure: float | None = None,
    occlusion: float = 1.0,
    k: int | Literal["auto"] = "auto",
    keep_outliers: bool = False,
    settings: Mapping[str, object] | None = None,
    supersample: int | None = None,
    layers: bool = False,
    backend: Backend = "auto",
    device: int | str | None = None,
    progress: ProgressLike = None,
    num_threads: int | None = None,
) -> Picture:
    """Renders raw points as a lit surface. Points need no normals, no radii and no mesh.

    Args:
        points: Positions (n, 3) of any type of number, in world coordinates; a cloud; a structured array, a mapping, a
            data frame, a tensor, an object of Open3D, laspy or PyVista; or the name of a file, an address or a scene.
        colors: Colours (n, 3) or (n, 4) of uint8, of floats from 0 to 1, or of uint16.
        size: Width and height in pixels, each 1 to 16384.
        view: The side to look from, if no camera is given: "auto", "iso", "front", "back", "left", "right", "top",
            "bottom".
        camera: The camera; by default one that sees all points.
        axes: Which axis points up, such as "z-up"; by default what the points state, or a guess.
        color: What is shown: "auto", "rgb", "plain", "height", "intensity", "classification", "normal", "curvature",
            "radius", "k-radius", "depth", or the name of a field.
        value_range: Values at the two ends of the colour map; by default the 1st and 99th percentile in the picture.
        color_map: Colours of values.
        legend: Draw the colour map with its values.
        background: A CSS colour by name or as "#rrggbb", two of them with a comma for a gradient, or "transparent".
        lighting: Light the surface by its normals.
        exposure: Factor on the brightness of the points' colours, 0.01 to 100; by default brighter if all are dark.
        occlusion: Strength of the darkening of creases, 0 to 10.
        k: Neighbours per point, 1 to 64; "auto" takes 10, and more where noise needs them.
        keep_outliers: Show points without neighbours, too.
        settings: Further settings of the reconstruction, by the names of the Rust struct `Reconstruction`.
        supersample: Render this many times as large and average; by default 2 for pictures up to 1920x1080.
        layers: Keep depth, normals, indices of points, radii and curvature of the surface. Without averaging.
        backend: "cpu"; "gpu" for the best graphics device; "auto" for a hardware device if there is one, else "cpu".
        device: Which device, by its number in `devices()` or its PCI bus id.
        progress: True for a bar, or a function of the finished fraction.
        num_threads: Number of threads of the processor; see `num_threads`. Pictures do not depend on it.

    Returns:
        The picture. It is empty but for the background if the camera sees no point.

    Raises:
        ArgumentError: If an argument is out of its range or has a wrong shape.
        TypeError: If an argument is of a wrong type.
        MissingFieldError: If the points do not have the colours or the field that `color` names.
        EmptyError: If no camera is given and no point is finite.
        DeviceError, OutOfMemoryError: If the device or the memory does not suffice.
    """
    return _renderer(backend, device).render(
        points,
        colors,
        size=size,
        view=view,
        camera=camera,
        axes=axes,
        color=color,
        value_range=value_range,
        color_map=color_map,
        legend=legend,
        background=background,
        lighting=lighting,
        exposure=exposure,
        occlusion=occlusion,
        k=k,
        keep_outliers=keep_outliers,
        settings=settings,
        supersample=supersample,
        layers=layers,
        progress=progress,
        num_threads=num_threads,
    )


__all__ = ["Cloud", "Device", "Renderer", "devices", "render"]
