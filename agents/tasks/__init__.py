"""Tasks that last: their requesters, the larger tasks they belong to, and the coordinators of those.

`life` holds every change of their state. Which requests there are, and what they set up, is in the drawers of the parts
that carry them out.
"""
