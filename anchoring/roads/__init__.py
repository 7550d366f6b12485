"""Road networks: crossings, links with lanes, areas, and an index that finds what is near a position.

Positions are snapped to links and crossings with hysteresis; turns, routes, traffic figures and relations follow.
Unseen objects are predicted along the roads, as weighted hypotheses of their route.
"""
