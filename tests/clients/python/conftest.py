# SPDX-License-Identifier: Apache-2.0
"""A cell that silhouette-server serves, small enough to know every verdict: two joints of 11
values, two views of 16 x 16 pixels. The robot is a block of 3 x 3 pixels that joint x moves to the
right and joint y moves down, a pixel per step; both views see the same."""
import os
import pathlib
import re
import subprocess
import sys
import time

import numpy as np
import pytest
from PIL import Image

import silhouette

BIN = pathlib.Path(os.environ["SILHOUETTE_BIN_DIR"])
SOURCE = pathlib.Path(os.environ["SILHOUETTE_SOURCE_DIR"])
STEPS = 11
CELL = """name: block
robot:
  joints:
    - {name: x, lower: 0, upper: 1}
    - {name: y, lower: 0, upper: 1}
grid:
  steps: {x: 11, y: 11}
views:
  - {name: left, mask_size: [16, 16]}
  - {name: right, mask_size: [16, 16]}
server:
  listen: 127.0.0.1:0
  max_age: 10 min
"""


def robot_at(x, y):
    mask = np.zeros((16, 16), bool)
    mask[y + 1:y + 4, x + 1:x + 4] = True
    return mask


WALL = np.zeros((16, 16), bool)
WALL[0:10, 7:9] = True  # from the upper rim down; the robot passes below it in two rows
TRUTH = np.array([[(robot_at(x, y) & WALL).any() for y in range(STEPS)] for x in range(STEPS)])


def serve(folder, cell="cell.yaml"):
    """The server and its address, once it listens."""
    output = folder / "server.txt"
    with open(output, "w") as file:
        server = subprocess.Popen(
            [BIN / "silhouette-server", "--cell", folder / cell, "--database", folder / "cell.lmdb"],
            stdout=file, stderr=subprocess.STDOUT)
    while True:
        found = re.search(r"listening on (\S+)\n", output.read_text())
        if found:
            return server, found[1]
        assert server.poll() is None, output.read_text()
        time.sleep(0.01)


@pytest.fixture(scope="session")
def cell(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cell")
    (folder / "cell.yaml").write_text(CELL)
    (folder / "masks").mkdir()
    lines = ["x,y,left,right"]
    for x in range(STEPS):
        for y in range(STEPS):
            Image.fromarray(robot_at(x, y)).save(folder / "masks" / f"{x}_{y}.png")
            lines.append(f"{x / 10},{y / 10},{x}_{y}.png,{x}_{y}.png")
    (folder / "masks" / "configurations.csv").write_text("\n".join(lines) + "\n")
    subprocess.run([BIN / "silhouette-db", "import", "masks", "--cell", "cell.yaml", "--database", "cell.lmdb"],
                   cwd=folder, check=True, capture_output=True)
    return folder


@pytest.fixture
def server(cell):
    """A new server for each test: no test sees the scene of another."""
    process, address = serve(cell)
    yield address
    process.kill()  # a graceful end waits for clients
    process.wait()


@pytest.fixture
def client(server):
    return silhouette.Client(server)


@pytest.fixture(scope="session")
def modules(tmp_path_factory):
    """What protoc makes of the API, with Debian's own plugin."""
    folder = tmp_path_factory.mktemp("modules")
    protos = sorted((SOURCE / "proto/silhouette/v1").glob("*.proto"))
    subprocess.run(["protoc", "-I", SOURCE / "proto", f"--python_out={folder}", f"--grpc_out={folder}",
                    "--plugin=protoc-gen-grpc=/usr/bin/grpc_python_plugin", *protos], check=True)
    return folder


FAKE = """import concurrent.futures, time
import grpc
from silhouette.v1 import collision_service_pb2 as messages, collision_service_pb2_grpc as collisions
from silhouette.v1 import scene_service_pb2_grpc as scenes, types_pb2 as types

FREE = types.Verdict(state=types.Verdict.STATE_FREE)

def basis():
    made = types.Basis(scene_id=1)
    made.valid_for.FromMilliseconds(200)
    made.server_clock.FromNanoseconds(time.clock_gettime_ns(time.CLOCK_BOOTTIME))
    return made

class Collisions(collisions.CollisionServiceServicer):
    def CheckConfigurations(self, request, context):
        answer = messages.CheckConfigurationsResponse(basis=basis(), verdicts=[FREE] * len(request.configurations))
        if request.configurations:
            time.sleep(0.4)
        return answer

    def WatchPath(self, request, context):
        yield messages.WatchPathResponse(check=messages.CheckPathResponse(basis=basis(), verdict=FREE))
        if request.waypoints[0].positions[0] == 1:
            context.abort(grpc.StatusCode.CANCELLED, "as a proxy does")
        while context.is_active():
            time.sleep(0.01)

class Scenes(scenes.SceneServiceServicer):
    def RevokeRegion(self, request, context):
        context.abort(grpc.StatusCode.ABORTED, "the database was replaced")

server = grpc.server(concurrent.futures.ThreadPoolExecutor(8))
collisions.add_CollisionServiceServicer_to_server(Collisions(), server)
scenes.add_SceneServiceServicer_to_server(Scenes(), server)
port = server.add_insecure_port("127.0.0.1:0")
server.start()
print(port, flush=True)
server.wait_for_termination()
"""


@pytest.fixture
def fake(modules):
    """The address of a server that calls everything free for 0.2 s, answers checks after 0.4 s, sends one
    update of a watched path, cancels the watch if the path begins at 1, and revokes no region."""
    process = subprocess.Popen([sys.executable, "-c", FAKE], stdout=subprocess.PIPE, text=True,
                               env={**os.environ, "PYTHONPATH": str(modules)})
    yield f"127.0.0.1:{process.stdout.readline().strip()}"
    process.kill()
    process.wait()


def publish(client, left=WALL, right=WALL, variant=""):
    taken = time.monotonic()
    robot = robot_at(0, 0)
    return client.publish_scene(
        joints={"x": 0.0, "y": 0.0}, views={"left": left | robot, "right": right | robot}, variant=variant,
        taken=taken)
