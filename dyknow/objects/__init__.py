"""Objects in streams: which are there, and the streams about each (thesis 8.5.1).

A stream whose records begin with a symbol is a stream of object states. Its objects are a domain, `cars.objects`, whose
members appear and vanish; of each the state, and every attribute, is a stream while it is wanted.
"""
