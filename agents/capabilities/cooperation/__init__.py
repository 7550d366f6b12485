"""One picture from several platforms: their tracks are imported, and named as everywhere.

A platform takes part that exports `object-tracks`. The picture is asked for by an act, and is a stream of object states.
"""
