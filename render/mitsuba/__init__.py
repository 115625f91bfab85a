"""A scene description as live Mitsuba objects, and what materials say of themselves."""
