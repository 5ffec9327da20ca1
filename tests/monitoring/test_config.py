"""Settings check themselves."""

from __future__ import annotations

import pytest

from turnmill_core.monitoring.chatter import ChatterConfig, config_from_operation
from turnmill_core.operation_file import read_operation, shipped_operations


@pytest.mark.parametrize(("setting", "message"), [
    ({"teeth": 0}, "teeth is 0, expected an integer >= 1"),
    ({"window": -1.0}, "window is -1.0 s, expected a finite number > 0"),
    ({"hop": 0.5}, "expected between hop 0.5 s and longest window 2.0 s"),
    ({"nominal_speed": float("nan")}, "nominal speed is nan rad/s"),
    ({"leave_ratio": 0.1}, "leave ratio is 0.1, expected in"),
    ({"gate_ratio": 1.0}, "gate ratio is 1.0, expected a number > 1"),
    ({"band": (100.0, 50.0)}, "band is"),
    ({"enter_dwell": 0}, "enter dwell is 0 windows"),
])
def test_wrong_settings(setting: dict, message: str) -> None:
    with pytest.raises(ValueError, match=r".") as error:
        ChatterConfig(**{"teeth": 4, **setting})
    assert message in str(error.value)


def test_from_every_shipped_operation() -> None:
    for path in shipped_operations().values():
        op = read_operation(path)
        config = config_from_operation(op)
        assert (config.teeth, config.nominal_speed) == (op.tool.teeth, op.conditions.tool_speed)
        assert config.equal_pitch == (not op.tool.pitch_angles)
