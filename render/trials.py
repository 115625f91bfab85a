"""Each library that work depends on, tried on the smallest thing that we use it for.

A library may end the process that calls it, or never return, so every trial runs in a process of
its own, and what becomes of that is told in a sentence. Imported by `doctor` alone.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

SECONDS = 120  # a machine under load compiles its first kernel in 10


class TrialError(Exception):
    """What a library did wrong, as the end of a sentence that begins with its name."""


@dataclass(frozen=True)
class Trial:
    """A library's trial.

    Attributes:
        run: does something in an empty folder and says what, in a few words.
        package: what pip calls it.
        without: what is lost where it fails; "" where nothing goes on.
    """

    run: Callable[[Path], str]
    package: str
    without: str = ""


def _openexr(folder: Path) -> str:
    from onespp.render.files.exr import read_exr, write_exr

    image = np.linspace(0, 1, 64 * 48, dtype=np.float32).reshape(48, 64)
    for _ in range(8):  # threads that race need some tries
        write_exr(folder / "a.exr", {"Z": image, "half": image.astype(np.float16)})
        back, _ = read_exr(folder / "a.exr")
        _expect(np.array_equal(back["Z"], image), "read another image than it wrote")
    return "wrote and read a file"


def _pillow(folder: Path) -> str:
    from PIL import Image, ImageDraw, ImageFont

    image = Image.new("RGB", (64, 48))
    ImageDraw.Draw(image).text((2, 2), "0", font=ImageFont.load_default(size=20))
    image.save(folder / "a.png")
    _expect(np.array_equal(np.asarray(Image.open(folder / "a.png")), np.asarray(image)),
            "read another image than it wrote")
    return "wrote and read a file"


def _matplotlib(folder: Path) -> str:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(1, 1))
    figure.add_subplot().plot([0, 1])
    FigureCanvasAgg(figure).print_png(folder / "a.png")
    _expect((folder / "a.png").read_bytes()[1:4] == b"PNG", "wrote no picture")
    return "drew a plot"


def _kernel(folder: Path) -> str:
    from .host import backend

    device = backend.choose()
    import drjit as dr

    module = getattr(dr, device)
    total = dr.sum(module.Float(dr.arange(module.UInt32, 1000)))[0]
    _expect(total == 499500, f"computed a wrong sum on {device}: {total}")
    count = dr.thread_count()
    return f"ran on {device}, {count} thread{'s' * (count != 1)}"


def _mitsuba(folder: Path) -> str:
    from onespp.render.mitsuba.variant import mi

    scene = mi.load_dict({
        "type": "scene", "integrator": {"type": "path"}, "light": {"type": "constant"},
        "sensor": {"type": "perspective", "film": {"type": "hdrfilm", "width": 1, "height": 1},
                   "sampler": {"type": "independent"}}})
    mi.Bitmap(mi.render(scene, spp=1)).write(str(folder / "a.exr"))
    pixel = np.array(mi.Bitmap(str(folder / "a.exr")))[0, 0, :3]
    _expect(np.allclose(pixel, 1, atol=1e-3), f"rendered {pixel} in place of white")
    return f"rendered a pixel ({mi.variant()})"


def _movie(folder: Path) -> str:
    import av

    with av.open(str(folder / "a.mp4"), "w") as file:
        stream = file.add_stream("libx264", rate=24)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for _ in range(2):
            file.mux(stream.encode(av.VideoFrame.from_ndarray(np.zeros((48, 64, 3), np.uint8))))
        file.mux(stream.encode(None))
    with av.open(str(folder / "a.mp4")) as file:
        frames = sum(1 for _ in file.decode(video=0))
    _expect(frames == 2, f"read {frames} frames of a video of 2")
    return "wrote and read a video"


def _oidn(folder: Path) -> str:
    import mitsuba_oidn as oidn

    white = np.ones((16, 16, 3), np.float32)
    device = oidn.Device(oidn.DeviceType.CPU)
    _expect(np.allclose(oidn.denoise(white, device=device), 1, atol=0.1),
            "made a white image another")
    return f"denoised an image (version {oidn.oidn_version()})"


TRIALS: dict[str, Trial] = {
    "OpenEXR": Trial(_openexr, "OpenEXR"),
    "test kernel": Trial(_kernel, "drjit"),
    "Mitsuba": Trial(_mitsuba, "mitsuba"),
    "Pillow": Trial(_pillow, "pillow"),
    "Matplotlib": Trial(_matplotlib, "matplotlib"),
    "PyAV": Trial(_movie, "av", "movies are left out"),
    "Open Image Denoise": Trial(_oidn, "mitsuba-oidn", "there are no OIDN rows in tables"),
}


def attempt(name: str, seconds: float = SECONDS) -> str:
    """What a library did in a process of its own.

    Raises:
        TrialError: what it did wrong, and what to do.
    """
    package = TRIALS[name].package
    again = f"run `{sys.executable} -m pip install --force-reinstall {package}`"
    with tempfile.TemporaryDirectory(prefix="onespp-") as folder:
        try:
            done = subprocess.run(
                [sys.executable, "-m", __name__, name, folder], stdin=subprocess.DEVNULL,
                capture_output=True, timeout=seconds, check=False,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(map(os.path.abspath, sys.path)),
                     "PYTHONIOENCODING": "utf-8"})
        except subprocess.TimeoutExpired:
            raise TrialError(f"did not come to an end in {seconds:g} s: {again}") from None
    if done.returncode == 0:
        return _last(done.stdout)
    if done.returncode < 0:
        try:
            how = signal.Signals(-done.returncode).name
        except ValueError:
            how = str(-done.returncode)
        raise TrialError(f"crashed ({how}) where it was tried: {again}, or use another version of "
                         f"Python than {sys.version.split()[0]}")
    raise TrialError(_last(done.stderr) or f"ended with exit code {done.returncode}: {again}")


def _expect(holds: object, otherwise: str) -> None:
    if not holds:
        raise TrialError(otherwise)


def _last(output: bytes) -> str:
    """The last line of a process's output, made fit for a line of ours."""
    lines = [line for line in output.decode(errors="replace").splitlines() if line.strip()]
    return "".join(c if c.isprintable() else "?" for c in lines[-1].strip())[:300] if lines else ""


def main() -> None:
    """Run one trial here: its name and an empty folder are the arguments."""
    name, folder = sys.argv[1:]
    from .errors import InputError

    try:
        print(TRIALS[name].run(Path(folder)))
    except (TrialError, InputError) as error:
        sys.exit(str(error))
    except Exception as error:
        sys.exit(f"{type(error).__name__}: {error}")


if __name__ == "__main__":
    main()
