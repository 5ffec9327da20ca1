"""The simulated recordings that the demo and the tests use: what is cut, how it is measured, and the seed."""

from __future__ import annotations

from dataclasses import dataclass

from turnmill_core.process.config import SimulationConfig

START_NS = 1_700_000_000_000_000_000
"""Stamp of the first sample in all of them (an arbitrary moment, so that the files never change)."""


@dataclass(frozen=True)
class Scenario:
    """One recording: operation file (shipped in turnmill_core/operations), configuration, seed, duration [s].

    what: one sentence for people.
    """

    operation: str
    config: SimulationConfig
    seed: int
    duration: float
    what: str


def _config(second: str) -> SimulationConfig:
    return SimulationConfig(sample_rate=12800, channels=("sound", second), start_ns=START_NS)


SCENARIOS: dict[str, Scenario] = {
    "demo": Scenario("demo_turn_milling.yaml", _config("tool_x"), 20180, 13.0,
                     "Turn-milling: air, stable cut, drift into Hopf chatter, rescue by another tool speed."),
    "flip_3_teeth": Scenario("demo_flip_3_teeth.yaml", _config("workpiece_y"), 3, 5.0,
                             "Milling with 3 teeth: air, stable cut, flip chatter with its own half-order lines."),
    "flip_2_teeth": Scenario("demo_flip_2_teeth.yaml", _config("workpiece_y"), 2, 5.0,
                             "Milling with 2 teeth: air, stable cut, flip chatter on the spindle's harmonics."),
    "runout_2_teeth": Scenario("demo_runout_2_teeth.yaml", _config("workpiece_y"), 22, 4.0,
                               "Milling with 2 teeth: air, then a stable cut whose runout looks like flip chatter."),
    "air": Scenario("demo_air.yaml", _config("tool_x"), 1, 3.0, "The tool turns above the bar and cuts nothing."),
}
