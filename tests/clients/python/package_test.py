# SPDX-License-Identifier: Apache-2.0
"""The package as its users get it: installed by CMake and by pip, with types that a checker reads,
and beside the modules that protoc makes for plain gRPC."""
import os
import pathlib
import subprocess
import sys
import textwrap

import numpy as np

from conftest import SOURCE, TRUTH, publish

BUILD = pathlib.Path(os.environ["SILHOUETTE_BUILD_DIR"])
ASK = """import sys, silhouette
print(silhouette.__file__)
print(silhouette.Client(sys.argv[1]).check([[0.0, 0.0]]).all_free)
"""


def run(*command, **environment):
    ended = subprocess.run([str(word) for word in command], capture_output=True, text=True,
                           env={**os.environ, **environment})
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended.stdout


def ask_by(folder, server):
    """Which package answered, and whether (0, 0) is free."""
    place, free = run(sys.executable, "-c", ASK, server, PYTHONPATH=str(folder)).split()
    assert pathlib.Path(place).is_relative_to(folder)
    return free == "True"


def test_cmake_installs_the_package(client, server, tmp_path):
    publish(client)
    run(os.environ["SILHOUETTE_CMAKE"], "--install", BUILD, "--component", "python", "--prefix", tmp_path)
    folder = next(tmp_path.glob("lib/python3*/dist-packages"))
    assert (folder / "silhouette/py.typed").exists()
    assert ask_by(folder, server)


def test_pip_installs_the_package_without_a_network(client, server, tmp_path):
    # With the flags of the release build, and as deep as it: the compiler's cache has these objects.
    run(sys.executable, "-m", "pip", "install", "--no-build-isolation", "--no-index", "--no-deps",
        "--target", tmp_path, SOURCE / "clients/python",
        SILHOUETTE_PYTHON_BUILD=str(BUILD.parent / "python-pip"), CMAKE_GENERATOR="Ninja",
        CMAKE_ARGS="'-DCMAKE_CXX_FLAGS_RELEASE=-O2 -DNDEBUG' -DCMAKE_COMPILE_WARNING_AS_ERROR=ON")
    assert (tmp_path / "silhouette/_silhouette.pyi").exists()
    publish(client)   # after the build, which may take longer than a scene is valid
    assert ask_by(tmp_path, server)


def test_the_stubs_name_what_the_module_has(tmp_path):
    run(sys.executable, "-m", "mypy.stubtest", "silhouette", "--ignore-missing-stub",
        "--allowlist", SOURCE / "tests/clients/python/stubtest_allowlist.txt",
        MYPY_CACHE_DIR=str(tmp_path))


def test_a_type_checker_reads_the_package_and_finds_mistakes(tmp_path):
    right = tmp_path / "right.py"
    right.write_text("import silhouette\n"
                     "checks = silhouette.Client().check([[0.0, 0.0]], policy='paper')\n"
                     "print(checks.free.all(), checks.basis.age())\n")
    check = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", tmp_path / "cache"]
    run(*check, right, *SOURCE.glob("clients/python/examples/*.py"), MYPYPATH=str(BUILD / "python"))
    wrong = tmp_path / "wrong.py"
    wrong.write_text("import silhouette\nsilhouette.Client().check_path()\nsilhouette.Client(timeout='1')\n")
    ended = subprocess.run([str(word) for word in check + [wrong]], capture_output=True, text=True,
                           env={**os.environ, "MYPYPATH": str(BUILD / "python")})
    assert ended.returncode == 1 and "Found 2 errors" in ended.stdout, ended.stdout + ended.stderr


PLAIN = """import sys
{first}
import grpc
from silhouette.v1 import collision_service_pb2 as messages, collision_service_pb2_grpc as services
channel = grpc.insecure_channel(sys.argv[1])
request = messages.CheckConfigurationsRequest()
request.configurations.add(positions=[0.0, 0.0])
request.configurations.add(positions=[0.6, 0.2])
answer = services.CollisionServiceStub(channel).CheckConfigurations(request, timeout=10)
assert answer.basis.cell_digest != 0
print([verdict.state for verdict in answer.verdicts])
"""


def test_plain_grpc_works_with_what_debian_has(client, server, modules):
    publish(client)
    out = run(sys.executable, "-c", PLAIN.format(first=""), server, PYTHONPATH=str(modules))
    assert out.strip() == "[1, 2]"


def test_plain_grpc_works_beside_the_package_in_one_process(client, server, modules):
    publish(client)
    first = ("import silhouette; silhouette.Client(sys.argv[1]).check([[0.0, 0.0]]); "
             f"silhouette.__path__.append({str(modules / 'silhouette')!r})")
    out = run(sys.executable, "-c", PLAIN.format(first=first), server)
    assert out.strip() == "[1, 2]"


def test_the_readme_calls_free_what_is_and_not_what_expired_on_its_way(client, server, fake, modules):
    readme = (SOURCE / "clients/python/README.md").read_text()
    example = readme[readme.index("    import time\n    import grpc\n"):readme.index("The modules share")]

    def free_by(address):
        script = textwrap.dedent(example).replace("127.0.0.1:50051", address) + "\nprint(free)\n"
        return run(sys.executable, "-c", script, PYTHONPATH=str(modules)).strip()

    publish(client)
    assert free_by(server) == "True"
    assert free_by(fake) == "False"


def test_the_example_connects_plans_and_shows(client, server, tmp_path):
    publish(client)
    run(sys.executable, SOURCE / "clients/python/examples/plan_and_explain.py", "--server", server,
        "--start", "0.0,0.2", "--goal", "1.0,0.2", "--out", tmp_path)
    from PIL import Image
    for name in ("configuration-space.png", "explanation.png"):
        assert Image.open(tmp_path / name).width > 300
    waypoints = np.load(tmp_path / "path.npy")
    assert np.allclose(waypoints[0], [0.0, 0.2]) and np.allclose(waypoints[-1], [1.0, 0.2])
    for x, y in np.rint(waypoints * 10).astype(int):
        assert not TRUTH[x, y]
    assert client.check_path(waypoints)
