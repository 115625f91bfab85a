"""Cameras, motion and correspondence in NumPy float64."""
