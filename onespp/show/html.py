"""Frames, sequences and tables as pieces of HTML for a notebook, each complete in itself.

Styles stand in the elements, since a page may hold many pieces, and follow the page's own colours.
"""

from __future__ import annotations

import html
import json
import uuid
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from .pictures import Display, fitted, picture
from .png import data_url

WIDEST, SMALL = 480, 120  # pixels of a picture, and of one among many
_DIM = "color:gray;font-size:90%"


class Shown(NamedTuple):
    """An image, what its values are, and its meaning in a line."""

    image: np.ndarray
    display: Display
    about: str


def frame_html(index: int, images: Mapping[str, Shown]) -> str:
    """The colour of a frame, and below it all channels with their names and meanings."""
    height, width = next(iter(images.values())).image.shape[:2]
    large = _shown("color", images["color"], WIDEST) if "color" in images else ""
    small = "".join(
        f'<figure style="margin:0" title="{html.escape(shown.about)}">'
        f'{_shown(name, shown, SMALL)}<figcaption style="{_DIM}">{name}</figcaption></figure>'
        for name, shown in images.items())
    return (f"<div><div><b>frame {index}</b> <span style='{_DIM}'>{width}x{height}, "
            f"{len(images)} channels</span></div>{large}"
            f'<div style="display:flex;flex-wrap:wrap;gap:6px;margin-top:6px">{small}</div></div>')


def strip_html(title: str, frames: Sequence[int], rows: Mapping[str, Sequence[np.ndarray | None]],
               ) -> str:
    """Pictures side by side, one of each row, of the frame that a slider chooses.

    Args:
        rows: label -> (h, w, 3) linear radiance of each of the frames; None where there is none.
            At most `WIDEST` pixels wide, see `fitted`.
    """
    name = f"onespp-{uuid.uuid4().hex[:12]}"  # pieces of several sessions meet on one page
    addresses = {label: ["" if image is None else data_url(picture(image))
                         for image in images] for label, images in rows.items()}
    figures = "".join(
        f'<figure style="margin:0"><img alt="" src="{urls[0]}" style="{_image(rows[label])}">'
        f'<figcaption style="{_DIM}">{html.escape(label)}</figcaption></figure>'
        for label, urls in addresses.items())
    data = json.dumps({"frames": list(frames), "rows": list(addresses.values())})
    return f"""<div id="{name}"><div><b>{html.escape(title)}</b></div>
<div style="display:flex;flex-wrap:wrap;gap:6px">{figures}</div>
<label><input type="range" min="0" max="{len(frames) - 1}" value="0" style="width:240px;\
vertical-align:middle"> frame <output>{frames[0]}</output></label>
<script>(() => {{
  const all = document.getElementById("{name}"), data = {data};
  const images = all.querySelectorAll("img"), slider = all.querySelector("input");
  slider.addEventListener("input", () => {{
    images.forEach((image, i) => {{ image.src = data.rows[i][slider.value]; }});
    all.querySelector("output").value = data.frames[slider.value];
  }});
}})();</script></div>"""


def table_html(title: str, rows: Mapping[str, Mapping[str, str]], best: set[tuple[str, str]],
               below: Iterable[str]) -> str:
    """A table of texts.

    Args:
        rows: heading of the row -> heading of the column -> text, the same columns in each.
        best: (row, column) of texts to be set in bold. below: sentences under the table.
    """
    right = 'style="text-align:right;padding:2px 8px"'
    columns = list(next(iter(rows.values())))
    head = "".join(f"<th {right}>{html.escape(column)}</th>" for column in columns)
    lines = []
    for name, row in rows.items():
        cells = (f"<b>{html.escape(text)}</b>" if (name, column) in best else html.escape(text)
                 for column, text in row.items())
        lines.append(f'<tr><td style="text-align:left">{html.escape(name)}</td>'
                     + "".join(f"<td {right}>{cell}</td>" for cell in cells) + "</tr>")
    notes = "".join(f'<div style="{_DIM}">{html.escape(sentence)}</div>' for sentence in below)
    return (f"<div><b>{html.escape(title)}</b><table><thead><tr><th></th>{head}</tr></thead>"
            f"<tbody>{''.join(lines)}</tbody></table>{notes}</div>")


def _shown(name: str, shown: Shown, widest: int) -> str:
    small = fitted(shown.image, widest)
    return (f'<img alt="{name}" src="{data_url(picture(small, shown.display))}" '
            f'style="{_style(small.shape[1], widest)}">')


def _image(images: Sequence[np.ndarray | None]) -> str:
    width = next((image.shape[1] for image in images if image is not None), SMALL)
    return _style(width, 2 * SMALL)


def _style(width: int, wanted: int) -> str:
    """Small pictures grow by a whole factor, with square pixels."""
    return (f"display:block;width:{width * max(1, wanted // width)}px;max-width:100%;"
            "image-rendering:pixelated")
