"""From what instance each observation comes: probabilities of all associations.

`single` is for one observation at a time, `scans` for several that exclude each other, `pairs` for the likelihoods of both.
Functions of arrays; what follows for beliefs is decided in the drawer above.
"""
