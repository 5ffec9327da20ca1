"""Values of the core to ROS messages and back.

Every ``*_to_message`` takes `types`, a mapping of message names ("package/msg/Name") to classes: those
of ROS (:func:`turnmill_ros.interfaces.ros_types`) or those of rosbags
(:func:`turnmill_ros.interfaces.rosbags_types`). Every ``*_from_message`` takes a message of either kind.
Times are integers in ns; a message that makes no sense raises ``ValueError``, which names the field.
"""

from __future__ import annotations

import math
from array import array
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from turnmill_core.machine.axes import AXES, AxisState
from turnmill_core.monitoring.blocks import Channel, SensorBlock, Status
from turnmill_core.monitoring.verdict import ChatterKind, Reason, SpeedSource, Verdict
from turnmill_core.operation import Operation, require
from turnmill_core.prediction import PredictedType, Prior, flip_multiplier
from turnmill_ros.interfaces import Types

_TYPECODES = {np.dtype(np.float32): "f", np.dtype(np.float64): "d", np.dtype(np.uint8): "B"}


def _make(types: Types, name: str, /, **fields: Any) -> Any:
    """Message of type `name`; numpy arrays become what the class wants.

    A generated ROS class copies an array element by element, except an ``array.array`` set as an
    attribute; that is 700 times faster for a block of 2560 samples.
    """
    cls = types[name]
    if not hasattr(cls, "get_fields_and_field_types"):
        return cls(**fields)
    message = cls()
    for key, value in fields.items():
        if isinstance(value, np.ndarray):
            packed = array(_TYPECODES[value.dtype])
            packed.frombytes(np.ascontiguousarray(value).data.cast("B"))
            setattr(message, key, packed)
        else:
            setattr(message, key, value)
    return message


def _doubles(values: ArrayLike) -> NDArray[np.float64]:
    return np.asarray(values, dtype=np.float64).reshape(-1)


