"""A small domain: a UAV flies between places and looks at them."""

TRUCKS = """
#domain uav
#domain place
#units uav
#feature at(uav) : place
#feature road(place, place) : boolean
#feature length(place, place) : fp = 1
#feature seen(place) : boolean
#feature open(place) : boolean = true
#feature airborne(uav) : boolean
#operator start(uav)
  :cost 1
  :duration 2s
  :precond [start] !airborne(uav)
  :effects [end] airborne(uav)
#operator fly(uav, place, place2)
  :cost length(place, place2)
  :duration length(place, place2) * UNITS_PER_SECOND
  :precond [start] airborne(uav) & at(uav) == place & road(place, place2)
  :prevail [start, end] open(place2)
  :effects [end] at(uav) := place2
#operator look(uav, place)
  :cost 1
  :duration 1s
  :precond [start] airborne(uav) & at(uav) == place
  :effects [end] seen(place)
"""
MAP = """
#objects uav = {u1}
#objects place = {a, b, c, d}
#init at(u1) := a, road(a, b), road(b, c), road(a, c), road(c, d), road(b, a), road(d, a)
#init length(a, c) := 5, length(c, d) := 2
"""
