"""What rendering costs and what it is worth, measured against Mitsuba's own integrators."""
