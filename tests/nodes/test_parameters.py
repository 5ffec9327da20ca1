"""Parameters: described, bounded, and those of the core's configuration values."""

from __future__ import annotations

from dataclasses import fields

import pytest

from tests.nodes.ros_tools import Probe
from turnmill_core.monitoring.config import ChatterConfig
from turnmill_ros.nodes.chatter_monitor import SETTINGS, ChatterMonitor
from turnmill_ros.nodes.controller import Controller
from turnmill_ros.nodes.force_predictor import ForcePredictor
from turnmill_ros.nodes.operation_server import OperationServer
from turnmill_ros.nodes.planner import Planner
from turnmill_ros.nodes.player import Player
from turnmill_ros.nodes.process_simulator import ProcessSimulator
from turnmill_ros.nodes.recorder import Recorder
from turnmill_ros.nodes.stability_monitor import StabilityMonitor

pytestmark = pytest.mark.ros
NODES = (ChatterMonitor, Controller, ForcePredictor, OperationServer, Planner, Player, ProcessSimulator,
         Recorder, StabilityMonitor)


@pytest.mark.parametrize("cls", NODES, ids=lambda cls: cls.__name__)
def test_every_parameter_is_described_and_every_number_bounded(probe: Probe, cls: type) -> None:
    node = probe.add(cls)
    for name, parameter in node._parameters.items():
        if name == "use_sim_time" or name.startswith("qos_overrides"):
            continue
        told = node.describe_parameter(name)
        assert len(told.description) > 5, name
        if isinstance(parameter.value, bool | str) or not isinstance(parameter.value, int | float):
            continue
        assert told.floating_point_range or told.integer_range, name


def test_the_monitors_settings_are_parameters_with_the_cores_defaults(probe: Probe) -> None:
    node, default = probe.add(ChatterMonitor), ChatterConfig(teeth=1)
    from_elsewhere = {"teeth", "nominal_speed", "equal_pitch", "expect_axes", "recorded_priors", "noise_floor",
                      "sensors", "runout_share"}
    assert {field.name for field in fields(ChatterConfig)} == SETTINGS.keys() | from_elsewhere
    for name in SETTINGS:
        value = node.get_parameter(name).value
        assert (tuple(value) if name == "band" else value) == getattr(default, name)


def test_settings_reach_the_monitor(probe: Probe) -> None:
    node = probe.add(ChatterMonitor, hop=0.1, band=[100.0, 900.0], noise_floor=0.5, enter_dwell=3, revolutions=12)
    assert node._settings.changes == {"hop": 0.1, "band": (100.0, 900.0), "noise_floor": 0.5, "enter_dwell": 3,
                                      "revolutions": 12.0}


def test_settings_that_do_not_fit_each_other_are_refused(probe: Probe) -> None:
    with pytest.raises(ValueError, match="leave ratio"):
        probe.add(ChatterMonitor, enter_ratio=0.01, leave_ratio=0.02)
