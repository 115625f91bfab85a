"""Scenes of other programs' files as descriptions of ours, and moves for what stands still."""
