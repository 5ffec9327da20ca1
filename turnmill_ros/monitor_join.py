"""Feeds the chatter monitor from messages: the same for the node, for replay and for offline analysis.

The monitor joins everything by stamp. What is decided here is only which operation holds for which
block, which predictions the windows use, and for how long they wait for axis states.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from turnmill_core.machine.axes import AXES, AxisState
from turnmill_core.monitoring.blocks import Channel, SensorBlock
from turnmill_core.monitoring.chatter import (
    ChatterConfig,
    MonitorState,
    RecordedPrior,
    SpindleSpeed,
    config_from_operation,
    finish,
    initial,
    update,
)
from turnmill_core.monitoring.verdict import Verdict
from turnmill_core.operation import Operation, require
from turnmill_core.prediction import Prior
from turnmill_ros.block_counts import BlockCounts
from turnmill_ros.operation_track import OperationTrack
from turnmill_ros.predicted import Predictor, explained_by_runout

LONGEST_WAIT_NS = 90_000_000_000
"""Time over which blocks are held at most; beyond it the oldest is judged with what is known.

In a replay at maximum speed one topic may be ahead of another by what the middleware holds: 10 000 axis states, 40 s.
"""

MOST_RECORDED = 20_000
KEPT_AXES_NS = 2_000_000_000
SPINDLE = AXES.index("s")
Judged = tuple[tuple[Verdict, str], ...]
"""Verdicts, each with the hash of the operation that it was made for."""


@dataclass(frozen=True)
class FeedSettings:
    """How the monitor is fed.

    prior: "live", the newest prediction when a window is decided; "recorded", the one that the recorded
    verdict on the same window used; "computed", the prediction for the axis state at the end of the block in
    which the window ends (needs recorded axes); "none".
    axes: "live", windows wait for axis states up to the monitor's timeout; "recorded", blocks wait for those
    that the recording holds, however far apart the topics arrive; "none", there are none.
    changes: settings of the monitor other than those of :func:`config_from_operation`.
    """

    prior: Literal["live", "recorded", "computed", "none"] = "live"
    axes: Literal["live", "recorded", "none"] = "live"
    changes: Mapping[str, object] = field(default_factory=dict)

    def __post_init__(self) -> None:
        require(self.prior in ("live", "recorded", "computed", "none"), "prior", self.prior, "",
                "live, recorded, computed or none")
        require(self.axes in ("live", "recorded", "none"), "axes", self.axes, "", "live, recorded or none")
        require(self.prior != "computed" or self.axes == "recorded", "axes", self.axes, "",
                "recorded, as predictions are computed from them")

    def config(self, operation: Operation) -> ChatterConfig:
        """The monitor's settings for an operation."""
        return replace(config_from_operation(operation), runout_share=explained_by_runout(operation),
                       recorded_priors=self.prior in ("recorded", "computed"), expect_axes=self.axes != "none",
                       **self.changes)  # type: ignore[arg-type]


