"""Render animations at one sample per pixel, denoise them, score the result."""
