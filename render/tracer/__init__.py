"""The path tracer: frames, references and replayed samples."""
