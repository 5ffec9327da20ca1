"""Judges the sensor signal: air, stable, chatter."""

from __future__ import annotations

from typing import Any

from rclpy.lifecycle import LifecycleNode, LifecycleState

from turnmill_core.machine.conditions import nominal_axes
from turnmill_core.monitoring.config import ChatterConfig
from turnmill_core.monitoring.verdict import Verdict
from turnmill_ros import topics
from turnmill_ros.conversions import (
    axes_from_message,
    block_from_message,
    prior_from_margin,
    scalar_to_message,
    verdict_from_message,
    verdict_to_message,
)
from turnmill_ros.interfaces import ros_types
from turnmill_ros.monitor_join import FeedSettings, MonitorFeed
from turnmill_ros.node_table import VERDICT_PLOTS
from turnmill_ros.nodes import _support as support
from turnmill_ros.parameters import Setting, declare, declare_config
from turnmill_ros.predicted import Predictor

SETTINGS = {
    "band": Setting("Hz, lower and upper end of the band in which lines are judged"),
    "window": Setting("s, shortest length of a window", 0.02, 10.0),
    "revolutions": Setting("tool revolutions, fewest in a window", 1.0, 100.0),
    "longest_window": Setting("s, longest length of a window", 0.02, 60.0),
    "hop": Setting("s, from one window to the next", 0.005, 1.0),
    "device": Setting("device to judge; empty: each one"),
    "channel": Setting("channel to judge; empty: the first usable"),
    "fallback": Setting("judge the next usable channel where the chosen one is dead or saturated"),
    "speed_timeout": Setting("s of stamps, that a window waits for axis states; a longer gap is no axis state",
                             0.02, 60.0),
    "axis_band": Setting("1, half width of the refinement of the speed around what was found", 1e-4, 0.1),
    "nominal_band": Setting("1, half width of the search for the speed around the axis states' or the nominal one",
                            1e-4, 0.1),
    "gate_ratio": Setting("1, level over noise floor that shows a cut", 1.0, 100.0),
    "enter_ratio": Setting("1, asynchronous over total energy at which chatter begins", 1e-4, 1.0),
    "leave_ratio": Setting("1, asynchronous over total energy at which chatter ends", 1e-4, 1.0),
    "enter_dwell": Setting("windows in a row before chatter begins in a cut", 1, 100),
    "lone_dwell": Setting("windows in a row before chatter begins where only the chatter shows a cut", 1, 100),
    "leave_dwell": Setting("windows in a row before chatter ends", 1, 100),
    "marginal_dwell": Setting("windows in a row before the cut is called marginal", 1, 100),
    "cut_dwell": Setting("windows in a row before the state changes between air and cut", 1, 100),
}
"""The monitor's settings that are parameters; its others come from the operation and from `prior` and `axes`."""


class ChatterMonitor(LifecycleNode):
    """Publishes a verdict for every window, stamped with the acquisition time of its last sample.

    Messages are joined by their stamps in :class:`turnmill_ros.monitor_join.MonitorFeed`, which offline analysis
    uses as well.
    """

    gather_s = 0.002  # a verdict is due within milliseconds of the block that completes its window

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("chatter_monitor", **kwargs)
        changes = declare_config(self, ChatterConfig(teeth=1), SETTINGS)
        floor = declare(self, "noise_floor", 0.0, "rms of the signal out of the cut, its unit; 0: learned", low=0.0)
        if floor > 0:
            changes["noise_floor"] = floor
        self._settings = FeedSettings(
            prior=declare(self, "prior", "live", "predictions: live, recorded (of verdicts), computed, none"),
            axes=declare(self, "axes", "live", "axis states: live (wait up to speed_timeout), recorded (wait) or none"),
            changes=changes)
        self._match, lossless = support.declare_common(self)
        self._feed = MonitorFeed(self._settings)
        self._sent, self._lag = 0, 0.0
        self._lags: list[float] = []
        self._out = {t: support.publisher(self, t, keep_all=lossless) for t in (
            topics.CHATTER_STATE, *VERDICT_PLOTS)}
        self.diagnostics = support.Diagnostics(self, self._values, self._warning, paced=lossless)
        support.subscription(self, topics.OPERATION, self.on_operation)
        support.subscription(self, topics.JOINT_STATES, self.on_axes)
        support.subscription(self, topics.SENSOR_BLOCKS, self.on_block)
        if self._settings.prior == "live":
            support.subscription(self, topics.STABILITY_MARGIN, self.on_margin)
        elif self._settings.prior == "recorded":
            support.subscription(self, topics.CHATTER_STATE, self.on_recorded,
                                 name=topics.recorded_name(topics.CHATTER_STATE.name))

    def on_operation(self, message: Any) -> None:
        """Judge another operation from its stamp on."""
        self._publish(support.accept_operation(self._feed.operation, message) or ())

    @support.transition
    def on_configure(self, state: LifecycleState) -> None:
        """Compile the monitor's numerics for the operation that is published."""
        operation = support.wait_for_operation(self, self._feed.operations)
        self._feed.warm(operation)
        if self._settings.prior == "computed":
            Predictor().prior(operation, nominal_axes(operation))

    @support.transition
    def on_activate(self, state: LifecycleState) -> None:
        """Wait for blocks."""
        self._feed = self._feed.fresh()
        support.wait_until_matched(self, self._match)
        self.diagnostics.enter(support.ACTIVE)

    @support.transition
    def on_deactivate(self, state: LifecycleState) -> None:
        """Judge all that has arrived, also the windows that still wait, then stop."""
        support.drain(self)
        self._publish(self._feed.finish())
        support.wait_until_acknowledged(self)
        self.diagnostics.enter("stopped", done=True)

    def on_axes(self, message: Any) -> None:
        """Take the spindle speed of an axis state."""
        self._publish(self._feed.axes(axes_from_message(message)))

    def on_block(self, message: Any) -> None:
        """Take a block of samples."""
        self._publish(self._feed.block(block_from_message(message)))

    def on_margin(self, message: Any) -> None:
        """Take a prediction."""
        self._publish(self._feed.prior(prior_from_margin(message)))

    def on_recorded(self, message: Any) -> None:
        """Take the prediction that a recorded verdict used."""
        self._publish(self._feed.recorded(verdict_from_message(message)))

    def _publish(self, verdicts: tuple[tuple[Verdict, str], ...]) -> None:
        types = ros_types()
        for verdict, operation_hash in verdicts:
            support.send(self._out[topics.CHATTER_STATE], verdict_to_message(verdict, operation_hash, types))
            self._lags.append((self.get_clock().now().nanoseconds - verdict.window_end_ns) * 1e-9)
            for topic in VERDICT_PLOTS:
                value = getattr(verdict, topic.name.removeprefix("plot/"))
                support.send(self._out[topic], scalar_to_message(value, types))
            self._sent += 1

    def _warning(self) -> str | None:
        return self._feed.counts.trouble()

    def _values(self) -> dict[str, object]:
        if self._lags:
            self._lag, self._lags = max(self._lags), []
        counts = {f"received_{name}": count for name, count in self._feed.counts.values().items()}
        return {**counts, "blocks_judged": self._feed.judged, "blocks_dropped": self._feed.dropped,
                "verdicts_sent": self._sent, "lag_s": f"{self._lag:.3f}"}


if __name__ == "__main__":
    support.main(ChatterMonitor)
