"""What platforms of the scenarios `traffic` and `logistics` derive from their cameras unless they are given another specification.

Of traffic they link percepts to cars and recognise how they go through crossings (thesis, 8.7.4); of boxes, to boxes.
"""
