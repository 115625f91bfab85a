"""Scores of a sequence: every method against the reference, frame by frame."""
