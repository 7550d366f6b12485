"""Planning with temporal control formulas (thesis chapter 7): domains in text and in Python, and search for plans."""

from dyknow.planning.domains.model import Declarations
from dyknow.planning.domains.printing import print_declarations
from dyknow.planning.domains.texts import parse_domain, parse_expression, parse_problem
from dyknow.planning.search.planner import NoPlan, PlanFound, Strategy, find_plan
from dyknow.planning.search.plans import MissionPlan, PlannedAction

__all__ = [
    "Declarations",
    "MissionPlan",
    "NoPlan",
    "PlanFound",
    "PlannedAction",
    "Strategy",
    "find_plan",
    "parse_domain",
    "parse_expression",
    "parse_problem",
    "print_declarations",
]
