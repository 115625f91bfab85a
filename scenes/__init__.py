"""What is in a scene and how it moves, as pure functions of the frame number.

Plain Python and NumPy: no rendering, no files, no Mitsuba import.
"""
