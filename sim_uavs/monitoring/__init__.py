"""The specifications of platforms in the scenarios `traffic` and `logistics` for their cameras, unless they are given
others.

Of traffic they link percepts to cars and recognise how they go through crossings (thesis, 8.7.4); of boxes, to boxes.
"""
