"""`python -m denoise`: the same as `onespp denoise`."""

from render.terminal import run

from .command import denoise

run(denoise, name="python -m denoise")
