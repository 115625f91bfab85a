"""Networks that remember: their plan and weights, in NumPy, and their layers in Dr.Jit."""
