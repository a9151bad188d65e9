# SPDX-License-Identifier: Apache-2.0
"""The Python package against the real server."""
import os
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import silhouette
import conftest
from conftest import STEPS, TRUTH, WALL, publish
from silhouette import Reason, State

RANDOM = np.random.default_rng(17)
NOTHING = np.zeros((16, 16), bool)


def test_before_the_first_scene_nothing_is_free(client):
    checks = client.check([[0.1, 0.2]])
    assert list(checks.states) == [State.UNKNOWN]
    assert list(checks.reasons) == [Reason.NO_SCENE]
    assert not checks.free.any() and not checks.all_free
    assert checks.basis.scene_id == 0 and checks.basis.age() is None
    path = client.check_path([[0, 0], [0.1, 0]])
    assert not path and path.verdict.reason is Reason.NO_SCENE
    space = client.configuration_space()
    assert not (space.states == State.FREE).any() and space.unknown_reason is Reason.NO_SCENE
    assert client.explain([0, 0]).views == []
    with pytest.raises(silhouette.NotFound, match="scene"):
        client.get_scene()


def test_only_an_explicit_free_is_true(client):
    publish(client)
    checks = client.check([[0, 0], [0.6, 0.2], [5, 5]], evidence=True)
    assert [bool(v) for v in checks.verdicts] == [True, False, False]
    assert [bool(v.state) for v in checks.verdicts] == [True, False, False]
    assert [v.state for v in checks.verdicts] == [State.FREE, State.OCCUPIED, State.UNKNOWN]
    assert not client.check_path([[0, 0.2], [1, 0.2]])
    assert not client.check(np.empty((0, 2))).all_free
    with pytest.raises(TypeError, match="all_free"):
        bool(checks)


def test_verdicts_of_all_grid_points_are_those_of_the_masks(client):
    publish(client)
    grid = client.get_database()["grid"]
    assert grid.shape == (STEPS, STEPS) and grid.size == STEPS * STEPS
    x, y = np.meshgrid(*grid.axes, indexing="ij")
    asked = np.stack([x.ravel(), y.ravel()], axis=1)
    checks = client.check(asked)
    expected = np.where(TRUTH, State.OCCUPIED, State.FREE)
    assert (checks.states.reshape(grid.shape) == expected).all()
    assert (checks.free == ~TRUTH.ravel()).all()
    space = client.configuration_space()
    assert (space.states == expected).all() and space.unknown_reason is None
    numbers = grid.numbers
    assert numbers.dtype == np.uint32
    assert (client.check_numbers(numbers.ravel()).states.reshape(grid.shape) == expected).all()
    assert np.allclose(grid.at((3, 4)), [0.3, 0.4])
    assert grid.nearest([0.32, 0.41]) == (3, 4)
    assert grid.nearest([7, 7]) is None
    for wrong in ([0.3], [0.3, 0.4, 0.5], [[0.3, 0.4]]):
        with pytest.raises(ValueError, match="q takes a value for each joint"):
            grid.nearest(wrong)


def test_arrays_of_any_layout_are_read_as_they_are_written(client):
    publish(client)
    points = RANDOM.uniform(0, 1, (50, 2))
    expected = client.check(points).states
    for same in (np.asfortranarray(points), points[::-1][::-1], points.tolist(),
                 np.repeat(points, 2, axis=0)[::2]):
        assert (client.check(same).states == expected).all()


@pytest.mark.parametrize("wrong", [[0.1, 0.2], [[[0.1, 0.2]]], 0.1])
def test_a_wrong_shape_is_refused_with_the_right_one(client, wrong):
    with pytest.raises(ValueError, match=r"\(n, joints\)"):
        client.check(wrong)


def test_errors_are_exceptions_of_their_code_with_the_same_sentence(client, fake):
    publish(client)
    with pytest.raises(silhouette.InvalidArgument, match="min_views"):
        client.check([[0, 0]], policy=silhouette.Policy(min_views=3))
    with pytest.raises(silhouette.Error, match="needs a calibration"):
        client.check([[0, 0]], policy="calibrated")
    with pytest.raises(silhouette.InvalidArgument, match="variant"):
        client.with_variant("gripper").check([[0, 0]])
    with pytest.raises(silhouette.FailedPrecondition):
        client.get_acquisition()
    with pytest.raises(silhouette.InvalidArgument):
        silhouette.Client("no address")
    with pytest.raises(silhouette.Aborted, match="the database was replaced"):
        silhouette.Client(fake).revoke_region("part")
    gone = silhouette.Client("127.0.0.1:1", timeout=2.0)
    with pytest.raises(silhouette.Unavailable, match="no server answers at 127.0.0.1:1"):
        gone.check([[0, 0]])
    assert issubclass(silhouette.Unavailable, ConnectionError)


