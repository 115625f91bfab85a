"""The command line."""

from .group import app, main

__all__ = ["app", "main"]
