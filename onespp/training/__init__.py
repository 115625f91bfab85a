"""Training of networks, in JAX (`pip install 'onespp[train]'`).

    batches.py     clips of a data set as the network reads them; which data sets may be used
    forward.py     the forward pass
    loss.py        what it is trained to
    checkpoint.py  where a training stands, as a file
    train.py       the steps
    log.py         the losses as a file, and those of several trainings side by side
    curve.py       the picture of the loss
"""
