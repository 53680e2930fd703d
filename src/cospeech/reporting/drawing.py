"""Skeletons drawn with Pillow: one picture of every track at one instant."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cospeech.errors import CospeechError
from cospeech.motion.motion import Motion
from cospeech.reporting.figure import PART_COLOURS, check_drawable, figure_of
from cospeech.reporting.framing import extents
from cospeech.reporting.markup import one_line
from cospeech.reporting.projection import Camera
from cospeech.speech.speech import Word

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageDraw import ImageDraw
    from PIL.ImageFont import FreeTypeFont
    from PIL.ImageFont import ImageFont as BitmapFont

_SUPERSAMPLE = 2
_BACKGROUND = (251, 251, 252)
_GRID = (176, 185, 199)
_SHADOW = (222, 226, 232)
_TEXT = (28, 36, 48)
_MUTED = (107, 118, 134)
_ACCENT = (209, 73, 91)
_GRID_STEP_M = 0.25
_GRID_REACH_M = 1.75
# an audio clock rounds: i / fps must still fall into frame i
_FRAME_TOLERANCE = 1e-3

Colour = tuple[int, int, int]


def _rgb(text: str) -> Colour:
    return int(text[1:3], 16), int(text[3:5], 16), int(text[5:7], 16)


def _mix(colour: Colour, other: Colour, share: float) -> Colour:
    red, green, blue = (round(a + (b - a) * share) for a, b in zip(colour, other, strict=True))
    return red, green, blue


class FigurePainter:
    """Draws a fixed set of tracks side by side; one instance per video.

    Args:
        tracks: Label -> motion.
        size: Width and height of the picture, pixels.

    Raises:
        CospeechError: No tracks, a motion that is empty or not finite, or Pillow is missing.
    """

    def __init__(self, tracks: Mapping[str, Motion], size: tuple[int, int]) -> None:
        try:
            import PIL  # noqa: F401
        except ImportError as error:
            raise CospeechError(
                "pictures and video need Pillow", 'pip install "cospeech[video]"'
            ) from error
        if not tracks:
            raise CospeechError("no motion to draw", "give at least one track")
        for name, motion in tracks.items():
            check_drawable(name, motion)
        self.tracks = dict(tracks)
        self.size = size
        width, height = (_SUPERSAMPLE * side for side in size)
        self._band = round(0.14 * height)
        edges = [round(i * width / len(tracks)) for i in range(len(tracks) + 1)]
        self._lefts = edges[:-1]
        cells = [(b - a, height - self._band) for a, b in itertools.pairwise(edges)]
        room = extents(tracks)
        fitted = [
            Camera(motion, cell, room[name])
            for (name, motion), cell in zip(tracks.items(), cells, strict=True)
        ]
        # one distance for all, so that sizes compare
        distance = max(camera.distance for camera in fitted)
        self._cameras = [
            Camera(motion, cell, room[name], distance)
            for (name, motion), cell in zip(tracks.items(), cells, strict=True)
        ]
        self._figures = [figure_of(motion) for motion in tracks.values()]
        self._grounds: dict[int, tuple[bytes, Image]] = {}
        self._label_font = _font(round(0.034 * height))
        self._word_font = _font(round(0.046 * height))

    def paint(self, time: float, line: tuple[Word, ...] = ()) -> Image:
        """The picture at a time, seconds, with a subtitle line; its current word is coloured."""
        from PIL import Image, ImageDraw

        width, height = (_SUPERSAMPLE * side for side in self.size)
        canvas = Image.new("RGB", (width, height), _BACKGROUND)
        for i, motion in enumerate(self.tracks.values()):
            frame = min(int(time * motion.fps + _FRAME_TOLERANCE), len(motion) - 1)
            cell = self._ground(i, frame).copy()
            self._draw_figure(ImageDraw.Draw(cell), i, motion.positions[frame], frame)
            canvas.paste(cell, (self._lefts[i], 0))
        draw = ImageDraw.Draw(canvas)
        for left in self._lefts[1:]:
            draw.line((left, 0, left, height - self._band), fill=_SHADOW, width=_SUPERSAMPLE)
        self._subtitle(draw, (width, height), line, time)
        return canvas.reduce(_SUPERSAMPLE)

    def _ground(self, track: int, frame: int) -> Image:
        """A cell with its grid and label; drawn again only when the camera has moved."""
        from PIL import Image, ImageDraw

        camera = self._cameras[track]
        place = np.round(camera.path[frame], 3).tobytes()
        if track in self._grounds and self._grounds[track][0] == place:
            return self._grounds[track][1]
        cell = Image.new("RGB", camera.cell, _BACKGROUND)
        draw = ImageDraw.Draw(cell)
        _draw_grid(draw, camera, frame)
        margin = round(0.03 * camera.cell[1])
        label = one_line(list(self.tracks)[track])
        draw.text((margin, margin), label, font=self._label_font, fill=_TEXT)
        self._grounds[track] = (place, cell)
        return cell

    def _draw_figure(
        self, draw: ImageDraw, track: int, positions: NDArray[np.float32], frame: int
    ) -> None:
        camera = self._cameras[track]
        figure = self._figures[track]
        points = figure.points(positions)
        below = camera.project(camera.shadows(points), frame)
        for limb in figure.limbs:
            ends = [limb.upper, limb.lower]
            radii = limb.radius * below.scale[ends]
            # seen from this low, a disc on the ground is a flat ellipse: half the bone's width
            _capsule(draw, below.pixels[ends], 0.5 * radii, _SHADOW)

        seen = camera.project(points, frame)
        strokes: list[tuple[float, str, NDArray[np.float64], NDArray[np.float64]]] = []
        for limb in figure.limbs:
            bone = points[[limb.upper, limb.lower]].astype(np.float64)
            if figure.skull is not None and limb.upper == len(positions):
                # the nose: what of it is inside the skull would be painted over the face
                share = 0.92 * figure.skull.radius / float(np.linalg.norm(bone[1] - bone[0]))
                if share >= 1:
                    continue
                bone[0] += (bone[1] - bone[0]) * share
            at = camera.project(bone, frame)
            radii = limb.radius * at.scale * np.array([1.0, 0.84])
            strokes.append((float(at.depth.mean()), limb.part, at.pixels, radii))
        for ball in figure.balls:
            ends = [ball.point, ball.point]
            radii = ball.radius * seen.scale[ends]
            strokes.append((float(seen.depth[ball.point]), ball.part, seen.pixels[ends], radii))
        strokes.sort(key=lambda stroke: -stroke[0])
        for depth, part, ends_px, radii in strokes:
            # far bones pale towards the background, near ones keep their colour
            fade = float(np.clip((depth - camera.distance) / 1.6 + 0.12, 0.0, 0.4))
            colour = _mix(_rgb(PART_COLOURS[part]), _BACKGROUND, fade)
            _rim(draw, ends_px, radii + 1.5 * _SUPERSAMPLE)
            _capsule(draw, ends_px, radii, _mix(colour, (20, 26, 40), 0.22))
            lit = ends_px + np.stack([-0.14 * radii, -0.18 * radii], axis=1)
            _capsule(draw, lit, 0.78 * radii, colour)
            gleam = ends_px + np.stack([-0.32 * radii, -0.36 * radii], axis=1)
            _capsule(draw, gleam, 0.26 * radii, _mix(colour, (255, 255, 255), 0.28))

    def _subtitle(
        self, draw: ImageDraw, size: tuple[int, int], line: tuple[Word, ...], time: float
    ) -> None:
        font = self._word_font
        space = draw.textlength(" ", font=font)
        texts = [one_line(word.text) for word in line]
        widths = [draw.textlength(text, font=font) for text in texts]
        x = (size[0] - sum(widths) - space * max(len(line) - 1, 0)) / 2
        y = size[1] - 0.5 * self._band
        for word, text, width in zip(line, texts, widths, strict=True):
            current = word.start <= time + 1e-6 < word.end
            draw.text((x, y), text, font=font, fill=_ACCENT if current else _MUTED, anchor="lm")
            x += width + space


def _draw_grid(draw: ImageDraw, camera: Camera, frame: int) -> None:
    centre = camera.path[frame]
    count = round(_GRID_REACH_M / _GRID_STEP_M)
    near = np.round(centre / _GRID_STEP_M) * _GRID_STEP_M
    along = np.linspace(-_GRID_REACH_M, _GRID_REACH_M, 29)
    for axis in (0, 1):
        for i in range(-count, count + 1):
            ground = np.empty((len(along), 2))
            ground[:, axis] = near[axis] + i * _GRID_STEP_M
            ground[:, 1 - axis] = centre[1 - axis] + along
            pixels = camera.project(np.insert(ground, 1, camera.floor, axis=1), frame).pixels
            away = np.linalg.norm(ground - centre, axis=1) / _GRID_REACH_M
            for k in range(len(along) - 1):
                strength = max(0.0, 1 - (away[k] + away[k + 1]) / 2) ** 1.3
                colour = _mix(_BACKGROUND, _GRID, strength)
                ends = [(float(x), float(y)) for x, y in pixels[k : k + 2]]
                draw.line(ends, fill=colour, width=_SUPERSAMPLE)


def _font(pixels: int) -> FreeTypeFont | BitmapFont:
    from PIL import ImageFont

    # Pillow's own font is Latin only; a transcript may not be
    for name in ("DejaVuSans.ttf", "NotoSans-Regular.ttf", "Arial.ttf", "arial.ttf"):
        try:
            return ImageFont.truetype(name, pixels)
        except OSError:
            continue
    return ImageFont.load_default(pixels)


def _sides(
    ends: NDArray[np.float64], radii: NDArray[np.float64], inset: float
) -> list[tuple[float, float]] | None:
    """Corners of the quadrilateral between two discs, shortened by ``inset`` at both ends."""
    along = ends[1] - ends[0]
    length = math.hypot(*along)
    if length <= 2 * inset + 1e-6:
        return None
    along = along / length
    across = np.array([-along[1], along[0]])
    a, b = ends[0] + along * inset, ends[1] - along * inset
    corners = (
        a + across * radii[0],
        b + across * radii[1],
        b - across * radii[1],
        a - across * radii[0],
    )
    return [(float(x), float(y)) for x, y in corners]


def _capsule(
    draw: ImageDraw, ends: NDArray[np.float64], radii: NDArray[np.float64], colour: Colour
) -> None:
    corners = _sides(ends, radii, 0.0)
    if corners is not None:
        draw.polygon(corners, fill=colour)
    for (x, y), radius in zip(ends, radii, strict=True):
        draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=colour)


def _rim(draw: ImageDraw, ends: NDArray[np.float64], radii: NDArray[np.float64]) -> None:
    """A line of background along a bone's sides, so that crossing bones stay apart.

    It stops short of the joints: a rim around them would cut the next bone of the chain.
    """
    corners = _sides(ends, radii, float(radii.max()))
    if corners is not None:
        draw.polygon(corners, fill=_BACKGROUND)
