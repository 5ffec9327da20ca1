"""Chatter in a folder of recordings, one line each, without ROS.

Run: python examples/analyze_folder.py bags
"""

import sys
from pathlib import Path

from turnmill_ros.analysis import analyze, summary
from turnmill_ros.errors import InputError

for bag in sorted(Path(sys.argv[1]).glob("*.mcap")):
    try:
        found = summary(analyze(bag))
    except InputError as error:
        print(f"{bag.name:34} {error}")
        continue
    print(f"{bag.name:34} {found['in_cut_s']:6.1f} s in the cut, {found['chatter_s']:6.1f} s chatter"
          f" at {found['chatter_frequency_hz']:.1f} Hz")
