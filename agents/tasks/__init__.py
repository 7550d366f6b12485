"""Tasks that last: their requesters, the larger tasks they belong to, and the coordinators of those.

`life` holds every change of their state. The requests themselves, and their set-up, are in the drawers of the parts that
carry them out.
"""
