"""Methods run over sequences, and timed."""
