"""How strong half-order lines are from the runout of the teeth alone: what a known runout explains.

With an even number of teeth, half the tooth passing frequency is a multiple of the spindle's, and runout puts lines
where period-two chatter has them. The runout that an operation states tells how strong they are without chatter:
teeth that stand out cut more, and by the same amount in every revolution.
"""

from __future__ import annotations

import math

import numpy as np

from turnmill_core.cutting.loads import cutting_loads
from turnmill_core.operation import Conditions, Operation

ANGLES = 720
HARMONICS = ANGLES // 4
"""Spindle harmonics that the angles tell well."""
HIGHEST = 5000.0


def half_order_share(op: Operation, conditions: Conditions, highest: float = HIGHEST) -> float:
    """Share [1] of half-order lines in the energy of the cutting force that the runout stated in `op` gives, 0 to 1.

    Energy at odd multiples of half the tooth passing frequency over that at all multiples of the spindle's, up to
    `highest` [Hz], of the rigid cut's force (Eq. 3.44-3.50) with the teeth's own radii: along x_T or y_T, whichever
    has more. NaN where nothing is known: no runout stated, or zero for all teeth (none was measured); where the
    number of teeth is odd or their pitch differs, so that period two has lines of its own; where nothing is cut.

    Raises:
        ValueError: the depth exceeds the flute length.
    """
    tool = op.tool
    if not any(tool.runout) or tool.teeth % 2 or np.ptp(tool.pitch) > 1e-6:
        return math.nan
    loads = cutting_loads(op, conditions, ANGLES)
    if not loads.in_cut:
        return math.nan
    count = min(HARMONICS, int(highest / loads.tooth_passing_frequency * tool.teeth))
    power = np.abs(np.fft.rfft(loads.force_tool[:, :2], axis=0)[: count + 1]) ** 2
    half, total = power[tool.teeth // 2:: tool.teeth].sum(axis=0), power[1:].sum(axis=0)
    return float(np.max(np.divide(half, total, out=np.zeros(2), where=total > 0)))
