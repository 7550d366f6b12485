"""What linking percepts costs: processor time by their number, with and without roads, and memory over hours.

Vehicles drive through towns at constant speed and are seen for 3 s and hidden for 2 s, in `drives`.
"""
