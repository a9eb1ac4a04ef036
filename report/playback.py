"""3-D playback of a simulation in the browser, with a time slider: one HTML text that needs nothing else.

Drake's Meshcat draws; its recording is saved as a page, and a bar with a button and a slider is put under it.
It and a page that frames it tell each other the time, by messages ``{playbackTime}`` [s]. Nothing is simulated here:
poses and curves come in as arrays over time.
"""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.geometry import Box, Capsule, Cylinder, Meshcat, MeshcatAnimation, MeshcatParams, Rgba, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from scipy.spatial.transform import Rotation

from ..errors import InputError

Array = NDArray[np.float64]
Shape = Box | Capsule | Cylinder | Sphere
"""Drake's shapes [m], centred in the body's frame; a cylinder's or capsule's axis is z."""

_STRETCH = 0.01
"""Relative change of length [1] up to which a curve's piece keeps its first length: too little to be seen."""

_BAR = """
<style>
#meshcat-pane{height:calc(100vh - 2.6rem)!important}
#meshcat-pane:focus-visible{outline:3px solid #00588f;outline-offset:-3px}
.dg{display:none!important} /* Meshcat's own controls: without labels, and with an animation of their own */
#bar{height:2.6rem;display:flex;gap:.75rem;align-items:center;padding:0 .75rem;background:#fff;color:#1c2329;
font:14px/1 system-ui,sans-serif;box-sizing:border-box}
@media screen and (prefers-color-scheme:dark){#bar{background:#1e242a;color:#e4e8ec;color-scheme:dark}}
#bar button{width:4.5rem;height:1.8rem;font:inherit}
#bar input{flex:1;min-width:4rem}
#bar output{width:4.5rem;text-align:right;font-variant-numeric:tabular-nums}
</style>
<div id="bar"><button type="button" disabled>Play</button>
<input type="range" min="0" max="1" step="any" value="0" aria-label="Time in seconds" disabled><output></output></div>
<script>
(() => {
  const [button, slider, label] = ["button", "input", "output"].map(tag => document.querySelector("#bar " + tag));
  let animator, playing = false, last = 0;
  const seek = time => {
    slider.value = time;
    label.value = Number(slider.value).toFixed(2) + " s";
    animator.seek(Number(slider.value));
    rest();
  };
  // The sky is dark where the page is dark; its top and its bottom, red, green and blue.
  const skies = {light: [[0.97, 0.97, 0.98], [0.84, 0.87, 0.90]], dark: [[0.08, 0.09, 0.11], [0.17, 0.20, 0.23]]};
  const night = matchMedia("(prefers-color-scheme:dark)");
  const paint = sky => ["top_color", "bottom_color"].forEach((end, k) =>
    viewer.set_property(["Background", "<object>"], end, skies[sky][k]));
  const paintAsPage = () => paint(night.matches ? "dark" : "light");
  // A page that frames this one is told the time, and may set it; what stands still it gets as a picture, for paper,
  // which is light.
  const framed = parent !== window;
  let resting;
  const still = () => {
    paint("light");
    viewer.render();
    parent.postMessage({playbackStill: viewer.renderer.domElement.toDataURL("image/jpeg", 0.9),
      time: Number(slider.value)}, "*");
    paintAsPage();
    viewer.render();
  };
  const rest = () => {
    clearTimeout(resting);
    if (framed && !playing) resting = setTimeout(still, 400);
  };
  const go = time => {
    seek(time);
    if (framed) parent.postMessage({playbackTime: Number(slider.value)}, "*");
  };
  const run = on => {
    playing = on; last = performance.now(); button.textContent = on ? "Pause" : "Play";
    if (animator) rest();
  };
  const tick = now => {
    if (playing) {
      const time = Number(slider.value) + (now - last) / 1000;
      last = now;
      go(time);
      if (time >= animator.duration) run(false);
    }
    requestAnimationFrame(tick);
  };
  const wait = () => {
    if (typeof viewer === "undefined") { label.value = "no WebGL"; return; }
    animator = viewer.animator;
    if (!animator.actions.length) { requestAnimationFrame(wait); return; }
    paintAsPage();
    night.addEventListener("change", paintAsPage);
    animator.play();  // Without this its actions would not follow the slider.
    animator.pause();
    slider.max = animator.duration;
    const view = document.getElementById("meshcat-pane");
    Object.assign(view, {tabIndex: 0, role: "application"});
    view.ariaLabel = "3-D view: arrow keys shift it, with Shift they turn it";
    Object.assign(viewer.controls, {keyRotateSpeed: 8, keyPanSpeed: 20});
    viewer.controls.listenToKeyEvents(view);
    viewer.controls.addEventListener("change", rest);
    slider.disabled = button.disabled = false;
    go(START);
    requestAnimationFrame(tick);
    addEventListener("message", event => {
      if (!framed || event.source !== parent) return;
      run(false);
      seek(event.data.playbackTime);
    });
  };
  slider.addEventListener("input", () => { run(false); go(slider.value); });
  button.addEventListener("click", () => {
    if (!playing && Number(slider.value) >= animator.duration) go(0);
    run(!playing);
  });
  wait();
})();
</script>
"""


