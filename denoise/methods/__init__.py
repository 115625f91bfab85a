"""The denoisers: one file, one method."""