class MonitorFeed:
    """A chatter monitor with what it still has to be given; each method returns the verdicts that became due.

    An operation holds for the blocks from its stamp on (the first for all): then what waits under the
    old one is judged and the monitor begins anew.
    """

    def __init__(self, settings: FeedSettings) -> None:
        self.settings = settings
        self.operations = OperationTrack()
        self.counts = BlockCounts()
        self.judged = self.dropped = 0
        self._running: Operation | None = None
        self._config: ChatterConfig | None = None
        self._state: MonitorState | None = None
        self._held: deque[SensorBlock] = deque()
        self._coming: deque[AxisState] = deque()
        self._axes: AxisState | None = None
        self._predictor = Predictor()
        self._given: deque[SpindleSpeed] = deque()
        self._newest: dict[str, int] = {"axes": -1, "recorded": -1}
        self._last_prior: Prior | None = None
        self._recorded: dict[tuple[str, int, int], Prior | None] = {}

    def operation(self, stamp_ns: int, operation: Operation) -> Judged:
        """An operation that holds from `stamp_ns` on."""
        self.operations.add(stamp_ns, operation)
        return self._pump()

    def block(self, block: SensorBlock) -> Judged:
        """A block of samples, in the order of its stream."""
        self.counts.add(block)
        self._held.append(block)
        if self.operations.first is None and self._waited() > LONGEST_WAIT_NS:
            self._held.popleft()
            self.dropped += 1
        return self._pump()

    def axes(self, axes: AxisState) -> Judged:
        """An axis state."""
        self._newest["axes"] = max(self._newest["axes"], axes.stamp_ns)
        self._coming.append(axes)
        if self.settings.axes == "live":
            return self._give_axes(axes.stamp_ns) + self._pump()
        return self._pump()

    def prior(self, prior: Prior) -> Judged:
        """A prediction, used live from now on."""
        if self.settings.prior != "live":
            return ()
        self._last_prior = prior
        return self._give(prior)

    def recorded(self, verdict: Verdict) -> Judged:
        """A recorded verdict, whose prior is that of the same window."""
        if self.settings.prior != "recorded":
            return ()
        self._newest["recorded"] = max(self._newest["recorded"], verdict.window_end_ns)
        self._recorded[verdict.device, verdict.stream_id, verdict.last_sample] = verdict.prior
        if len(self._recorded) > MOST_RECORDED:  # verdicts of a device that is not judged here
            del self._recorded[next(iter(self._recorded))]
        return self._pump()

    def finish(self) -> Judged:
        """The end of the stream: judge what waits with what is known."""
        return self._pump(ending=True) + self._end()

    def fresh(self) -> MonitorFeed:
        """A feed with the same settings and operations, and nothing received yet."""
        new = MonitorFeed(self.settings)
        new.operations = self.operations
        return new

    def warm(self, operation: Operation) -> None:
        """Compile everything that a verdict on `operation` needs, on a cut with chatter."""
        trial = MonitorFeed(FeedSettings(prior="none", axes="none"))
        trial.operation(0, operation)
        time = np.arange(7680) / 12800.0
        tooth = operation.tool.teeth * operation.conditions.tool_speed * time
        cut = sum(np.cos(n * tooth) / n for n in range(1, 8))
        chatter = np.cos(2 * np.pi * 871.3 * time) * (1 + 0.4 * np.cos(tooth))
        noise = 0.1 * np.random.default_rng(0).standard_normal(len(time))
        samples = (cut + chatter + noise).astype(np.float32).reshape(30, 256, 1)
        channel = Channel("warm", "sound_pressure", "Pa")
        for k, part in enumerate(samples):
            trial.block(SensorBlock(k * 20_000_000, "warm", 1, k * 256, 12800.0, (channel,), part))
        trial.finish()

    def _pump(self, ending: bool = False) -> Judged:
        judged: list[tuple[Verdict, str]] = []
        while self._held:
            block = self._held[0]
            operation = self.operations.at(block.stamp_ns)
            patient = not ending and self._waited() <= LONGEST_WAIT_NS
            if operation is None or (patient and not self._ready(block, operation)):
                break
            if operation is not self._running:
                judged += self._end()
                judged += self._begin(operation)
            if self.settings.axes == "recorded":
                judged += self._give_axes(end_ns(block))
            self._held.popleft()
            self.judged += 1
            judged += self._give(block)
            judged += self._give_recorded()
        return tuple(judged)

    def _waited(self) -> int:
        return self._held[-1].stamp_ns - self._held[0].stamp_ns

    def _ready(self, block: SensorBlock, operation: Operation) -> bool:
        """Whether everything that the windows ending in `block` wait for has arrived.

        Before an operation takes over, also what the last windows under the old one wait for.
        """
        changing = self._running is not None and operation is not self._running
        until = max(block.stamp_ns if changing else -1, end_ns(block) if self.settings.axes == "recorded" else -1)
        late = self.settings.axes == "live" and self._config is not None and (
            self._held[-1].stamp_ns - block.stamp_ns > self._config.speed_timeout * 1e9)
        axes = self.settings.axes == "none" or late or self._newest["axes"] >= until
        return axes and (self.settings.prior != "recorded" or self._newest["recorded"] >= end_ns(block))

    def _begin(self, operation: Operation) -> Judged:
        self._running, self._config = operation, self.settings.config(operation)
        self._state = initial(self._config)
        known: list[object] = [*self._given]
        if self._last_prior is not None:
            known.append(self._last_prior)
        return tuple(pair for item in known for pair in self._give(item))

    def _end(self) -> Judged:
        if self._state is None or self._config is None or self._running is None:
            return ()
        _, verdicts = finish(self._config, self._state)
        operation, self._running, self._state = self._running, None, None
        return tuple((verdict, operation.sha256) for verdict in verdicts)

    def _give(self, item: object) -> Judged:
        if self._state is None or self._config is None or self._running is None:
            return ()
        self._state, verdicts = update(self._config, self._state, item)  # type: ignore[arg-type]
        return tuple((verdict, self._running.sha256) for verdict in verdicts)

    def _give_axes(self, until_ns: int) -> Judged:
        """Give axis states up to the first one that covers `until_ns`."""
        judged: list[tuple[Verdict, str]] = []
        while self._coming and (not self._given or self._given[-1].stamp_ns < until_ns):
            self._axes = self._coming.popleft()
            self._given.append(SpindleSpeed(self._axes.stamp_ns, self._axes.velocity[SPINDLE],
                                            self._axes.position[SPINDLE]))
            judged += self._give(self._given[-1])
        while self._given and self._given[-1].stamp_ns - self._given[0].stamp_ns > KEPT_AXES_NS:
            self._given.popleft()
        return tuple(judged)

    def _give_recorded(self) -> Judged:
        """Give each window that is due its prior: computed, or of its recorded verdict (none where it has none)."""
        judged: list[tuple[Verdict, str]] = []
        computed = None
        if self.settings.prior == "computed" and self._running is not None and self._axes is not None:
            computed = self._predictor.prior(self._running, self._axes)
        while self.settings.prior in ("recorded", "computed") and self._state is not None:
            streams = self._state.streams
            due = next(((s.device, s.stream_id, s.next_end - 1) for s in streams if s.next_end <= s.end), None)
            if due is None:
                break
            new = self._give(RecordedPrior(due[1], due[2], self._recorded.pop(due, computed)))
            if not new:
                break
            judged += new
        return tuple(judged)


def end_ns(block: SensorBlock) -> int:
    """Acquisition time of the sample after the block's last one [ns]."""
    return block.stamp_ns + round(len(block.samples) * 1e9 / block.sample_rate)
