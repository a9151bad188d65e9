#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A CameraDriverService in Python: each camera shows a file, as it is when it is asked for.

An example to begin a driver of your own with: replace the class FileCamera. In cell.yaml:

    source: {grpc: "127.0.0.1:50060"}

    mkdir -p build/python
    protoc -I proto/silhouette/v1 --python_out=build/python --grpc_out=build/python \\
        --plugin=protoc-gen-grpc=$(which grpc_python_plugin) camera_driver.proto
    PYTHONPATH=build/python /usr/bin/python3 file_cameras.py --size 640x480 top=top.png front=front.png
"""

import argparse
import pathlib
from concurrent import futures

import camera_driver_pb2
import camera_driver_pb2_grpc
import grpc


class FileCamera:
    """Replace its two methods by what your camera's library does."""

    def __init__(self, path):
        self.path = path

    def trigger(self):
        """Asks for an image and does not wait for it."""

    def wait(self):
        """The image that was asked for, as the bytes of a PNG or JPEG file."""
        with open(self.path, "rb") as file:
            return file.read()


class CameraDriver(camera_driver_pb2_grpc.CameraDriverServiceServicer):
    def __init__(self, cameras, width, height):
        self.cameras = cameras
        self.size = {"width": width, "height": height}

    def GetCameras(self, request, context):
        return camera_driver_pb2.GetCamerasResponse(
            cameras=[camera_driver_pb2.DriverCamera(name=name, **self.size) for name in self.cameras])

    def Grab(self, request, context):
        for name in request.cameras:
            if name not in self.cameras:
                context.abort(grpc.StatusCode.NOT_FOUND, f"there is no camera '{name}'")
        response = camera_driver_pb2.GrabResponse()
        for name in request.cameras:  # all of them, before any is waited for
            self.cameras[name].trigger()
        for name in request.cameras:
            try:
                response.images.add(encoded=self.cameras[name].wait())
            except OSError as error:
                context.abort(grpc.StatusCode.UNAVAILABLE, f"the camera '{name}': {error}")
        # Without a capture_time the beginning of the call counts. State it if your camera knows:
        # response.images[0].capture_time.FromNanoseconds(time.time_ns())
        return response


def camera(text):
    name, _, path = text.partition("=")
    if not name or not path:
        raise argparse.ArgumentTypeError(f"'{text}' is not name=file, as in top=top.png")
    if not pathlib.Path(path).is_file():
        raise argparse.ArgumentTypeError(f"there is no file '{path}'")
    return name, FileCamera(path)


def size(text):
    width, _, height = text.partition("x")
    if not width.isdecimal() or not height.isdecimal():
        raise argparse.ArgumentTypeError(f"'{text}' is not a width and a height, as in 640x480")
    return int(width), int(height)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cameras", nargs="+", type=camera, help="name=file, e.g. top=top.png")
    parser.add_argument("--size", required=True, type=size, help="of the images, e.g. 640x480")
    parser.add_argument("--port", type=int, default=50060, help="at 127.0.0.1; 0: a free one")
    arguments = parser.parse_args()
    cameras = dict(arguments.cameras)
    server = grpc.server(futures.ThreadPoolExecutor(max_workers=2))
    camera_driver_pb2_grpc.add_CameraDriverServiceServicer_to_server(
        CameraDriver(cameras, *arguments.size), server)
    try:
        port = server.add_insecure_port(f"127.0.0.1:{arguments.port}")
    except RuntimeError:
        parser.error(f"cannot listen on 127.0.0.1:{arguments.port}")
    server.start()
    print(f"serving {', '.join(cameras)} at 127.0.0.1:{port}", flush=True)
    server.wait_for_termination()


if __name__ == "__main__":
    main()
