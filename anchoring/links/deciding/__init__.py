"""What link processes decide by: conditions over two objects, what is near, what is wanted.

A condition is a formula with what its labels stand for; a gate says from which distance on it need not be evaluated.
Descriptions of wanted objects are conditions, too.
"""
