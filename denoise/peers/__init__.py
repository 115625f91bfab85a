"""Denoisers of others, as methods beside ours."""
