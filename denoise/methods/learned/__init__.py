"""Networks that were trained here: their plans and weights, in NumPy, and their layers in Dr.Jit.
"""
