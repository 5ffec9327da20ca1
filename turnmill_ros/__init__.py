"""turnmill on ROS 2 and on recordings: nodes, graph, bags, command line."""

import os

# The matrices here are small. Threads of the linear algebra library would gain little on them and, spinning while
# they wait, take the processors from the other nodes (measured: a margin 10 times slower on two busy cores).
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
