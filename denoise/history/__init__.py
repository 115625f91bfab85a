"""Reprojection, and what is carried along it."""
