"""Filter kernels that several methods share."""
