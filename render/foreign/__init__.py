"""Frames of other renderers, from EXR files of any channel names."""
