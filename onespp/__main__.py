"""`python -m onespp`: the same as `onespp`."""

from .cli import main

main()
