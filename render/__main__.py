"""`python -m render`: the same as `onespp render`."""

from .command import render
from .terminal import run

run(render, name="python -m render")
