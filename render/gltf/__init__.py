"""glTF 2.0 files as scenes: a reader of our own over JSON, NumPy and Mitsuba's images."""
