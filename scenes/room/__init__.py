"""A pink living room with toys, and all that stands in it."""
