# SPDX-License-Identifier: Apache-2.0
"""docs/cell.schema.json, with which editors complete cell.yaml, against the commented sample and the simulated cells."""

import copy
import json
import pathlib
import re

import jsonschema
import pytest
import yaml

SOURCE = pathlib.Path(__file__).parents[3]
SCHEMA = json.loads((SOURCE / "docs/cell.schema.json").read_text())
SAMPLE = SOURCE / "docs/cell.yaml"
VALIDATOR = jsonschema.Draft7Validator(SCHEMA)


def keys_of(schema):
    """All keys that a cell may have, of all depths."""
    if isinstance(schema, list):
        return set().union(*map(keys_of, schema))
    if not isinstance(schema, dict):
        return set()
    keys = set(schema["properties"]) if isinstance(schema.get("properties"), dict) else set()
    return keys.union(*map(keys_of, schema.values()))


def maps_in(value):
    if isinstance(value, dict):
        yield value
    for item in value.values() if isinstance(value, dict) else value if isinstance(value, list) else []:
        yield from maps_in(item)


@pytest.mark.parametrize("path", [SAMPLE, *sorted(SOURCE.glob("capture/sim/cells/*/cell*.yaml"))], ids=str)
def test_cells_are_valid(path):
    VALIDATOR.validate(yaml.safe_load(path.read_text()))


def test_it_has_the_keys_of_the_sample_and_no_others():
    named = set(re.findall(r"(?:^ *(?:# *)?(?:- )?|[{,] ?)([a-z_0-9]+):(?: |$)", SAMPLE.read_text(), re.M))
    joints = {key for key in named if re.fullmatch("joint_[0-9]", key)}
    words = {"short", "nobody"}  # before a colon in comments
    assert named - joints - words == keys_of(SCHEMA)


def test_every_source_and_driver_of_the_sample_is_valid():
    found = 0
    for key, value in re.findall(r"^ *# (source|driver): (.+)$", SAMPLE.read_text(), re.M):
        definition = {"$ref": "#/definitions/" + key, "definitions": SCHEMA["definitions"]}
        jsonschema.Draft7Validator(definition).validate(yaml.safe_load(value))
        found += 1
    assert found > 8


def test_a_misspelt_key_is_refused_wherever_it_stands():
    cell = yaml.safe_load(SAMPLE.read_text())
    free = (cell["robot"]["fixed"], cell["capture"]["forbidden_regions"][0]["joints"])  # keys are joints
    for number, fields in enumerate(maps_in(cell)):
        if any(fields is names for names in free):
            continue
        wrong = copy.deepcopy(cell)
        list(maps_in(wrong))[number]["mispelt"] = 1
        assert not VALIDATOR.is_valid(wrong), fields


@pytest.mark.parametrize(
    "change",
    [
        {"margin": "2"},
        {"views": []},
        {"grid": {"max_move": 0.1, "steps": {"joint_1": 3}}},
        {"grid": {"max_move": 350}},
        {"sound": {"least_obstacle": 15}},
        {"capture": {"settle": "1 day"}},
        {"segmentation": {"faint_side": 4}},
        {"server": {"robot_image_memory": "8 gigabytes"}},
        {"policy": {"preset": "best"}},
    ],
    ids=str,
)
def test_values_that_programs_refuse_are_refused(change):
    assert not VALIDATOR.is_valid(yaml.safe_load(SAMPLE.read_text()) | change)
