"""Filters that fit feature buffers to noise, instead of averaging neighbours."""
