"""The layout of the GAMES202 assignment: found, checked, read and written."""
