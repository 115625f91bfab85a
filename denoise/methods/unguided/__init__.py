"""Filters that weigh by screen and colour alone, as a photograph has them: the lecture's first."""
