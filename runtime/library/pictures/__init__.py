"""Pictures that platforms have together, as programs read them.

The saliency map is requested from all platforms, and the rows of all of them are one list.
A row can be printed as GeoJSON (RFC 7946).
"""
