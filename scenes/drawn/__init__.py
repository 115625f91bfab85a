"""Animated scenes for data sets, drawn from what a plan offers: any number of them.

    choices.py   what there is to draw from
    draw.py      (seed, number, choices) -> scene
    palette.py, places.py, things.py, cameras.py   its parts; lamps and skies are `generated/`'s
"""