def test_certificates_decide_who_may_call(cell, tmp_path):
    subprocess.run([conftest.SOURCE / "tools/certificates", tmp_path, "127.0.0.1"], check=True, capture_output=True)
    (cell / "tls.yaml").write_text(conftest.CELL + "  tls: {certificate: %s, key: %s, client_ca: %s}\n" % tuple(
        tmp_path / file for file in ("server.pem", "server.key", "ca.pem")) +
        "  roles: {publisher: [publisher], planner: [planner]}\n")
    process, address = conftest.serve(cell, "tls.yaml")

    def client_of(role):
        return silhouette.Client(address, tls_ca=str(tmp_path / "ca.pem"),
                                 tls_certificate=str(tmp_path / f"{role}.pem"), tls_key=str(tmp_path / f"{role}.key"))

    try:
        planner = client_of("planner")
        publish(client_of("publisher"))
        assert planner.check([[0.0, 1.0]]).all_free
        with pytest.raises(silhouette.PermissionDenied, match="'planner' may not call PublishScene"):
            publish(planner)
        with pytest.raises(silhouette.Unavailable):
            silhouette.Client(address, timeout=2).check([[0.0, 1.0]])
    finally:
        process.kill()
        process.wait()


def test_policies_reach_the_server(client):
    obstacle = [np.zeros((16, 16), bool) for _ in range(2)]
    obstacle[0][:, 7:9] = True
    obstacle[1][13:15, 0:6] = True
    publish(client, *obstacle)
    place = [[0.6, 0]]
    assert not client.check(place).all_free
    assert client.check(place, policy="paper").all_free
    assert client.check(place, policy=silhouette.Policy(min_views=2)).all_free
    with pytest.raises(ValueError, match="nearest"):
        silhouette.Policy(off_grid="near")


def test_a_path_ends_at_the_first_place_that_is_not_free(client):
    publish(client)
    free = client.check_path([[0, 0], [0, 1], [1, 1], [1, 0]], clearance=True)
    assert free and free.proof is silhouette.PathProof.GRID
    assert free.narrowest is not None and free.narrowest.segment in range(4)
    blocked = client.check_path([[0, 0], [0, 0.2], [1, 0.2]])
    assert blocked.segment == 1
    assert blocked.configuration[0] == pytest.approx(0.35, abs=0.051)
    assert blocked.fraction == pytest.approx(blocked.configuration[0])


def test_clearances_are_pixels(client):
    publish(client)
    checks = client.check([[0.1, 0], [0.6, 0.2], [5, 5]], clearance=True)
    assert checks.clearances[0] == 2 and checks.clearances[1] == 0 and np.isnan(checks.clearances[2])
    assert client.check([[0.1, 0]]).clearances is None
    space = client.configuration_space(clearance_levels=[0.0, 1.0])
    assert space.clearances[1, 0] == 1 and np.isnan(space.clearances[6, 2])


def test_explain_shows_what_it_counts(client):
    publish(client)
    explanation = client.explain([0.6, 0.2])
    assert explanation.verdict.state is State.OCCUPIED
    assert [e.view for e in explanation.verdict.views] == ["left", "right"]
    assert explanation.verdict.views[0].obstacle_pixels == 6
    for view in explanation.views:
        for picture in (view.scene, view.obstacle, view.intersection, view.collision):
            assert picture.shape == (16, 16, 3) and picture.dtype == np.uint8
    colours = explanation.views[0].obstacle.reshape(256, 3)
    drawn = (colours == colours[WALL.ravel().argmax()]).all(axis=1).reshape(16, 16)
    assert (drawn == WALL).all()


def test_scenes_are_read_back_as_published(client):
    published = publish(client)
    assert published["id"] == 1 and published["defects"] == []
    assert {j["name"]: j["position"] for j in published["joints"]} == {"x": 0.0, "y": 0.0}
    scene = client.get_scene(with_planes=True)
    assert scene["id"] == 1 and abs(scene["time"] - time.time()) < 60
    assert (scene["views"][0]["obstacle"] == WALL).all()
    assert client.get_scene()["views"][0]["obstacle"] is None
    with pytest.raises(ValueError, match="bool"):
        client.publish_scene(joints={"x": 0.0, "y": 0.0}, views={"left": np.zeros((16, 16))}, taken=time.monotonic())
    database = client.get_database()
    assert database["cell_name"] == "block" and database["configurations"] == STEPS * STEPS
    assert "uncalibrated" in database["presets"]


