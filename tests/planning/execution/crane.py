"""A small domain in which every kind of monitor is generated: cranes that lift boxes and put them down elsewhere."""

from planning import Declarations, MissionPlan, PlanFound, find_plan, parse_domain, parse_problem
from planning.execution.generation import PlanMonitor, plan_monitors

DOMAIN = """
#domain crane
#domain box
#domain mode = {off, on}
#units crane
#feature xpos(box) : fp :within 0.5
#feature height(crane) : fp = 0
#feature holds(crane, box) : boolean
#feature mode(crane) : mode = off
#feature wind : fp
#operator grip(crane, box, x)
  :timeconstraint monitored 0 <= end - start <= 4s
  :precond monitored [start] !holds(crane, box) & xpos(box) == x
  :effects monitored [start] mode(crane) := on, [end - 500] holds(crane, box)
  :monitor eventually [0, 5s] always [0, 1s] holds(crane, box) :recovery again
#operator turn(crane, box)
  :timeconstraint 2s <= end - start <= 2s
  :precond [start] holds(crane, box) & height(crane) < 3
  :prevail monitored [start, end] holds(crane, box)
  :effects monitored [start + 500] height(crane) := 5
  :effects monitored [end] height(crane) := 3
#operator release(crane, box, x)
  :timeconstraint 1s <= end - start <= 1s
  :precond [start] holds(crane, box) & height(crane) == 3 & xpos(box) == x
  :effects monitored [end] !holds(crane, box), [end] xpos(box) := x + 8
#monitor calm: always forall crane: mode(crane) == on -> eventually [0, 2s] wind <= 10
#recovery again(crane, box) :act brake :times 2 give-up
"""
PROBLEM = "#objects crane = {k1} #objects box = {b1} #init xpos(b1) := 2 #goal xpos(b1) == 10 & !holds(k1, b1)"


def domain(disturbed: str = "") -> Declarations:
    return parse_domain(DOMAIN.replace("holds(crane, box) : boolean", f"holds(crane, box) : boolean {disturbed}"))


def planned(found: Declarations, problem: str = PROBLEM) -> tuple[Declarations, MissionPlan]:
    """The domain with the problem, and the plan."""
    asked = parse_problem(problem, found)
    result = find_plan(found, asked)
    assert isinstance(result, PlanFound), result
    return found.joined(asked), result.plan


def monitors(disturbed: str = "") -> tuple[PlanMonitor, ...]:
    return plan_monitors(*planned(domain(disturbed)))
