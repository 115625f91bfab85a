"""A frame as kernels read it: surfaces, colour, signals, shadow rays."""
