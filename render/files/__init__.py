"""Sequences on disk: images, matrices, manifests; whole or not there."""
