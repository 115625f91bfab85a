"""How fast the kernels are, and how fast they could be."""
