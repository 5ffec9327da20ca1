"""The chatter monitor: items in, verdicts out.

    state = initial(config)
    for item in items:                       # SensorBlock, SpindleSpeed, Prior, RecordedPrior
        state, verdicts = update(config, state, item)
    state, verdicts = finish(config, state)

The state is immutable and bounded. Windows end at multiples of the hop in the sample index, are
judged in order, and wait for spindle speeds that cover their end, so that verdicts depend neither on
the block size nor on how blocks and speeds interleave.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from turnmill_core.monitoring import stream as streams
from turnmill_core.monitoring.blocks import SensorBlock
from turnmill_core.monitoring.config import ChatterConfig, config_from_operation
from turnmill_core.monitoring.sensors import calibrate
from turnmill_core.monitoring.speed import Pages, SpindleSpeed, joined, remember
from turnmill_core.monitoring.stream import Stream
from turnmill_core.monitoring.verdict import Reason, Verdict
from turnmill_core.monitoring.window import Tracker, judge_window
from turnmill_core.prediction import Prior

__all__ = ["ChatterConfig", "MonitorState", "RecordedPrior", "SpindleSpeed", "config_from_operation", "finish",
           "initial", "update"]

PENDING_PRIORS = 4096


@dataclass(frozen=True)
class RecordedPrior:
    """Prior that a recorded verdict carried for the window that ends at `last_sample`; None: it had none."""

    stream_id: int
    last_sample: int
    prior: Prior | None


@dataclass(frozen=True)
class MonitorState:
    """What the monitor remembers; made by :func:`initial`."""

    streams: tuple[Stream, ...] = ()
    trackers: tuple[tuple[str, Tracker], ...] = ()
    speeds: Pages = ()
    prior: Prior | None = None
    recorded: tuple[RecordedPrior, ...] = ()


Item = SensorBlock | SpindleSpeed | Prior | RecordedPrior


def initial(config: ChatterConfig) -> MonitorState:
    """State before the first item."""
    return MonitorState()


def update(config: ChatterConfig, state: MonitorState, item: Item) -> tuple[MonitorState, tuple[Verdict, ...]]:
    """State after `item`, and the verdicts on all windows that it completes."""
    if isinstance(item, SensorBlock):
        if config.device and item.device != config.device:
            return state, ()
        state = _add_block(config, state, calibrate(config.sensors, item))
    elif isinstance(item, SpindleSpeed):
        state = replace(state, speeds=remember(state.speeds, item))
    elif isinstance(item, Prior):
        state = replace(state, prior=item)
    else:
        state = replace(state, recorded=(*state.recorded[-PENDING_PRIORS + 1:], item))
    return _judge_ready(config, state, False)


def finish(config: ChatterConfig, state: MonitorState) -> tuple[MonitorState, tuple[Verdict, ...]]:
    """State and verdicts at the end of the recording: windows still waiting for speeds or priors go without."""
    return _judge_ready(config, state, True)


def _add_block(config: ChatterConfig, state: MonitorState, block: SensorBlock) -> MonitorState:
    hop = _samples(config.hop, block.sample_rate)
    held = [s for s in state.streams if s.device == block.device]
    if not held:
        new = streams.append(streams.open_stream(block, hop), block, hop)
        return replace(state, streams=(*state.streams, new))
    last = held[-1]
    why = streams.continues(last, block)
    if why:
        new = streams.append(streams.open_stream(block, hop, Reason.STREAM_RESTART, why), block, hop)
        return replace(state, streams=(*state.streams, new))
    new = streams.append(last, block, hop)
    return replace(state, streams=tuple(new if s is last else s for s in state.streams))


def _samples(seconds: float, rate: float) -> int:
    return max(1, round(seconds * rate))


def _judge_ready(config: ChatterConfig, state: MonitorState, last: bool) -> tuple[MonitorState, tuple[Verdict, ...]]:
    """Judges every window that waits for nothing more; `last`: for nothing at all."""
    if not any(s.next_end <= s.end for s in state.streams):
        return state, ()
    verdicts: list[Verdict] = []
    kept: list[Stream] = []
    trackers = dict(state.trackers)
    recorded = state.recorded
    newest: dict[str, Stream] = {s.device: s for s in state.streams}
    for held in state.streams:
        s = held
        waiting = any(other.device == s.device for other in kept)
        hop, longest = _samples(config.hop, s.sample_rate), _samples(config.longest_window, s.sample_rate)
        while not waiting and s.next_end <= s.end:
            end_sample = s.next_end - 1
            if not last and _waits_for_speed(config, state.speeds, s.stamp(end_sample), newest[s.device]):
                break
            prior = state.prior
            if config.recorded_priors:
                at = next((i for i, r in enumerate(recorded)
                           if (r.stream_id, r.last_sample) == (s.stream_id, end_sample)), None)
                if at is None and not last:
                    break
                prior = None if at is None else recorded[at].prior
                recorded = recorded if at is None else recorded[at + 1:]
            trackers[s.device], verdict = judge_window(config, trackers.get(s.device, Tracker()), s, s.next_end,
                                                       joined(state.speeds), prior)
            verdicts.append(verdict)
            s = streams.advance(s, hop, longest)
        if s.next_end <= s.end or newest[s.device] is held:
            kept.append(s)
    if not verdicts and len(kept) == len(state.streams):
        return state, ()
    return replace(state, streams=tuple(kept), trackers=tuple(trackers.items()), recorded=recorded), tuple(verdicts)


def _waits_for_speed(config: ChatterConfig, speeds: Pages, end_ns: int, newest: Stream) -> bool:
    if not config.expect_axes or (speeds and speeds[-1][-1].stamp_ns >= end_ns):
        return False
    return newest.stamp(newest.end - 1) - end_ns <= round(config.speed_timeout * 1e9)
