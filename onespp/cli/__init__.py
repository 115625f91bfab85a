"""The command line."""

import os
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .group import app

__all__ = ["app", "main"]


def main() -> None:
    """Entry point of the console command, and of a shell that wants a word completed."""
    if "_ONESPP_COMPLETE" in os.environ:
        from .completion import complete

        raise SystemExit(complete())
    from .group import main as run

    run()


def __getattr__(name: str):
    """`app`, which brings every command in, when it is asked for."""
    if name == "app":
        from .group import app

        return app
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