class Playback:
    """A scene that moves, to be saved as one HTML text.

    Add things with `body` and `curve`, move them with `move`, hide and show them with `show`. Names are unique; a
    slash makes a group (``cables/1``). Times are seconds from zero on; samples closer than a frame are left out.

    Parameters
    ----------
    frames_per_second : float
        Frames that are kept [1/s]; the browser interpolates between them.
    """

    def __init__(self, frames_per_second: float = 15.0) -> None:
        """An empty scene."""
        parameters = MeshcatParams()
        parameters.host, parameters.show_stats_plot = "localhost", False
        with _quiet():
            self._meshcat = Meshcat(parameters)
        self._rate = frames_per_second
        self._animation = MeshcatAnimation(frames_per_second)
        self._animation.set_autoplay(False)
        self._names: set[str] = set()
        for hidden in ("/Grid", "/Axes"):
            self._meshcat.SetProperty(hidden, "visible", False)

    def body(self, name: str, shape: Shape, colour: str, opacity: float = 1.0) -> None:
        """Add a rigid shape; ``colour`` as #rrggbb. It stands at the origin until it is moved."""
        if name in self._names:
            raise InputError(f"playback: the name {name!r} is taken; give each body and curve its own")
        self._names.add(name)
        red, green, blue = (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
        self._meshcat.SetObject(name, shape, Rgba(red, green, blue, opacity))

    def move(self, name: str, times: ArrayLike, positions: ArrayLike, quaternions: ArrayLike | None = None) -> None:
        """Move a body along with its frame.

        Parameters
        ----------
        times : (n_times,)
            Increasing [s]; one time is enough for a body that only stands elsewhere.
        positions : (n_times, 3)
            Of the body's origin in the world [m].
        quaternions : (n_times, 4), optional
            Orientation, w first, unit length; none: as the world.
        """
        times, positions = self._checked(name, times, positions, (3,))
        turns = np.tile([1.0, 0.0, 0.0, 0.0], (times.size, 1)) if quaternions is None else quaternions
        turns = self._checked(name, times, turns, (4,))[1]
        matrices = Rotation.from_quat(turns, scalar_first=True).as_matrix()
        for frame, k in self._frames(times):
            self._place(name, frame, RigidTransform(RotationMatrix(matrices[k]), positions[k]), len(times) > 1)

    def show(self, name: str, times: ArrayLike, visible: ArrayLike) -> None:
        """Show a body where ``visible`` (n_times,) is true, and hide it elsewhere."""
        times, seen = self._checked(name, times, visible, ())
        before = None
        for frame, k in self._frames(times):
            now = bool(seen[k])
            if frame == 0:
                self._meshcat.SetProperty(name, "visible", now)
            if now != before:
                self._animation.SetProperty(frame, name, "visible", now)
            before = now

    def curve(self, name: str, radius: float, times: ArrayLike, points: ArrayLike, colour: str) -> None:
        """Add a round curve, a chain of cylinders between moving points.

        Parameters
        ----------
        radius : float
            [m].
        times : (n_times,)
            Increasing [s]; one time is enough for a curve that stands.
        points : (n_times, n_points, 3)
            In the world [m]; at least two at each time.
        """
        times, points = self._checked(name, times, points, None)
        if points.ndim != 3 or points.shape[1] < 2 or points.shape[2] != 3:
            raise InputError(f"playback: {name}: points have the shape {points.shape}, not (n_times, n_points >= 2, 3)")
        frames = list(self._frames(times))
        spans = np.diff(points, axis=1)
        lengths = np.linalg.norm(spans, axis=2)
        for piece in range(spans.shape[1]):
            part = f"{name}/{piece}"
            length = lengths[:, piece]
            self.body(part, Cylinder(radius, float(length[0])), colour)
            stretches = np.ptp(length) > _STRETCH * length[0]
            middles = points[:, piece] + 0.5 * spans[:, piece]
            for frame, k in frames:
                turn = RotationMatrix.MakeFromOneVector(spans[k, piece], 2)
                self._place(part, frame, RigidTransform(turn, middles[k]), len(times) > 1)
                if stretches:
                    scale = [1.0, 1.0, float(length[k] / length[0])]
                    self._animation.SetProperty(frame, part, "scale", scale)

    def camera(self, position: ArrayLike, target: ArrayLike) -> None:
        """Look from ``position`` (3,) at ``target`` (3,) [m]; z is up in the picture."""
        # Drake's stub has the type parameters of the arrays in another order than numpy.
        places: list[Any] = [np.asarray(position, float), np.asarray(target, float)]
        self._meshcat.SetCameraPose(*places)

    def html(self, start: float = 0.0) -> str:
        """The whole page, which asks nothing of the network; it opens at the time ``start`` [s]."""
        self._meshcat.SetAnimation(self._animation)
        page = self._meshcat.StaticHtml().replace("<html>", '<html lang="en">', 1)
        before, end, after = page.rpartition("</body>")
        return before + _BAR.replace("START", repr(float(start))) + end + after

    def _checked(
        self, name: str, times: ArrayLike, values: ArrayLike, shape: tuple[int, ...] | None
    ) -> tuple[Array, Array]:
        times, values = np.atleast_1d(np.asarray(times, float)), np.asarray(values, float)
        if times[0] < 0 or np.any(np.diff(times) <= 0):
            raise InputError(f"playback: {name}: times must increase from zero on; sort them, and drop repeated ones")
        if len(values) != times.size or (shape is not None and values.shape[1:] != shape):
            wanted = "" if shape is None else f", each of shape {shape}"
            raise InputError(f"playback: {name}: {times.size} times need as many values{wanted}, not {values.shape}")
        if not np.all(np.isfinite(values)):
            raise InputError(f"playback: {name}: a value is not finite; cut the motion before it")
        return times, values

    def _frames(self, times: Array) -> Iterator[tuple[int, int]]:
        """Frames that get a key, each with the index of the sample nearest to it."""
        grid = np.arange(np.ceil(times[0] * self._rate - 0.5), np.floor(times[-1] * self._rate + 0.5) + 1) / self._rate
        after = np.clip(np.searchsorted(times, grid), 1, max(1, times.size - 1))
        nearest = after - (np.abs(times[after - 1] - grid) <= np.abs(times[np.minimum(after, times.size - 1)] - grid))
        for k in np.unique(nearest):
            yield round(float(times[k]) * self._rate), int(k)

    def _place(self, name: str, frame: int, pose: RigidTransform, moves: bool) -> None:
        if frame == 0 or not moves:
            self._meshcat.SetTransform(name, pose)
        if moves:
            self._animation.SetTransform(frame, name, pose)


@contextmanager
def _quiet() -> Iterator[None]:
    """Meshcat announces its address, which is of no use here."""
    logger = logging.getLogger("drake")
    level = logger.level
    logger.setLevel(logging.WARNING)
    try:
        yield
    finally:
        logger.setLevel(level)
