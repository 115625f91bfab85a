"""The commands that denoise, time, score and compare."""
