"""The pictures of a scored sequence: contact sheets, a movie, speed against error.

In `pictures/`: `sheet_FRAME.png` for a few frames (input, each method, reference, and the error
of each below it), `sequence.mp4` (input, a method or more, reference, side by side), and
`speed_against_error.png`. All show `denoise/tonemap.py`'s sRGB, all files appear complete.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from PIL import Image

from onespp.denoise.metrics.image import pair
from onespp.denoise.metrics.table import HEADLINE
from onespp.denoise.metrics.tonemap import bytes_from_linear
from onespp.denoise.score.scorecard import INPUT, Scores
from onespp.render.files.atomic import replacing
from onespp.render.files.frame_ranges import spread
from onespp.render.files.sequence import FrameSequence
from onespp.render.progress import Progress, silent

from .movie import MovieError, write_movie
from .panels import GAP, error_legend, error_picture, panel, resize, scaled_size, tile
from .speed_error_plot import plot_speed_against_error

SHEETS = 3
WANTED, LARGE_ENOUGH, WIDEST = 480, 640, 3960  # widths in pixels: see `contact_sheet`



def draw_pictures(sequence: FrameSequence, scores: Scores, movie_methods: list[str] | None = None,
                  progress: Progress = silent, movie: bool = True) -> list[str]:
    """Write all pictures of a sequence, one frame in memory at a time.

    Args:
        movie_methods: methods in the movie; default: the one with the highest PSNR.
        progress: counts pictures.
        movie: make one; else an old one stays.
    Returns:
        one sentence for each picture that could not be made.
    """
    folder = sequence.folder / "pictures"
    chosen = spread(scores.frames, SHEETS)
    sheets = {frame: folder / f"sheet_{frame:04d}.png" for frame in chosen}
    total = len(chosen) + len(scores.frames) + 1
    plot_speed_against_error(scores, folder / "speed_against_error.png")
    progress(1, total, "pictures")
    for n, (frame, path) in enumerate(sheets.items()):
        with replacing(path) as part:
            contact_sheet(sequence, scores, frame).save(part, format="PNG")
        progress(n + 2, total, "pictures")
    for old in {*folder.glob("sheet_*.png")} - {*sheets.values()}:
        old.unlink()  # of other frames, from when the sequence had others

    def told(pictures: Iterator[np.ndarray]) -> Iterator[np.ndarray]:
        for n, picture in enumerate(pictures):
            yield picture
            progress(len(chosen) + 2 + n, total, "pictures")

    if not movie:
        return []
    names = movie_methods if movie_methods is not None else best_method(scores)
    try:
        write_movie(folder / "sequence.mp4", told(movie_pictures(sequence, scores, names)),
                    sequence.manifest.fps)
    except MovieError as error:
        return [f"There is no movie: {error}."]
    return []


def best_method(scores: Scores) -> list[str]:
    """The method with the highest PSNR; without a reference, the first; none if there is none."""
    others = [name for name in scores.methods if name != INPUT]
    return sorted(others, key=lambda n: -(scores.methods[n][HEADLINE.name] or 0))[:1]


def contact_sheet(sequence: FrameSequence, scores: Scores, frame: int) -> Image.Image:
    """Input, every method that has this frame from fast to slow, reference; below each its error.

    The reference has none: the colours' scale is there. Small pictures grow to about `WANTED`
    pixels in width, large ones shrink to `LARGE_ENOUGH`, a sheet has as many rows as it takes.
    """
    methods = [name for name in scores.ordered() if name != INPUT]
    images = list(_images(sequence, scores, frame, methods))
    columns = _columns(len(images), sequence.size)
    size = scaled_size(sequence.size, columns, WANTED, columns * (LARGE_ENOUGH + GAP) + GAP)
    reference = images[-1][2] if sequence.has_reference(frame) else None
    panels = []
    for name, value, image in images:
        shown = [resize(bytes_from_linear(image), size)]
        if reference is not None:
            shown.append(error_legend(size) if image is reference else
                         resize(error_picture(display_error(image, reference)), size))
        panels.append(panel(name, value, shown))
    width, height = scores.size
    heading = f"{scores.scene}, frame {frame}, {width}x{height}"
    if reference is not None:
        heading += f"; {HEADLINE.label} in {HEADLINE.unit} on {scores.tone_map}"
    return tile(panels, columns, heading)


def _columns(count: int, size: tuple[int, int]) -> int:
    """Columns of a sheet of `count` panels: one row if they are then still large enough."""
    _, width = scaled_size(size, 1, WANTED, LARGE_ENOUGH + 2 * GAP)
    rows = -(-count * (width + GAP) // (WIDEST - GAP))
    return -(-count // rows)


def movie_pictures(sequence: FrameSequence, scores: Scores,
                   methods: list[str]) -> Iterator[np.ndarray]:
    """One picture a frame: input, methods, reference, with each frame's PSNR."""
    columns = 1 + len(methods) + scores.has_reference
    size = scaled_size(sequence.size, columns, 1920 // columns, WIDEST)
    empty = Image.new("RGB", (size[1], size[0]))
    for frame in scores.frames:
        there = {name: (value, image) for name, value, image
                 in _images(sequence, scores, frame, methods)}
        names = [INPUT, *methods, *(["reference"] if scores.has_reference else [])]
        panels = []
        for name in names:
            value, image = there.get(name, ("missing", None))
            panels.append(panel(name, value, [
                empty if image is None else resize(bytes_from_linear(image), size)]))
        yield np.asarray(tile(panels, columns))


def display_error(image: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """(h, w) mean over R, G, B of |S(a) - S(b)|; non-finite pixels as in the scores."""
    return next(display_errors([image], reference))


def display_errors(images: Iterable[np.ndarray], reference: np.ndarray) -> Iterator[np.ndarray]:
    """`display_error` of several images of one reference."""
    for image in images:
        a, b = pair(image, reference).srgb
        yield np.abs(a - b).mean(axis=-1)


def _images(sequence: FrameSequence, scores: Scores, frame: int,
            methods: list[str]) -> Iterator[tuple[str, str, np.ndarray]]:
    """(name, what to say of it, linear image) of what there is of a frame, reference last."""
    def value(method: str) -> str:
        db = next((row[HEADLINE.name] for row in scores.methods[method].per_frame
                   if row.frame == frame), None)
        return "" if db is None else f"{db:{HEADLINE.format}} {HEADLINE.unit}"

    yield INPUT, value(INPUT), sequence.read_frame(frame, ("color",))["color"]
    for method in methods:
        if sequence.has_result(method, frame):
            yield method, value(method), sequence.read_result(method, frame)
    if sequence.has_reference(frame):
        reference = sequence.read_reference(frame)
        floor = scores.headline_floors.get(frame)
        cap = "" if floor is None else f", noise floor {floor:.1f} {HEADLINE.unit}"
        yield "reference", f"{reference.spp or 'unknown'} spp{cap}", reference.color
