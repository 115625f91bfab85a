"""Light that a vertex looks for: which points of which lights, and what a shadow ray tells."""