def test_a_scene_is_of_the_variant_that_it_names_whatever_the_client_checks(client):
    ahead = client.with_variant("with-part")
    with pytest.raises(silhouette.InvalidArgument, match="checks 'with-part': .* or 'default'"):
        publish(ahead)
    empty = publish(ahead, variant="default")
    assert empty["variant"] == "default" and empty["defects"] == []
    scene = publish(client, variant="with-part")
    assert scene["variant"] == "with-part"
    assert any("no variant 'with-part'" in defect["message"] for defect in scene["defects"])


def test_an_image_of_unknown_age_or_from_the_future_is_refused(client):
    scene = {"joints": {"x": 0.0, "y": 0.0}, "views": {"left": WALL, "right": WALL}}
    with pytest.raises(TypeError, match="taken: float"):
        client.publish_scene(**scene)
    for no_instant in (time.time(), time.monotonic() + 3600, float("inf"), float("-inf"), -1e300, float("nan")):
        with pytest.raises(ValueError, match="taken is"):
            client.publish_scene(**scene, taken=no_instant)
    with pytest.raises(silhouette.NotFound):
        client.get_scene()
    taken = time.monotonic() - 5
    client.publish_scene(**scene, taken=taken)
    assert 5 <= client.check([[0, 0]]).basis.age() < 60


def test_a_timeout_is_a_finite_number_of_seconds_above_0(client):
    for endless in (float("inf"), 1e300, float("nan"), 0.0, -1.0):
        with pytest.raises(ValueError, match="timeout is"):
            client.with_timeout(endless)
        with pytest.raises(ValueError, match="timeout is"):
            silhouette.Client(client.address, timeout=endless)


def test_a_region_or_a_view_of_another_type_is_refused_with_the_right_one(client):
    for wrong in (WALL.astype(np.uint8), 7, "corners", [(1, 2, 3)]):
        with pytest.raises(ValueError, match=r"'left' takes an array of bool .* corners \(x, y\)"):
            client.allow_region("part", views={"left": wrong}, duration=60.0)
    with pytest.raises(ValueError, match="named by a str, not by 7"):
        client.allow_region("part", views={7: WALL}, duration=60.0)
    for images in ({"views": {7: WALL}}, {"obstacles": {7: WALL}}):
        with pytest.raises(ValueError, match="named by a str, not by 7"):
            client.publish_scene(joints={}, **images, taken=time.monotonic())
    assert client.list_regions() == []


def test_an_allowed_region_lets_the_robot_in_and_is_named(client):
    publish(client)
    assert not client.check([[0.6, 0.2]]).all_free
    region = client.allow_region("part", views={"left": WALL, "right": WALL}, duration=60.0)
    assert 0 < region["remaining"] <= 60
    assert [r["name"] for r in client.list_regions()] == ["part"]
    assert client.check([[0.6, 0.2]]).basis.regions == ["part"]
    client.allow_region("part", views={"left": [(6, 0), (10, 0), (10, 10)]}, duration=60.0)
    assert client.revoke_region("part") and not client.revoke_region("part")
    assert not client.check([[0.6, 0.2]]).all_free


def test_a_watched_path_reports_every_scene_and_ends_with_the_watch(client):
    publish(client, NOTHING, NOTHING)
    with client.watch_path([[0, 0.2], [1, 0.2]]) as watch:
        updates = iter(watch)
        first = next(updates)
        assert first and first.free_now and first.check.free and first.check.basis.valid_for > 0
        assert repr(first) == "<PathUpdate free>"
        publish(client)
        second = next(updates)
        assert not second and second.check.verdict.state is State.OCCUPIED
        assert repr(second) == "<PathUpdate occupied>"
        with pytest.raises(silhouette.DeadlineExceeded):
            watch.next(timeout=0.01)
    assert list(watch) == []


def test_a_watched_path_is_asked_with_its_resolution(client):
    with client.watch_path([[0, 0]], resolution=1.0) as watch:
        with pytest.raises(ValueError, match="path_resolution"):
            watch.next(timeout=20)


