"""Writes the page docs/ladder.md and its pictures: from the Gaussian filter to `onespp`.

    python docs/ladder.py                                  # some minutes on two cores
    python docs/ladder.py --frames 0:2 --size 32x32 --reference-spp 4 --data build/tiny/data \\
        --out build/tiny                                   # seconds, to see that it works

A rung is a method: the idea that it adds, what it costs, what still fails, and one picture, always
of the last frame: the denoised image, and beside it its error. What a rung says stands here; what
it measures is filled in. The sequence is kept in data/ladder, and so are its references.
"""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np
from pictures import beside_error, jpeg
from results import ROOT, denoise, render, say, scores_in, table

from onespp.denoise.catalog import build
from onespp.denoise.metrics.table import HEADLINE
from onespp.denoise.report.panels import error_legend
from onespp.denoise.run.interleaved_timing import time_methods
from onespp.denoise.score.scorecard import INPUT
from onespp.render.cli.options import use
from onespp.render.cli.terminal import run as run_command
from onespp.render.files.atomic import write_bytes, write_text
from onespp.render.files.lock import writing
from onespp.render.files.sequence import FrameSequence

SHOWN = 512  # width in pixels at which the page shows the pictures


@dataclass(frozen=True)
class Rung:
    """A method, and what it teaches: Markdown."""

    method: str
    idea: str
    fails: str


RUNGS = (
    Rung("gaussian",
         "Noise is independent from pixel to pixel, and light is not: a mean over neighbours keeps "
         "the light and cancels the noise. Those nearby count more, by a bell over the distance.",
         "Noise is gone, and so is the picture. Nothing tells an edge from noise: the lamp "
         "bleeds into the ceiling, every contour is an error as wide as the bell, and clipped "
         "display values score no better than the noise did."),
    Rung("gaussian-separable",
         "The bell in two dimensions is the product of two in one: a pass along rows and one "
         "along columns give the same numbers with 2 N taps instead of N^2.",
         "The same as before, for it is the same image. It is the last rung where this holds: "
         "weights that look at the picture do not factor."),
    Rung("bilateral-color",
         "Do not average across an edge: a neighbour counts less the more its colour differs. "
         "One weight more, and the lamp stays where it is.",
         "The colour that shall tell edges is the noisy one. A sigma that is wide enough for the "
         "noise lets walls and cube through, and these run into one another more than under the "
         "bell, since the window is wide; pixels that are farther off than that keep "
         "their noise, and stay as bright dots."),
    Rung("bilateral",
         "A renderer knows more than a photograph: normals and positions of the first hit have "
         "no noise. The same filter, joint with these guides, stops at corners and contours.",
         "Guides know surfaces and not light. Shadows have no normal: they are smeared, and so "
         "is the lamp's falloff on walls. Bright dots are still farther off than sigma."),
    Rung("atrous",
         "A window of 5x5 taps, five times over, with holes between the taps that double: as "
         "wide as 125 pixels for 125 taps. How much colours may differ is no number any more, "
         "but a multiple of the noise's own deviation, estimated around each pixel. Texture is "
         "divided out first.",
         "One frame is all there is: too little for the ball's reflections, which stay spots, and "
         "for the shadows, which stay blotches. Both are others in every frame: still walls boil."),
    Rung("temporal",
         "The last frame saw the same surfaces. Motion from the renderer's own matrices finds "
         "where each was; its history, clamped to what is likely now, is averaged on. Samples "
         "add up over frames, and nothing is blurred.",
         "What was hidden a frame ago has no history, and is as noisy as the input: look beside "
         "what moves. Where light has changed, history is wrong until the clamp notices, and its "
         "bounds are as wide as the noise."),
    Rung("assignment",
         "Both at once: first the joint bilateral filter over space, then the history over time. "
         "This is the assignment of GAMES202.",
         "History averages noise, and not bias: shadows that the filter smeared stay smeared, "
         "however long one waits."),
    Rung("svgf",
         "The other order: first history, over direct and indirect light apart, then the a-trous "
         "filter. With many frames the variance can be measured at each pixel, and the "
         "filter narrows where history has done its work.",
         "History has a fixed share, four fifths. The shadow of what moves drags a ghost behind "
         "it, and what turns in the light is lit as it was: board and cube show as a whole."),
    Rung("asvgf",
         "Ask whether light has changed. A few samples of the last frame are shaded again with "
         "the same random numbers: what differs then is the light, and history gives way there.",
         "One answer for a neighbourhood, from few samples of it. The same errors in the same "
         "places, only smaller: a shadow's edge is finer than what was asked, and where history "
         "is dropped, noise comes back."),
    Rung("onespp",
         "Measure by how much. What the frame says beyond history, smoothed over the surface, "
         "is the change of light with little noise, and history takes its share of it. "
         "Visibility has a history that moves with the shadow and not with the surface, and a "
         "filter as wide as the penumbra. The last filter is for the eye alone and is "
         "not fed back.",
         "What is left is in the ball's reflections and under it, along the edges of the room, in "
         "the noise of indirect light, and in the reference's own."),
)


