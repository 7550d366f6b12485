"""Chronicles before anything happens: the model, its times and conditions, compiled to a temporal network (thesis 8.3, 8.4).

Inconsistent times are an error that names them. A chronicle that compiles can be recognised.
"""
