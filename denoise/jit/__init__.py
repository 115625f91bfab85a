"""Images as Dr.Jit arrays: grids, padded planes, recorded steps. Knows nothing of denoising."""
