"""Options that several commands share."""

from onespp.render.cli.figures import json_option, show_or_print

__all__ = ["json_option", "show_or_print"]
