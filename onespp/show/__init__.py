"""What a notebook shows of frames, sequences and scores; NumPy and the standard library alone."""
