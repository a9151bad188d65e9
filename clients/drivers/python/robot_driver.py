#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""A robot with a vendor's library, driven by silhouette-capture and silhouette-calibrate.

Serves silhouette.v1.RobotDriverService. Runs as it is, with an arm that is not there; for yours,
write a class with the methods of `PretendArm` over the vendor's library. README.md says how.

    robot_driver.py --listen 127.0.0.1:50061
"""

import argparse
import concurrent.futures
import importlib
import math
import pathlib
import signal
import subprocess
import sys
import tempfile
import threading
import time

import grpc

PROTO = pathlib.Path(__file__).resolve().parent / "../../../proto/silhouette/v1"


class PretendArm:
    """Stands for the vendor's library: an arm that moves evenly in joint space.

    Units as such libraries have them: degrees and seconds. Every method may be called at any time
    from any thread; if your library takes one thread only, put a lock around its calls, but let
    stop() through while move() is waiting.
    """

    JOINTS = ["joint_1", "joint_2", "joint_3", "joint_4", "joint_5", "joint_6"]
    LIMIT = 180.0  # degrees, of every joint

    def __init__(self, start):
        self._lock = threading.Lock()
        self._from = list(start)
        self._to = list(start)
        self._begin = time.monotonic()
        self._seconds = 0.0

    def joints(self):
        """Measured, in degrees."""
        with self._lock:
            return self._now()[0]

    def is_moving(self):
        with self._lock:
            return self._now()[1] < 1

    def trouble(self):
        """Why the arm can go nowhere, such as 'emergency stop'; '' if it can."""
        return ""

    def move(self, degrees, seconds):
        """Sets off and returns at once. ValueError: beyond a limit."""
        for name, value in zip(self.JOINTS, degrees):
            if not abs(value) <= self.LIMIT:
                raise ValueError(f"{name} cannot go to {value:.1f} degrees")
        with self._lock:
            self._from = self._now()[0]
            self._to = list(degrees)
            self._begin = time.monotonic()
            self._seconds = seconds

    def stop(self):
        with self._lock:
            self._from = self._to = self._now()[0]
            self._seconds = 0.0

    def _now(self):
        spent = time.monotonic() - self._begin
        share = 1.0 if spent >= self._seconds else spent / self._seconds
        return [a + share * (b - a) for a, b in zip(self._from, self._to)], share


def load_service():
    """The service's modules, made of its .proto by protoc (Debian: protobuf-compiler-grpc).

    They are in no package: one named silhouette would clash with the Python client.
    """
    try:
        importlib.import_module("robot_driver_pb2_grpc")
    except ImportError:
        folder = tempfile.mkdtemp(prefix="silhouette-")
        try:
            subprocess.run(
                ["protoc", f"-I{PROTO}", f"--python_out={folder}", f"--grpc_out={folder}",
                 "--plugin=protoc-gen-grpc=/usr/bin/grpc_python_plugin",
                 "robot_driver.proto"], check=True)
        except (OSError, subprocess.CalledProcessError):
            print("robot_driver.py: protoc cannot make the service's modules; install protobuf-compiler and "
                  "protobuf-compiler-grpc, correct PROTO in this script if it was copied elsewhere, or make the "
                  "modules beside it as README.md says", file=sys.stderr)
            sys.exit(2)
        sys.path.insert(0, folder)
        importlib.invalidate_caches()
    return (importlib.import_module("robot_driver_pb2"),
            importlib.import_module("robot_driver_pb2_grpc"))


messages, services = load_service()


class RobotDriver(services.RobotDriverServiceServicer):
    """The service over an arm. All of the arm's units become radians here, and nowhere else."""

    def __init__(self, arm):
        self._arm = arm

    def GetRobot(self, request, context):
        return messages.GetRobotResponse(joints=self._arm.JOINTS)

    def GetState(self, request, context):
        return messages.GetStateResponse(
            positions=[math.radians(degrees) for degrees in self._arm.joints()],
            moving=self._arm.is_moving(), fault=self._arm.trouble())

    def MoveTo(self, request, context):
        if len(request.positions) != len(self._arm.JOINTS):
            context.abort(grpc.StatusCode.INVALID_ARGUMENT,
                          f"the robot has {len(self._arm.JOINTS)} joints")
        trouble = self._arm.trouble()
        if trouble:
            context.abort(grpc.StatusCode.FAILED_PRECONDITION, trouble)
        try:
            self._arm.move([math.degrees(radians) for radians in request.positions],
                           request.duration.ToTimedelta().total_seconds())
        except ValueError as error:
            context.abort(grpc.StatusCode.INVALID_ARGUMENT, str(error))
        # Who waits here notices that the caller is gone, and stops the robot.
        while self._arm.is_moving():
            if not context.is_active():
                self._arm.stop()
                break
            time.sleep(0.005)
        return messages.MoveToResponse()

    def Stop(self, request, context):
        self._arm.stop()
        return messages.StopResponse()


def degrees_of_all(text):
    try:
        values = [float(value) for value in text.split(",")]
    except ValueError:
        values = []
    if len(values) != len(PretendArm.JOINTS):
        raise argparse.ArgumentTypeError(f"'{text}' is not {len(PretendArm.JOINTS)} numbers with commas between them")
    return values


def add_port(server, listen, tls):
    if not tls:
        return server.add_insecure_port(listen)
    certificate, key, client_ca = (file.read_bytes() for file in tls)
    return server.add_secure_port(listen, grpc.ssl_server_credentials(
        [(key, certificate)], client_ca, require_client_auth=True))


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--listen", default="127.0.0.1:50061",
                        help="host:port; port 0: a free one (default: %(default)s)")
    parser.add_argument("--start", type=degrees_of_all, default="0,0,0,0,0,0",
                        help="where the pretended arm stands, in degrees (default: %(default)s)")
    parser.add_argument("--tls", nargs=3, metavar=("CERTIFICATE", "KEY", "CLIENT_CA"), type=pathlib.Path,
                        help="PEM files: encrypt, and let in only clients whose certificate CLIENT_CA signed")
    arguments = parser.parse_args()

    arm = PretendArm(arguments.start)
    # A MoveTo occupies a thread until the robot has arrived: GetState and Stop need others.
    server = grpc.server(concurrent.futures.ThreadPoolExecutor(max_workers=8))
    services.add_RobotDriverServiceServicer_to_server(RobotDriver(arm), server)
    try:
        port = add_port(server, arguments.listen, arguments.tls)
    except OSError as error:  # of a certificate's file
        parser.error(str(error))
    except RuntimeError:
        parser.error(f"cannot listen on {arguments.listen}")
    server.start()
    print(f"serving the robot on {arguments.listen.rsplit(':', 1)[0]}:{port}", flush=True)
    signal.sigwait({signal.SIGINT, signal.SIGTERM})
    arm.stop()
    server.stop(grace=1).wait()


if __name__ == "__main__":
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    main()
