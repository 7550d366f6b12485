"""Texts of road networks: GeoJSON, OpenStreetMap and SUMO, read into `RoadNetwork`.

Each reader takes the text and names the feature that is wrong, the cause and the remedy. No file is opened here.
"""
