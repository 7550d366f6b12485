"""Planning domains and problems: what there is, what operators do, which plans are wanted.

They are read from text, checked against one another and printed back. Formulas are those of `reasoning`, over features that take terms.
"""
