"""A complete sensor node: publishes a sound file as if a microphone heard it now.

Run: python examples/publish_sensor_blocks.py cut.wav
and beside it any consumer of `sensor_blocks`, for example the chatter monitor or the recorder.
Replace `soundfile.blocks` by your acquisition device's read function; the rest stays.
"""

import array
import sys
import time

import rclpy
import soundfile
from turnmill_msgs.msg import SensorBlock, SensorChannel

BLOCK_S = 0.02

path = sys.argv[1]
rate = soundfile.info(path).samplerate
size = round(BLOCK_S * rate)

rclpy.init()
node = rclpy.create_node("microphone")
publisher = node.create_publisher(SensorBlock, "sensor_blocks", 500)
while publisher.get_subscription_count() == 0:
    time.sleep(0.05)

start_ns = node.get_clock().now().nanoseconds
stream_id = start_ns // 1_000_000_000 % 2**32
first = 0
for samples in soundfile.blocks(path, blocksize=size, dtype="float32", always_2d=True):
    block = SensorBlock(device="microphone", stream_id=stream_id, first_sample=first, sample_rate=float(rate))
    stamp_ns = start_ns + first * 1_000_000_000 // rate
    block.header.stamp.sec, block.header.stamp.nanosec = divmod(stamp_ns, 1_000_000_000)
    block.channels = [
        SensorChannel(name=f"mic{k + 1}", quantity="sound_pressure", unit="1", status=SensorChannel.STATUS_UNCALIBRATED)
        for k in range(samples.shape[1])
    ]
    block.samples = array.array("f", samples.tobytes())
    first += len(samples)
    time.sleep(max(0.0, (start_ns + first * 1_000_000_000 // rate - node.get_clock().now().nanoseconds) * 1e-9))
    publisher.publish(block)

publisher.wait_for_all_acked()
print(f"{first} samples published")
node.destroy_node()
rclpy.shutdown()
