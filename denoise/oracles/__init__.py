"""The papers' formulas in float64 NumPy, as plainly as they can be written."""
