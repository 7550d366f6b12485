"""The saliency map as a part: persons that the platform's cameras and other platforms have found.

Entries are a stream that each platform makes of its own; every platform makes the map of all of them for itself.
`anchoring/saliency/` decides about entries and places.
"""
