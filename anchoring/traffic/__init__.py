"""Traffic on roads as streams: obstacles on lanes, which links and routes a vehicle can pass, and why not.

The units and sources of one road network are made by `units.road_units`. Flow, speed and density are those of
`dyknow.anchoring.roads.statistics`, routes those of `dyknow.anchoring.roads.routes`.
"""
