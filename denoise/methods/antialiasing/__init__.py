"""Temporal anti-aliasing, on its own and after our filter."""
