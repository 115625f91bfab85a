"""Experiments: what parts are worth, how far a method leads, hard scenes, tuning."""