def test_a_watched_path_is_false_once_its_last_update_expires(fake):
    with silhouette.Client(fake).watch_path([[0, 0]]) as watch:
        # The server lives and sends nothing more: only the expiry can wake who waits.
        patience = threading.Timer(20.0, watch.cancel)
        updates = iter(watch)
        last = next(updates)
        patience.start()
        if last:
            last = next(updates)
        patience.cancel()
        assert not last and last.check.verdict.reason is Reason.UPDATE_EXPIRED


def test_a_watch_that_the_server_cancels_raises_instead_of_ending(fake):
    with silhouette.Client(fake).watch_path([[1, 0]]) as watch:
        with pytest.raises(silhouette.Unavailable, match="ended the call"):
            for _ in watch:
                pass


def test_waiting_leaves_the_interpreter_to_other_threads(client):
    publish(client)
    with client.watch_path([[0, 0]]) as watch:
        watch.next(timeout=10)
        seen = []
        waiting = threading.Thread(target=lambda: seen.append(watch.next(timeout=20)))
        waiting.start()
        publish(client)  # would never happen if the waiting thread held the lock
        waiting.join(20)
        assert len(seen) == 1


WAITS = {
    "check": "client.check([[0.0, 0.0]])",
    "watched path": "watch.next(timeout=1)",
    "local space": "space.wait_for_update(space.snapshot().number, 1)",
}


@pytest.mark.parametrize("wait", WAITS)
def test_the_interpreter_ends_cleanly_while_a_thread_waits(client, server, wait):
    publish(client)
    script = f"""import silhouette, sys, threading, time
client = silhouette.Client(sys.argv[1])
watch = client.watch_path([[0.0, 0.0]])
watch.next(timeout=10)
space = silhouette.LocalSpace(client)
space.wait_for_update(0, 10)
def waiting():
    while True:
        try:
            {WAITS[wait]}
        except silhouette.DeadlineExceeded:
            pass
threading.Thread(target=waiting, daemon=True).start()
time.sleep(0.3)
"""
    ended = subprocess.run([sys.executable, "-c", script, server], capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    assert ended.stderr == ""


def test_a_forked_process_is_refused_and_leaves_its_parents_answers_alone(client, server):
    publish(client)
    answers, answered = os.pipe()
    child = os.fork()
    if child == 0:
        refused = 0
        for ask in (lambda: client.check([[0.0, 0.0]]), lambda: silhouette.Client(server),
                    lambda: client.watch_path([[0.0, 0.0]]).next(timeout=10)):
            try:
                ask()
            except silhouette.FailedPrecondition as error:
                refused += "spawn" in str(error)
        os.write(answered, bytes([refused]))
        os._exit(0)
    assert client.check([[0.6, 0.2]]).states[0] == State.OCCUPIED
    assert os.waitpid(child, 0)[1] == 0
    assert os.read(answers, 1) == bytes([3])
    assert client.check([[0.6, 0.2]]).states[0] == State.OCCUPIED


def test_arrays_of_verdicts_cannot_be_changed(client):
    publish(client)
    checks = client.check([[0.6, 0.2]])
    for array in (checks.states, checks.reasons):
        with pytest.raises(ValueError):
            array[:] = 1
    assert not checks.all_free


def test_numbers_may_be_any_whole_numbers(client):
    publish(client)
    numbers = np.flatnonzero(~TRUTH.ravel())
    assert numbers.dtype == np.int64
    assert (client.check_numbers(numbers).states ==
            client.check_numbers(numbers.astype(np.uint32)).states).all()
    for wrong in (numbers - 1 - numbers.max(), numbers + 2**32, numbers.astype(float), ["a"]):
        with pytest.raises(ValueError, match="numbers"):
            client.check_numbers(wrong)


def test_the_first_verdict_imports_nothing():
    # A thread that imports lets others run, who would wait for it with the interpreter's lock.
    script = """import silhouette, sys
sys.modules["silhouette._enums"] = None
print(silhouette.LocalSpace(silhouette.Client("127.0.0.1:1")).unknown_reason is not None)
"""
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert ended.stdout == "True\n", ended.stderr


def test_numbers_of_a_reason_are_those_of_the_library():
    from silhouette import _silhouette
    for reason in Reason:
        if reason is not Reason.UNSPECIFIED:
            name = _silhouette.name_of(int(reason))
            assert name != _silhouette.name_of(0), reason
            assert reason.description
    known = {int(r) for r in Reason}
    for value in set(range(256)) - known:
        assert _silhouette.name_of(value) == _silhouette.name_of(0), value
