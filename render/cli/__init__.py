"""The commands that render, and what every command shares."""