class Ladder:
    """The sequence that all rungs are measured on, its scores, and where the page goes."""

    def __init__(self, sequence: FrameSequence, out: Path, rounds: int) -> None:
        self.sequence, self.out, self.frame = sequence, out, sequence.frames[-1]
        methods = {rung.method: build(rung.method) for rung in RUNGS}
        denoise(sequence, methods, again=False)
        say("times in turns")
        with writing(sequence.folder, "time"):
            self.times = time_methods(sequence, methods, rounds=rounds)
        self.scores = scores_in(sequence.folder)
        self.reference = sequence.read_reference(self.frame).color

    def write(self, command: str) -> None:
        """The page and its pictures."""
        pictures = self.out / "ladder"
        write_bytes(pictures / "input.jpg", self.picture(
            self.sequence.read_frame(self.frame, ("color",))["color"]))
        height, width = self.sequence.size  # the scale is shown at the size of the others
        write_bytes(pictures / "scale.jpg", jpeg(np.asarray(error_legend((70, 2 * width)))))
        for rung in RUNGS:
            write_bytes(pictures / f"{rung.method}.jpg",
                        self.picture(self.sequence.read_result(rung.method, self.frame)))
        rows = [(f"`{r.method}`", self.decibels(r.method),
                 f"{self.scores.methods[r.method]['flicker']:.3f}", self.cost(r.method))
                for r in RUNGS]
        summary = table(("rung", "PSNR, dB", "flicker", "time"),
                        [("input, 1 spp", self.decibels(INPUT),
                          f"{self.scores.methods[INPUT]['flicker']:.3f}", ""), *rows])
        rungs = "\n\n".join(self.section(n, rung) for n, rung in enumerate(RUNGS, 1))
        write_text(self.out / "ladder.md", PAGE.format(
            frame=self.frame, frames=len(self.sequence.frames), width=width, height=height,
            spp=self.sequence.manifest.reference_spp, command=command, summary=summary,
            rungs=rungs, ratio_to=self.times.ratio_to,
            input=self.image("input", "1 spp and its error"),
            scale=self.image("scale", "colours of the error")))

    def section(self, number: int, rung: Rung) -> str:
        picture = self.image(rung.method, f"{rung.method} and its error")
        measured = (f"{self.decibels(rung.method)} dB, and {self.cost(rung.method)} times the time "
                    f"of `{self.times.ratio_to}`.")
        return "\n\n".join((f"## {number}. `{rung.method}`", textwrap.fill(rung.idea, 100),
                            picture, measured,
                            textwrap.fill(f"**What fails.** {rung.fails}", 100)))

    def decibels(self, name: str) -> str:
        return f"{self.scores.methods[name][HEADLINE.name]:.1f}"

    def cost(self, name: str) -> str:
        return f"{self.times.methods[name].ratio:.2g}"

    def picture(self, image: np.ndarray) -> bytes:
        """The image, and its error beside it."""
        return jpeg(beside_error([image], self.reference))

    @staticmethod
    def image(name: str, about: str) -> str:
        return f'<img src="ladder/{name}.jpg" alt="{about}" width="{SHOWN}">'


PAGE = """\
# From the Gaussian to onespp

<!-- Written by docs/ladder.py, which holds the words too: change them there. -->

Every filter of the course is a method here. This page climbs them, one idea a rung, with its
picture, what it costs and what still fails. The picture is always of frame {frame}, the last of
{frames} of `box` at {width}x{height}: left what the method makes, right its error against a
reference of {spp} samples a pixel, on one scale for all.

{input}

{scale}

Above is the input: one sample a pixel. The figures are means over the {frames} frames; at this size
the fixed cost of a call weighs more than in [the large tables](results.md). Papers, formulas and
parameters are in [](methods.md).

{summary}

Time is over that of `{ratio_to}`, measured in turns. Flicker is change over time where the
surface stays the same, less is better ([](metrics.md)). The page is written by

```sh costly
{command}
```

{rungs}
"""


@click.command()
@click.option("--frames", default="0:8", show_default=True, metavar="RANGE", help="Frames of box.")
@click.option("--size", default="128x128", show_default=True, metavar="WxH")
@click.option("--reference-spp", default=256, show_default=True, metavar="N")
@click.option("--rounds", default=5, show_default=True, metavar="N", help="Of the times.")
@click.option("--data", type=click.Path(path_type=Path), default=ROOT / "data/ladder",
              metavar="DIR", help="Folder of the sequence; default data/ladder.")
@click.option("--out", type=click.Path(path_type=Path), default=ROOT / "docs", metavar="DIR",
              help="Where ladder.md and ladder/ go; default docs.")
@click.option("--threads", type=int, metavar="N", help="CPU threads; default all.")
def ladder(frames: str, size: str, reference_spp: int, rounds: int, data: Path, out: Path,
           threads: int | None) -> None:
    """Write the page that climbs from the Gaussian filter to onespp, and its pictures."""
    use("auto", threads)
    sequence = render(data, "box", frames, size, reference_spp, seed=0)
    Ladder(sequence, out, rounds).write(
        f"python docs/ladder.py --frames {frames} --size {size} --reference-spp {reference_spp}")
    say(f"wrote {out / 'ladder.md'} and {len(RUNGS) + 2} pictures")


if __name__ == "__main__":
    run_command(ladder, name="python docs/ladder.py")
