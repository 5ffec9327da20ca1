"""Forces and stability of a cut over tool speed, from Python.

Run: python examples/forces_and_stability.py
"""

import math

from turnmill_core.cutting.loads import cutting_loads
from turnmill_core.machine.conditions import with_cut
from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_core.stability.margin import stability_point

RPM = 2 * math.pi / 60

operation = read_operation(shipped_operations()["thesis_table_4_9"])
lines = [f"{'tool speed':>10} {'peak Fy':>9} {'torque':>9} {'|mu|':>7}  verdict"]
for rpm in (2900, 3100, 3300, 3500):
    cut = with_cut(operation, tool_speed=rpm * RPM, depth=2e-3)
    loads = cutting_loads(operation, cut)
    point = stability_point(operation, cut)
    lines.append(f"{rpm:>6} rpm {loads.force_tool_peak[1]:>7.0f} N {loads.tool_torque_peak:>6.2f} N m"
                   f" {point.spectral_radius:>6.3f}  {point.predicted_type.name}")
print("\n".join(lines))
