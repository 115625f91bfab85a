"""Clips of data sets to train on, in NumPy and OpenEXR alone.

    clips.py    `onespp.Clips`: a clip by its index
    store.py    frames of a data set, decoded or from memory maps
    view.py     crops and turns: what happens to images, and to matrices
    motion.py   motion in pixels, from matrices
"""
