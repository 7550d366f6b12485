"""Commands about objects and the roads on which they are.

`link` reads recorded percepts; `roads` reads files of road networks. What they show is made in the room `anchoring`.
"""