def time_to_message(stamp_ns: int, types: Types) -> Any:
    """builtin_interfaces/Time of a time in ns since the epoch (of the machine's or the simulated clock)."""
    sec, nanosec = divmod(int(stamp_ns), 1_000_000_000)
    require(-(2**31) <= sec < 2**31, "time", stamp_ns, "ns", "seconds that fit into 32 bits")
    return _make(types, "builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)


def time_from_message(message: Any) -> int:
    """Time in ns of a builtin_interfaces/Time."""
    return int(message.sec) * 1_000_000_000 + int(message.nanosec)


def header_to_message(stamp_ns: int, types: Types, frame_id: str = "") -> Any:
    """std_msgs/Header."""
    return _make(types, "std_msgs/msg/Header", stamp=time_to_message(stamp_ns, types), frame_id=frame_id)


def scalar_to_message(value: float, types: Types) -> Any:
    """std_msgs/Float64 of a value for the plot topics, in the unit that the topic table gives."""
    return _make(types, "std_msgs/msg/Float64", data=float(value))


def suggestion_to_message(fields: dict[str, Any], stamp_ns: int, types: Types) -> Any:
    """turnmill_msgs/PlanSuggestion of its fields without the header (:func:`turnmill_ros.replan.answer`)."""
    return _make(types, "turnmill_msgs/msg/PlanSuggestion", header=header_to_message(stamp_ns, types),
                 **{**fields, "margins": _doubles(fields["margins"])})


def clock_to_message(stamp_ns: int, types: Types) -> Any:
    """rosgraph_msgs/Clock."""
    return _make(types, "rosgraph_msgs/msg/Clock", clock=time_to_message(stamp_ns, types))


def _vector_to_message(vector: ArrayLike, types: Types) -> Any:
    x, y, z = _doubles(vector)
    return _make(types, "geometry_msgs/msg/Vector3", x=float(x), y=float(y), z=float(z))


def vector_from_message(message: Any) -> NDArray[np.float64]:
    """Array (3,) of a geometry_msgs/Vector3."""
    return np.array([message.x, message.y, message.z])


def block_to_message(block: SensorBlock, types: Types) -> Any:
    """turnmill_msgs/SensorBlock of a block."""
    channels = [
        _make(types, "turnmill_msgs/msg/SensorChannel", name=c.name, quantity=c.quantity, unit=c.unit,
              location=c.location, status=int(c.status))
        for c in block.channels
    ]
    return _make(
        types, "turnmill_msgs/msg/SensorBlock", header=header_to_message(block.stamp_ns, types), device=block.device,
        stream_id=block.stream_id, first_sample=block.first_sample, sample_rate=float(block.sample_rate),
        channels=channels, samples=np.ascontiguousarray(block.samples, dtype=np.float32).reshape(-1))


def block_from_message(message: Any) -> SensorBlock:
    """Block of a turnmill_msgs/SensorBlock; the samples are a read-only view of the message's.

    Raises ValueError where the samples do not fill all channels evenly or the rate is not positive.
    """
    channels = tuple(
        Channel(c.name, c.quantity, c.unit, c.location, Status(int(c.status))) for c in message.channels)
    flat = np.asarray(message.samples, dtype=np.float32)
    require(len(channels) > 0, "sensor block channels", len(channels), "", "at least one channel")
    require(flat.size % len(channels) == 0, "sensor block samples", flat.size, "values",
            f"a multiple of the {len(channels)} channels")
    return SensorBlock(
        stamp_ns=time_from_message(message.header.stamp), device=message.device, stream_id=int(message.stream_id),
        first_sample=int(message.first_sample), sample_rate=float(message.sample_rate), channels=channels,
        samples=flat.reshape(-1, len(channels)).view())


def axes_to_message(state: AxisState, types: Types) -> Any:
    """sensor_msgs/JointState of an axis state: names x y z b c s, position and velocity, no effort."""
    return _make(
        types, "sensor_msgs/msg/JointState", header=header_to_message(state.stamp_ns, types), name=list(AXES),
        position=_doubles(state.position), velocity=_doubles(state.velocity), effort=np.zeros(0))


def axes_from_message(message: Any) -> AxisState:
    """Axis state of a sensor_msgs/JointState; the axes are found by name, in any order, further joints are ignored.

    Raises ValueError where an axis is missing or named twice, or where position or velocity has not one value
    per name.
    """
    names = list(message.name)
    missing = [axis for axis in AXES if axis not in names]
    require(not missing, "joint names", names, "", f"the axes {', '.join(AXES)} (missing: {', '.join(missing)})")
    require(len(set(names)) == len(names), "joint names", names, "", "each name once")
    position, velocity = _doubles(message.position), _doubles(message.velocity)
    for field, values in (("joint positions", position), ("joint velocities", velocity)):
        require(len(values) == len(names), field, len(values), "values", f"one for each of the {len(names)} names")
    order = [names.index(axis) for axis in AXES]
    return AxisState(
        stamp_ns=time_from_message(message.header.stamp),
        position=tuple(float(position[i]) for i in order),  # type: ignore[arg-type]
        velocity=tuple(float(velocity[i]) for i in order))  # type: ignore[arg-type]


def prior_to_message(prior: Prior | None, types: Types) -> Any:
    """turnmill_msgs/StabilityPrior; None gives one that says "not used"."""
    return _make(
        types, "turnmill_msgs/msg/StabilityPrior", used=prior is not None,
        stamp=time_to_message(prior.stamp_ns if prior else 0, types),
        predicted_type=int(prior.predicted_type) if prior else 0,
        spectral_radius=float(prior.spectral_radius) if prior else math.nan,
        chatter_frequency=float(prior.chatter_frequency) if prior else math.nan,
        flip_multiplier=float(prior.flip_multiplier) if prior else math.nan)


def prior_from_message(message: Any) -> Prior | None:
    """Prior of a turnmill_msgs/StabilityPrior; None where it was not used."""
    if not message.used:
        return None
    return Prior(time_from_message(message.stamp), PredictedType(int(message.predicted_type)),
                 float(message.spectral_radius), float(message.chatter_frequency),
                 float(getattr(message, "flip_multiplier", math.nan)))


def prior_from_margin(message: Any) -> Prior:
    """What a turnmill_msgs/StabilityMargin tells the monitor."""
    return Prior(time_from_message(message.header.stamp), PredictedType(int(message.predicted_type)),
                 float(message.spectral_radius), float(message.chatter_frequency),
                 flip_multiplier(map(complex, message.multipliers_real, message.multipliers_imag)))


def verdict_to_message(verdict: Verdict, operation_hash: str, types: Types) -> Any:
    """turnmill_msgs/ChatterState of a verdict."""
    return _make(
        types, "turnmill_msgs/msg/ChatterState", header=header_to_message(verdict.window_end_ns, types),
        device=verdict.device, stream_id=verdict.stream_id, channel=verdict.channel, state=int(verdict.state),
        reason_code=int(verdict.reason), reason=verdict.reason_text,
        chatter_frequency=float(verdict.chatter_frequency), chatter_family=_doubles(verdict.chatter_family),
        tooth_passing_frequency=float(verdict.tooth_passing_frequency), spindle_speed=float(verdict.spindle_speed),
        spindle_speed_source=int(verdict.spindle_speed_source),
        asynchronous_ratio=float(verdict.asynchronous_ratio), half_order_ratio=float(verdict.half_order_ratio),
        level=float(verdict.level), confidence=float(verdict.confidence),
        window_start=time_to_message(verdict.window_start_ns, types),
        window_end=time_to_message(verdict.window_end_ns, types), last_sample=verdict.last_sample,
        prior=prior_to_message(verdict.prior, types), operation_hash=operation_hash,
        spindle_speed_confidence=float(verdict.spindle_speed_confidence))


def verdict_from_message(message: Any) -> Verdict:
    """Verdict of a turnmill_msgs/ChatterState (the operation hash stays in the message)."""
    return Verdict(
        window_start_ns=time_from_message(message.window_start), window_end_ns=time_from_message(message.window_end),
        last_sample=int(message.last_sample), device=message.device, stream_id=int(message.stream_id),
        channel=message.channel, state=ChatterKind(int(message.state)), reason=Reason(int(message.reason_code)),
        reason_text=message.reason, chatter_frequency=float(message.chatter_frequency),
        chatter_family=tuple(float(f) for f in message.chatter_family),
        tooth_passing_frequency=float(message.tooth_passing_frequency), spindle_speed=float(message.spindle_speed),
        spindle_speed_source=SpeedSource(int(message.spindle_speed_source)),
        asynchronous_ratio=float(message.asynchronous_ratio), half_order_ratio=float(message.half_order_ratio),
        level=float(message.level), confidence=float(message.confidence), prior=prior_from_message(message.prior),
        spindle_speed_confidence=float(getattr(message, "spindle_speed_confidence", math.nan)))


_LOADS_VECTORS = ("force_tool_mean", "force_tool_peak", "force_machine_mean", "force_machine_peak")
_LOADS_SCALARS = (
    "tool_torque_mean", "tool_torque_peak", "tool_power_mean", "workpiece_torque_mean", "workpiece_torque_peak",
    "workpiece_power_mean", "chip_thickness_max", "cutting_speed", "tooth_passing_frequency", "material_removal_rate")


def loads_to_message(loads: Any, stamp_ns: int, operation_hash: str, types: Types) -> Any:
    """turnmill_msgs/CuttingLoads of a value with the same field names (turnmill_core.cutting.loads)."""
    return _make(
        types, "turnmill_msgs/msg/CuttingLoads", header=header_to_message(stamp_ns, types, "tool"),
        **{name: _vector_to_message(getattr(loads, name), types) for name in _LOADS_VECTORS},
        **{name: float(getattr(loads, name)) for name in _LOADS_SCALARS},
        in_cut=bool(loads.in_cut), operation_hash=operation_hash)


def loads_from_message(message: Any) -> dict[str, Any]:
    """Fields of a turnmill_msgs/CuttingLoads by name: arrays (3,), floats and in_cut, plus stamp_ns."""
    return {
        "stamp_ns": time_from_message(message.header.stamp), "in_cut": bool(message.in_cut),
        **{name: vector_from_message(getattr(message, name)) for name in _LOADS_VECTORS},
        **{name: float(getattr(message, name)) for name in _LOADS_SCALARS}}


def wrench_to_message(force: ArrayLike, torque: ArrayLike, stamp_ns: int, frame_id: str, types: Types) -> Any:
    """geometry_msgs/WrenchStamped of a force [N] and a torque [N m], arrays (3,) in the frame `frame_id`."""
    wrench = _make(types, "geometry_msgs/msg/Wrench", force=_vector_to_message(force, types),
                   torque=_vector_to_message(torque, types))
    return _make(types, "geometry_msgs/msg/WrenchStamped", header=header_to_message(stamp_ns, types, frame_id),
                 wrench=wrench)


def scale_to_message(estimate: Any, source: Any, operation_hash: str, types: Types) -> Any:
    """turnmill_msgs/ForceScale of an estimate (turnmill_core.cutting.scale) from a source (turnmill_ros.measured)."""
    return _make(
        types, "turnmill_msgs/msg/ForceScale", header=header_to_message(estimate.end_ns, types, source.frame),
        source=source.name, quantity=source.quantity, **{name: _doubles(getattr(estimate, name)) for name in (
            "measured", "predicted", "offset")},
        **{name: float(getattr(estimate, name)) for name in ("scale", "lower", "upper", "windows")},
        reason=estimate.reason, operation_hash=operation_hash)


_MARGIN_SCALARS = (
    "tool_speed", "workpiece_speed", "depth", "depth_limit", "depth_searched", "depth_ratio", "spectral_radius",
    "chatter_frequency", "principal_period", "delay", "nearest_stable_speed")


def margin_to_message(margin: Any, stamp_ns: int, operation_hash: str, types: Types) -> Any:
    """turnmill_msgs/StabilityMargin of a value with the same field names (turnmill_core.stability.margin).

    stable_depths: pairs (lower, upper) or a flat array [m]; multipliers: complex array.
    """
    multipliers = np.asarray(margin.multipliers, dtype=np.complex128).reshape(-1)
    return _make(
        types, "turnmill_msgs/msg/StabilityMargin", header=header_to_message(stamp_ns, types),
        **{name: float(getattr(margin, name)) for name in _MARGIN_SCALARS},
        stable_depths=_doubles(margin.stable_depths), multipliers_real=multipliers.real.copy(),
        multipliers_imag=multipliers.imag.copy(), predicted_type=int(margin.predicted_type),
        operation_hash=operation_hash)


def margin_from_message(message: Any) -> dict[str, Any]:
    """Fields of a turnmill_msgs/StabilityMargin by name: stable_depths (n, 2), multipliers complex, and stamp_ns."""
    return {
        "stamp_ns": time_from_message(message.header.stamp),
        "stable_depths": _doubles(message.stable_depths).reshape(-1, 2),
        "multipliers": _doubles(message.multipliers_real) + 1j * _doubles(message.multipliers_imag),
        "predicted_type": PredictedType(int(message.predicted_type)),
        **{name: float(getattr(message, name)) for name in _MARGIN_SCALARS}}


def lobes_to_message(lobes: Any, stamp_ns: int, operation_hash: str, types: Types) -> Any:
    """turnmill_msgs/StabilityLobes of a value with the same field names; spectral_radius (depths, tool speeds)."""
    shape = (len(lobes.depths), len(lobes.tool_speeds))
    for name in ("spectral_radius", "predicted_type"):
        found = np.shape(getattr(lobes, name))
        require(found == shape, f"lobes {name} shape", found, "", f"{shape} (depths, tool speeds)")
    return _make(
        types, "turnmill_msgs/msg/StabilityLobes", header=header_to_message(stamp_ns, types),
        workpiece_speed=float(lobes.workpiece_speed), tool_speeds=_doubles(lobes.tool_speeds),
        depths=_doubles(lobes.depths), spectral_radius=_doubles(lobes.spectral_radius),
        predicted_type=np.asarray(lobes.predicted_type, dtype=np.uint8).reshape(-1),
        depth_limit=_doubles(lobes.depth_limit), operation_hash=operation_hash)


def lobes_from_message(message: Any) -> dict[str, Any]:
    """Fields of a turnmill_msgs/StabilityLobes by name; spectral_radius and predicted_type (depths, tool speeds)."""
    shape = (len(message.depths), len(message.tool_speeds))
    return {
        "stamp_ns": time_from_message(message.header.stamp), "workpiece_speed": float(message.workpiece_speed),
        "tool_speeds": _doubles(message.tool_speeds), "depths": _doubles(message.depths),
        "spectral_radius": _doubles(message.spectral_radius).reshape(shape),
        "predicted_type": np.asarray(message.predicted_type, dtype=np.uint8).reshape(shape),
        "depth_limit": _doubles(message.depth_limit)}


def operation_to_message(operation: Operation, stamp_ns: int, types: Types) -> Any:
    """turnmill_msgs/Operation: the file's text, its sha256 and the operation's name."""
    return _make(types, "turnmill_msgs/msg/Operation", header=header_to_message(stamp_ns, types), yaml=operation.text,
                 sha256=operation.sha256, name=operation.name)


def operation_from_message(message: Any) -> Operation:
    """Operation of a turnmill_msgs/Operation, parsed from its text.

    Raises OperationError (a ValueError) where the text is not an operation, ValueError where the hash is
    not that of the text.
    """
    from turnmill_core.operation_file import parse_operation

    operation = parse_operation(message.yaml, name=f"operation {message.name!r} in the recording")
    require(operation.sha256 == message.sha256, "operation sha256", message.sha256, "",
            f"{operation.sha256}, that of the text")
    return operation
