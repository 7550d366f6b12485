"""Problems of the logistics domain, made from a seed: `python boxes.py --boxes 10 --uavs 2 > ten.prob`.

Boxes lie in a depot at the origin, with the carriers next to it. Their goals are around sites a kilometre away, each with
positions where carriers may be put down; one box in four goes to a place near the depot.
"""

import argparse
import math
import random


def problem(boxes: int, seed: int = 1, uavs: int = 1, carriers: int = 1, sites: int = 2) -> str:
    """The text of a problem."""
    rng = random.Random(seed)
    lines = [
        f"#objects uav = uav1 .. uav{uavs}",
        f"#objects box = b1 .. b{boxes}",
        f"#objects carrier = c1 .. c{carriers}",
        f"#objects carrier-position = p1 .. p{(sites + 1) * carriers}",
    ]
    turn = rng.uniform(0, math.tau)
    centres = [
        (
            round(1000 * math.cos(turn + at * math.tau / sites), 2),
            round(1000 * math.sin(turn + at * math.tau / sites), 2),
        )
        for at in range(sites)
    ]
    places = [(round(x + 8 * at, 2), y) for x, y in [(0.0, 40.0), *centres] for at in range(carriers)]
    lines += [f"#init position-x(p{at}) := {x}, position-y(p{at}) := {y}" for at, (x, y) in enumerate(places, 1)]
    lines += [f"#init xpos(uav{at + 1}) := {-20.0 - 5 * at}, ypos(uav{at + 1}) := -10.0" for at in range(uavs)]
    lines += [f"#init xpos(c{at + 1}) := {8.0 * at}, ypos(c{at + 1}) := 40.0" for at in range(carriers)]
    for at in range(boxes):
        x, y = at % 6 * 4.0, at // 6 * -4.0
        centre = (0.0, -150.0) if at % 4 == 3 else centres[at % sites]
        angle, distance = rng.uniform(0, math.tau), rng.uniform(20, 120)
        goal = (round(centre[0] + distance * math.cos(angle), 2), round(centre[1] + distance * math.sin(angle), 2))
        lines.append(f"#init xpos(b{at + 1}) := {x}, ypos(b{at + 1}) := {y}")
        lines.append(f"#init goal-x(b{at + 1}) := {goal[0]}, goal-y(b{at + 1}) := {goal[1]}")
    lines.append("#goal deliver: forall box: delivered(box)")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    for name, value in (("boxes", 4), ("seed", 1), ("uavs", 1), ("carriers", 1), ("sites", 2)):
        parser.add_argument(f"--{name}", type=int, default=value)
    print(problem(**vars(parser.parse_args())), end="")
