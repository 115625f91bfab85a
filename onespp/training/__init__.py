"""Training of the recurrent autoencoder, in JAX (`pip install 'onespp[train]'`).

    batches.py     clips of a data set as the network reads them; which data sets may be used
    network.py     the forward pass
    loss.py        what it is trained to
    checkpoint.py  where a training stands, as a file
    train.py       the steps
    curve.py       the picture of the loss
"""
