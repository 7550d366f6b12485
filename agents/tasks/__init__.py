"""Tasks that last: what was asked for, by whom, on behalf of which larger task, and who coordinates that.

`life` holds every change of their state. Which requests there are, and what they set up, is in the drawers of the parts
that carry them out.
"""
