"""The instance of origin of each observation: probabilities of all associations.

`single` is for one observation at a time, `scans` for several that exclude each other, `pairs` for the likelihoods of
both. Functions of arrays; the drawer above updates the beliefs.
"""
