#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Connect, look, plan, watch: the Python package in cells (# %%), as editors run them one by one.

Needs a running silhouette-server with a grid of two joints and a scene, such as that of tools/demo.
The planner is a breadth-first search over the configuration space. (Debian 12 has no Python
bindings of OMPL; with your own, let LocalSpace.check answer its state validity checker.)

    plan_and_explain.py --server 127.0.0.1:50051 --start=-1.75,1.22 --goal=1.75,1.22 --out pictures
"""

# %% Arguments
import argparse
import collections
import pathlib
from typing import Any, Dict, List, Tuple

import matplotlib.pyplot as plt  # type: ignore[import]
import numpy as np
from numpy.typing import NDArray

import silhouette
from silhouette import State

parser = argparse.ArgumentParser(
    description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--server", default="127.0.0.1:50051", help="host:port")
parser.add_argument("--start", default="-1.75,1.22", help="two joint values, radians")
parser.add_argument("--goal", default="1.75,1.22", help="two joint values, radians")
parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("pictures"))
arguments = parser.parse_args()
start = np.array([float(value) for value in arguments.start.split(",")])
goal = np.array([float(value) for value in arguments.goal.split(",")])
arguments.out.mkdir(parents=True, exist_ok=True)

# %% Connect: the whole configuration space of the newest scene
client = silhouette.Client(arguments.server, timeout=10.0)
space = client.configuration_space()
grid, states = space.grid, space.states
if len(grid.shape) != 2:
    raise SystemExit(f"the example draws two joints; this grid has {len(grid.shape)}")
free = states == State.FREE
print(f"scene {space.basis.scene_id}: {free.sum()} of {grid.size} configurations are free")


# %% Plan: breadth-first over free grid points, along one joint at a time
def search(begin: Tuple[int, ...], end: Tuple[int, ...]) -> List[Tuple[int, ...]]:
    """The grid indices from begin to end; empty: there is no path."""
    came_from: Dict[Tuple[int, ...], Tuple[int, ...]] = {begin: begin}
    reached = collections.deque([begin])
    while reached and end not in came_from:
        at = reached.popleft()
        for joint in range(len(grid.shape)):
            for step in (-1, 1):
                moved = list(at)
                moved[joint] += step
                if not 0 <= moved[joint] < grid.shape[joint]:
                    continue  # also on a continuous joint: paths do not wrap
                there = tuple(moved)
                if free[there] and there not in came_from:
                    came_from[there] = at
                    reached.append(there)
    if end not in came_from:
        return []
    path = [end]
    while path[-1] != begin:
        path.append(came_from[path[-1]])
    return path[::-1]


def waypoints_of(path: List[Tuple[int, ...]]) -> NDArray[np.float64]:
    """Start, the corners of the path, and goal: (n, d) radians."""
    corners = [path[i] for i in range(1, len(path) - 1)
               if np.any(np.subtract(path[i + 1], path[i]) != np.subtract(path[i], path[i - 1]))]
    return np.array([start] + [grid.at(index) for index in corners] + [goal])


begin, end = grid.nearest(start), grid.nearest(goal)
if begin is None or end is None:
    raise SystemExit("start or goal is outside the grid")
path = search(begin, end) if free[begin] and free[end] else []
if not path:
    verdicts = client.check([start, goal], evidence=True).verdicts
    raise SystemExit(f"no path: the start is {verdicts[0]}, the goal is {verdicts[1]}")
waypoints = np.array([start] + [grid.at(index) for index in path] + [goal])
short = waypoints_of(path)
if client.check_path(short):  # start and goal lie off the grid: the corners alone may not be free
    waypoints = short
check = client.check_path(waypoints)
print(f"{len(waypoints)} waypoints; the server calls the path {check.verdict}, {check.proof.name}")
np.save(arguments.out / "path.npy", waypoints)

# %% Show the configuration space and the path
figure, axes = plt.subplots(figsize=(6, 5), constrained_layout=True)
colours = np.array([[150, 150, 150], [255, 255, 255], [200, 60, 50]], dtype=np.uint8)
x, y = (np.degrees(values) for values in grid.axes)
half = [(values[1] - values[0]) / 2 for values in (x, y)]
axes.imshow(colours[states].swapaxes(0, 1), origin="lower", aspect="auto",
            extent=(x[0] - half[0], x[-1] + half[0], y[0] - half[1], y[-1] + half[1]))
axes.plot(*np.degrees(waypoints).T, "o-", color="tab:blue", markersize=4, label="path")
axes.set_xlabel(f"{grid.joints[0].name}, degrees")
axes.set_ylabel(f"{grid.joints[1].name}, degrees")
axes.set_title(f"Scene {space.basis.scene_id}: white free, red occupied, grey unknown")
axes.legend()
figure.savefig(arguments.out / "configuration-space.png", dpi=110)

# %% Why is an occupied configuration on the straight line occupied?
straight = start + np.linspace(0, 1, 201)[:, None] * (goal - start)
not_free = straight[~client.check(straight).free]
asked = not_free[len(not_free) // 2] if len(not_free) else goal
explanation = client.explain(asked)
counts: Dict[str, Any] = {view.view: view for view in explanation.verdict.views}
figure, rows = plt.subplots(len(explanation.views), 4, squeeze=False, constrained_layout=True,
                            figsize=(9, 2.4 * len(explanation.views)))
for row, view in zip(rows, explanation.views):
    pictures = {"scene": view.scene, "obstacle": view.obstacle,
                "intersection": view.intersection, "collision": view.collision}
    for place, (name, picture) in zip(row, pictures.items()):
        place.imshow(picture, interpolation="nearest")
        place.set_title(f"{view.view}: {name}", fontsize=9)
        place.set_xticks([])
        place.set_yticks([])
    row[2].set_xlabel(f"{counts[view.view].obstacle_pixels} pixels shared", fontsize=9)
figure.suptitle(f"{np.round(np.degrees(asked), 1)} degrees: {explanation.verdict}")
figure.savefig(arguments.out / "explanation.png", dpi=110)

# %% Watch the path: what a robot's program does while it moves
with client.watch_path(waypoints) as watch:
    update = watch.next(timeout=10.0)
    print(f"the path is {'free' if update else 'not free: stop'}, "
          f"valid for {update.check.basis.valid_for:.1f} s")
    # for update in watch:  # with every scene, and when the last update expires
    #     if not update: stop the robot

# %% Check without a call
# The demo publishes one scene, which soon is old; where cameras are live, a second is enough.
with silhouette.LocalSpace(client, max_age=600.0) as local:
    snapshot = local.wait_for_update(after=0, timeout=10.0)
    print(f"local: start {snapshot.check(start)}, goal {snapshot.check(goal)}")
    print(f"local: {snapshot.check_many(straight).free.sum()} of {len(straight)} places free")
