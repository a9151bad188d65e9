# SPDX-License-Identifier: Apache-2.0
"""LocalSpace of the Python package against the real server."""
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import silhouette
from conftest import TRUTH, publish
from silhouette import Reason, State

RANDOM = np.random.default_rng(18)
NOTHING = np.zeros((16, 16), bool)


def usable(space, scene):
    """The first usable snapshot of this scene or a newer one."""
    number = 0
    while True:
        snapshot = space.wait_for_update(after=number, timeout=20)
        assert snapshot.number > number, space.status
        number = snapshot.number
        if snapshot.unknown_reason is None and snapshot.basis.scene_id >= scene:
            return snapshot


def test_verdicts_are_those_of_the_server(client):
    publish(client)
    points = RANDOM.uniform(-0.05, 1.05, (500, 2))
    asked = client.check(points)
    with silhouette.LocalSpace(client, max_age=600.0) as space:
        snapshot = usable(space, 1)
        assert (snapshot.states == np.where(TRUTH, State.OCCUPIED, State.FREE)).all()
        many = snapshot.check_many(points)
        between = many.reasons == Reason.BETWEEN_GRID_POINTS
        assert (many.states[~between] == asked.states[~between]).all()
        assert not (many.free & ~asked.free).any()
        for q, state in zip(points, many.states):
            assert snapshot.check(q).state == state
            assert snapshot.check(q.tolist()).state == state
            assert snapshot.check(tuple(q)).state == state
        # Between scenes the space itself may know more cells than its first snapshot, never less.
        assert not (snapshot.check_many(points).free & ~space.check_many(points).free).any()
        assert space.check([0.0, 0.0])
        numbers = snapshot.grid.numbers
        assert (snapshot.check_numbers(numbers.ravel()).free == ~TRUTH.ravel()).all()
        with pytest.raises(ValueError, match="a row of configurations has 3 joint values; the grid has 2 joints"):
            snapshot.check_many(np.zeros((4, 3)))
        for at in (space, snapshot):
            with pytest.raises(ValueError, match="q has 3 joint values; the grid has 2 joints"):
                at.check([0.0, 0.0, 0.0])
            with pytest.raises(ValueError, match="goal has 1 joint values; the grid has 2 joints"):
                at.check_motion([0.0, 0.0], np.zeros(1))
        free = int((~TRUTH).sum())
        assert repr(snapshot.check_numbers(numbers.ravel())) == f"<Checks {free} of {TRUTH.size} free, scene 1>"
        assert repr(snapshot.check_motion([0.0, 0.0], [0.0, 0.0])) == "<MotionVerdict free>"
        assert repr(snapshot.check_motion([9.0, 0.0], [9.0, 0.0])).startswith("<MotionVerdict unknown: ")


def test_numbers_without_a_state_are_unknown_because_they_are_not_in_the_map(client):
    publish(client)
    with silhouette.LocalSpace(client, max_age=600.0) as space:
        snapshot = usable(space, 1)
        checks = snapshot.check_numbers([0, 4095])
        assert list(checks.states) == [State.FREE, State.UNKNOWN]
        assert list(checks.reasons) == [Reason.UNSPECIFIED, Reason.NOT_IN_MAP]


def test_closing_a_space_ends_the_wait_of_another_thread(client):
    publish(client)
    space = silhouette.LocalSpace(client, max_age=600.0)
    newest = usable(space, 1).number
    with ThreadPoolExecutor(1) as threads:
        waiting = threads.submit(space.wait_for_update, newest, 60)
        time.sleep(0.2)
        space.close()
        with pytest.raises(ValueError, match="closed"):
            waiting.result(timeout=20)


def test_everything_is_unknown_without_a_scene_and_after_its_end(client):
    with silhouette.LocalSpace(client) as space:
        assert not space.check([0.0, 0.0])
        assert space.unknown_reason is not None
        publish(client)
        assert usable(space, 1).check([0.0, 0.0])
    with pytest.raises(ValueError, match="closed"):
        space.check([0.0, 0.0])
    with silhouette.LocalSpace(client, max_age=1e-6) as space:
        space.wait_for_update(after=0, timeout=20)
        assert not space.check_many([[0.0, 0.0]]).all_free
    for no_age in (0.0, float("nan")):
        with pytest.raises(ValueError, match="max_age"):
            silhouette.LocalSpace(client, max_age=no_age)


def test_a_lost_server_is_unknown_and_no_exception(cell):
    from conftest import serve
    process, address = serve(cell)
    client = silhouette.Client(address)
    publish(client)
    with silhouette.LocalSpace(client, max_age=600.0) as space:
        snapshot = usable(space, 1)
        assert space.check([0.0, 0.0])
        process.kill()
        process.wait()
        lost = space.wait_for_update(after=snapshot.number, timeout=20)
        assert lost.unknown_reason is not None
        assert not space.check([0.0, 0.0])
        assert not space.status["connected"]


def test_updates_follow_scenes_and_snapshots_do_not_change(client):
    publish(client)
    with silhouette.LocalSpace(client, max_age=600.0) as space:
        first = usable(space, 1)
        assert first.check([0.6, 0.2]).state is State.OCCUPIED
        publish(client, NOTHING, NOTHING)
        second = usable(space, 2)
        assert second.check([0.6, 0.2]) and space.check([0.6, 0.2])
        assert first.check([0.6, 0.2]).state is State.OCCUPIED


def test_a_motion_is_free_only_where_the_server_finds_it_free(client):
    publish(client)
    with silhouette.LocalSpace(client, max_age=600.0) as space:
        usable(space, 1)
        motions = RANDOM.uniform(0, 1, (200, 2, 2))
        for start, goal in motions:
            here = space.check_motion(start, goal)
            asked = client.check_path([start, goal])
            assert not here or asked
            assert bool(here) == (here.last_free == 1)
            if here.state is State.OCCUPIED:
                assert here.fraction == pytest.approx(asked.fraction, abs=1e-9)
                assert np.allclose(here.configuration, asked.configuration)


@pytest.mark.parametrize("wrong", [3.0, "free", [[0.0, 0.0]], ["0", "1"], [0.0] * 8])
def test_what_is_no_configuration_is_an_error(client, wrong):
    with silhouette.LocalSpace(client) as space:
        with pytest.raises((TypeError, ValueError)):
            space.check(wrong)


def test_a_configuration_with_other_joints_is_an_error_and_without_a_value_unknown(client):
    publish(client)
    with silhouette.LocalSpace(client, max_age=600.0) as space:
        usable(space, 1)
        for q in ([], [0.0], [0.0, 0.0, 0.0]):
            for values in (q, np.array(q)):
                with pytest.raises(ValueError, match="joint values; the grid has 2 joints"):
                    space.check(values)
        for q in ([np.nan, 0.0], np.array([np.nan, 0.0])):
            assert space.check(q).state is State.UNKNOWN
