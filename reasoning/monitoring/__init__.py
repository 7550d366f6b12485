"""From verdicts to alarms: monitors, what their inputs lack, margins, profiles, recorded traces (thesis 7.6, 9.4.2).

An alarm opens and closes by rules that do not flicker. Stale or missing inputs make a verdict unknown.
"""
