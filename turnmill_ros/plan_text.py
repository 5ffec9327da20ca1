"""A plan in words: limits with the units that people know, reasons, and the chosen cut as an operation file."""

from __future__ import annotations

import math
from collections.abc import Sequence

import yaml

from turnmill_core.operation import Operation
from turnmill_core.operation_file import parse_operation
from turnmill_core.process.limits import LimitMargin
from turnmill_core.process.plan import Choice
from turnmill_core.process.region import Conflict
from turnmill_core.process.robust import Observation
from turnmill_core.process.suggestion import Suggestion

RPM = 60 / (2 * math.pi)


def shown(value: float, unit: str, name: str = "") -> str:
    """A limit's value with the unit that people know; `unit` is its SI unit, `name` the limit's."""
    scale, text = {"m": (1e3, "mm"), "m/s": (60.0, "m/min"), "rad/s": (RPM, "rpm")}.get(unit, (1.0, unit))
    if name.startswith("form error"):
        scale, text = 1e6, "um"
    return f"{value * scale:.5g} {text}"


def margin_text(limit: LimitMargin) -> str:
    """One limit of one cut: "chip load, largest: 0.38 mm of 0.4 mm, 5 % left"."""
    value, bound = (shown(float(v), limit.unit, limit.name) for v in (limit.value, limit.bound))
    if math.isinf(float(limit.bound)):
        return f"{limit.name}: no limit down to the depth searched"
    word = "at least" if limit.lower else "of"
    return f"{limit.name}: {value} {word} {bound}, {float(limit.margin) * 100:.2g} % left"


def conflict_text(found: Conflict) -> str:
    """Which limits conflict, and by how much."""
    first = found.limits[0]
    if math.isfinite(found.asks):
        gap = found.asks / found.allows - 1
        return (f"{first} asks for a tool speed of at least {found.asks * RPM:.0f} rpm, {found.limits[1]} allows "
                f"at most {found.allows * RPM:.0f} rpm: {gap * 100:.3g} % apart")
    parts = [f"{name} {shown(value, unit, name)} (allowed: {shown(bound, unit, name)}, {-margin * 100:.3g} % beyond)"
             for name, margin, value, bound, unit in zip(
                 found.limits, found.margins, found.values, found.bounds, found.units, strict=True) if margin < 0]
    where = f"at best, {found.tool_speed * RPM:.0f} rpm and {found.depth * 1e3:.3g} mm: "
    joint = "" if len(found.limits) == 1 else f"{' and '.join(found.limits)} are not met together; "
    return joint + where + ", ".join(parts)


def cut_text(tool_speed: float, workpiece_speed: float, depth: float) -> str:
    """A cut in short; speeds [rad/s], depth [m]."""
    turning = f", workpiece {abs(workpiece_speed) * RPM:.4g} rpm" if workpiece_speed else ""
    return f"tool {tool_speed * RPM:.0f} rpm{turning}, {depth * 1e3:.4g} mm"


def observation_text(seen: Observation) -> str:
    """One observation: "measured: chatter at 775.4 Hz (tool 3025 rpm, workpiece 6 rpm, 4 mm)"."""
    heard = f" at {seen.frequency:.1f} Hz" if math.isfinite(seen.frequency) else ""
    cut = cut_text(seen.tool_speed, seen.workpiece_speed, seen.depth)
    return f"measured: {'chatter' + heard if seen.chatter else 'no chatter'} ({cut})"


def suggestion_reasons(found: Suggestion, observations: Sequence[Observation]) -> list[str]:
    """Why a suggestion is what it is: what was measured, what the model makes of it, what binds."""
    reasons, draws = [observation_text(seen) for seen in observations], found.draws
    if observations and not draws.operations:
        reasons.append(f"no model within {draws.widened:g} times the usual uncertainty shows what was measured "
                       f"({draws.drawn} drawn): measure the modes anew")
    elif observations:
        reasons.append(f"{len(draws.operations)} of {draws.drawn} models drawn show what was measured"
                       + (f", with {draws.widened:g} times the usual uncertainty" if draws.widened > 1 else ""))
    if found.choice is None:
        reasons += [conflict_text(c) for c in found.conflicts[:3]]
        if found.made.best is not None and draws.operations:
            reasons.append("no cut stays feasible in enough of these models")
        return reasons
    change = found.choice.rate / found.present_rate - 1 if found.present_rate else math.nan
    if math.isfinite(change):
        reasons.append(
            f"removal rate {found.choice.rate * 6e10:.0f} mm3/min, {change * 100:+.0f} % beside the present cut")
    reasons += [margin_text(m) for m in sorted(found.choice.margins, key=lambda m: float(m.margin))[:3]]
    return reasons


def planned_text(op: Operation, choice: Choice, note: str) -> str:
    """The operation file of `op` with the chosen cut as its nominal one and `note` added to its sources.

    The schedule, which belongs to the old cut, is left out. Raises OperationError where the text does not read back.
    """
    document = yaml.safe_load(op.text)
    cut, section = choice.conditions, document["cut"]
    section["tool_speed"] = f"{cut.tool_speed * RPM:.9g} rpm"
    section["depth"] = f"{cut.depth * 1e3:.9g} mm"
    if op.process == "turn-milling":
        section["workpiece_speed"] = f"{cut.workpiece_speed * RPM:.9g} rpm"
        section["axial_feed"] = f"{choice.op.axial_feed * 1e3:.9g} mm/rev"
    else:
        section["feed_per_tooth"] = f"{choice.op.feed_per_tooth * 1e3:.9g} mm"
    document.pop("schedule", None)
    document["name"] = f"{op.name[:190]} (planned)" if not op.name.endswith("(planned)") else op.name
    document["sources"] = "\n".join(part for part in (str(document.get("sources", "")).strip(), note) if part)
    text = yaml.safe_dump(document, sort_keys=False, allow_unicode=True)
    parse_operation(text, "the planned operation")
    return text
