"""Measures of error, in NumPy."""
