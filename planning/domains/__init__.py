"""Planning domains and problems: objects, features, operators, goals and control formulas.

They are read from text, checked against one another and printed back. Formulas are those of `reasoning`, over features that take terms.
"""
