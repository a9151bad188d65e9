#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""What a check costs in Python: LocalSpace.check, and check_many per configuration.

Needs a running silhouette-server with a scene that is young enough.

    overhead.py --server 127.0.0.1:50051
"""
import argparse
import timeit

import numpy as np

import silhouette

parser = argparse.ArgumentParser(
    description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--server", default="127.0.0.1:50051", help="host:port")
client = silhouette.Client(parser.parse_args().server)


def nanoseconds(call: str, **names: object) -> float:
    """The fastest of 20 runs, for one call."""
    count = 20_000
    return min(timeit.repeat(call, globals=names, number=count, repeat=20)) / count * 1e9


with silhouette.LocalSpace(client, max_age=600.0) as space:
    snapshot = space.wait_for_update(after=0, timeout=10.0)
    grid = snapshot.grid
    if grid is None:
        raise SystemExit(f"no map yet: {space.status}")
    q = grid.at([0] * len(grid.shape))
    points = np.random.default_rng(1).uniform(
        [joint.lower for joint in grid.joints], [joint.upper for joint in grid.joints],
        (100_000, len(grid.shape)))
    print(f"verdict: {snapshot.check(q)}")
    print(f"an empty call:               {nanoseconds('f(q)', f=lambda q: None, q=q):6.0f} ns")
    print(f"LocalSpace.check(array):     {nanoseconds('f(q)', f=space.check, q=q):6.0f} ns")
    print(f"LocalSpace.check(list):      {nanoseconds('f(q)', f=space.check, q=q.tolist()):6.0f} ns")
    print(f"SpaceSnapshot.check(array):  {nanoseconds('f(q)', f=snapshot.check, q=q):6.0f} ns")
    many = min(timeit.repeat(lambda: snapshot.check_many(points), number=1, repeat=20))
    print(f"check_many, for one:         {many / len(points) * 1e9:6.0f} ns")
