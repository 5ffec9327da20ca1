"""Recordings: MCAP read, write, check and salvage, without ROS.

One page of names; docs/formats.md describes the file.
"""

from turnmill_ros.bag_check import Finding, check_bag
from turnmill_ros.bag_read import BagInfo, BagMessage, RawMessage, TopicInfo, bag_info, raw_messages, read_bag
from turnmill_ros.bag_write import BagWriter
from turnmill_ros.recover import Recovery, recover
from turnmill_ros.versions import software_versions

__all__ = [
    "BagInfo", "BagMessage", "BagWriter", "Finding", "RawMessage", "Recovery", "TopicInfo", "bag_info", "check_bag",
    "raw_messages", "read_bag", "recover", "software_versions",
]
