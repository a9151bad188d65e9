# SPDX-License-Identifier: Apache-2.0
"""The extension is built by CMake, in $SILHOUETTE_PYTHON_BUILD or a temporary folder, with $CMAKE_ARGS."""
import os
import pathlib
import shlex
import subprocess
import sys

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

ROOT = pathlib.Path(__file__).resolve().parents[2]


class CMakeBuild(build_ext):
    def build_extension(self, ext):
        target = pathlib.Path(self.get_ext_fullpath(ext.name)).resolve()
        build = pathlib.Path(os.environ.get("SILHOUETTE_PYTHON_BUILD", self.build_temp)).resolve()
        subprocess.run(
            ["cmake", "-S", ROOT, "-B", build, "-DCMAKE_BUILD_TYPE=Release", "-DCMAKE_UNITY_BUILD=ON",
             "-DSILHOUETTE_PARTS=client", "-DSILHOUETTE_PYTHON=ON", f"-DPython3_EXECUTABLE={sys.executable}",
             *shlex.split(os.environ.get("CMAKE_ARGS", ""))],
            check=True)
        # A compiler may take 1 GB.
        jobs = os.environ.get("CMAKE_BUILD_PARALLEL_LEVEL") or str(os.cpu_count())
        subprocess.run(["cmake", "--build", build, "--parallel", jobs, "--target", "silhouette_python"],
                       check=True)
        built = next((build / "python/silhouette").glob("_silhouette*.so"))
        target.parent.mkdir(parents=True, exist_ok=True)
        self.copy_file(str(built), str(target))


setup(ext_modules=[Extension("silhouette._silhouette", sources=[])], cmdclass={"build_ext": CMakeBuild})
