"""The saliency map as a part: what the platform's cameras find, and what other platforms have found.

Entries are a stream that each platform makes of its own; every platform makes the map of all of them for itself.
What is decided about entries and places is in `anchoring/saliency/`.
"""
