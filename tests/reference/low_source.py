"""The source of a mission that flies low under the bridge; the inspection needs a supervisor's approval."""

INSPECTION = "inspect_area(bridge_a, altitude = 9 m, pattern = perimeter)"


def low_source(work: str = INSPECTION) -> str:
    """The mission with this `work` at the bridge."""
    return f"""import "lib:policies/bridge_inspection.rts"

mission low under bridge_inspection@7 on quad {{
  intent "Low under the bridge, when a supervisor agrees."
  proposed by agent openclaw for role operator
  phase departure {{ takeoff(altitude = 9 m) }}
  phase inspection {{
    goto(bridge_a.entry, altitude = 9 m)
    {work}
  }}
  phase recovery {{ return_home() }}
}}
"""
