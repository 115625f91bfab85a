"""Labelled pictures side by side: what contact sheets and movies are made of.

A panel is a heading (name left, value right) over pictures of one size; `tile` sets panels in a
grid. Everything is 8-bit sRGB on a dark ground, with Pillow's own font.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from matplotlib import colormaps
from PIL import Image, ImageDraw, ImageFont

GROUND, INK, DIM = (22, 24, 29), (238, 240, 243), (150, 156, 166)
GAP = 10
ERROR_MAX = 0.25
"""Error at the bright end of the colour scale, the same in every picture."""

_COLOURS = colormaps["inferno"]


def error_picture(error: np.ndarray) -> np.ndarray:
    """Colours of an (h, w) error of display values: (h, w, 3) uint8.

    The scale is a square root, from 0 to `ERROR_MAX`: what is left by a good denoiser (0.01 to
    0.03) and the noise of its input (above 0.2) are both told apart.
    """
    return _COLOURS(np.sqrt(np.clip(error / ERROR_MAX, 0, 1)), bytes=True)[..., :3]


@cache
def font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size)


def text_size(width: int) -> int:
    """Height in pixels of the text over a picture of that width."""
    return int(np.clip(width // 22, 13, 30))


def scaled_size(size: tuple[int, int], columns: int, wanted: int, widest: int) -> tuple[int, int]:
    """(height, width) at which to show pictures of `size` in a grid of so many columns.

    Small pictures grow by the whole factor that brings them closest to `wanted` pixels in width,
    so that labels are legible; all shrink, if they must, for the grid to be at most `widest` wide.
    """
    height, width = size
    room = (widest - GAP) // columns - GAP
    k = max(1, min(round(wanted / width), room // width))
    if k * width <= room:
        return k * height, k * width
    return max(1, round(height * room / width)), room


def resize(picture: np.ndarray, size: tuple[int, int]) -> Image.Image:
    """Enlarged pixels stay square and sharp; shrunken pictures are filtered."""
    image = Image.fromarray(np.ascontiguousarray(picture, np.uint8))
    grows = size[1] >= image.width
    return image.resize((size[1], size[0]),
                        Image.Resampling.NEAREST if grows else Image.Resampling.LANCZOS)


def panel(name: str, value: str, pictures: list[Image.Image]) -> Image.Image:
    """Heading over `pictures`, top to bottom, all of the first one's size."""
    width, height = pictures[0].size
    size = text_size(width)
    head = round(1.7 * size)
    image = Image.new("RGB", (width, head + len(pictures) * (height + GAP) - GAP), GROUND)
    draw = ImageDraw.Draw(image)
    middle = head // 2
    room = width - draw.textlength(value, font(size)) - size
    draw.text((1, middle), shortened(name, size, room), INK, font(size), anchor="lm")
    draw.text((width - 2, middle), value, DIM, font(size), anchor="rm")
    for i, picture in enumerate(pictures):
        image.paste(picture, (0, head + i * (height + GAP)))
    return image


def shortened(text: str, size: int, room: float) -> str:
    """`text`, cut with three dots where it is longer than `room` pixels."""
    if font(size).getlength(text) <= room:
        return text
    while text and font(size).getlength(text + "...") > room:
        text = text[:-1]
    return text + "..."


def tile(panels: list[Image.Image], columns: int, heading: str = "") -> Image.Image:
    """Panels of one size in rows, under an optional heading; height and width are even."""
    width, height = panels[0].size
    rows = -(-len(panels) // columns)
    size = text_size(width)
    top = GAP + (round(2.2 * size) if heading else 0)
    full = (columns * (width + GAP) + GAP, top + rows * (height + GAP))
    image = Image.new("RGB", (full[0] + full[0] % 2, full[1] + full[1] % 2), GROUND)
    draw = ImageDraw.Draw(image)
    if heading:
        draw.text((GAP + 1, GAP + round(1.1 * size)),
                  shortened(heading, size, full[0] - 2 * GAP), INK, font(size), anchor="lm")
    for i, picture in enumerate(panels):
        row, column = divmod(i, columns)
        image.paste(picture, (GAP + column * (width + GAP), top + row * (height + GAP)))
    return image


def error_legend(size: tuple[int, int]) -> Image.Image:
    """The colour scale of `error_picture`, in a picture of (height, width)."""
    height, width = size
    image = Image.new("RGB", (width, height), GROUND)
    draw = ImageDraw.Draw(image)
    text = text_size(width)
    left, bar_width, bar_height = round(0.1 * width), round(0.8 * width), max(8, height // 12)
    top = height // 2 - bar_height // 2
    ramp = error_picture(ERROR_MAX * np.linspace(0, 1, bar_width) ** 2)
    image.paste(resize(np.broadcast_to(ramp, (bar_height, bar_width, 3)), (bar_height, bar_width)),
                (left, top))
    draw.text((width // 2, top - round(0.8 * text)), "absolute error, mean of R, G, B (sRGB)", INK,
              font(text), anchor="ms")
    for tick in (0, 0.01, 0.05, 0.1, ERROR_MAX):
        x = left + round(bar_width * np.sqrt(tick / ERROR_MAX))
        draw.line((x, top + bar_height, x, top + bar_height + text // 3), DIM)
        draw.text((x, top + bar_height + text // 2), f"{tick:g}" if tick < ERROR_MAX else
                  f"{tick:g}+", DIM, font(text), anchor="mt")
    return image
