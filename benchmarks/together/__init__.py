"""`python -m benchmarks soak --everything`: all parts of Catenary together, for a long time.

    segment (ring, clocks) ─ loop ─ share ─┬─ recorder, again and again
      objects, files, Ethernet ─┘          ├─ dashboard ─ viewer
      cuts of the ring ─┘                  └─ ROS 2

The memory and the descriptors of each process are sampled. They must not grow.
"""
