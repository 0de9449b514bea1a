import hashlib
import json
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import raykiln

SAMPLES = Path(__file__).parents[2] / "samples"
WOVEN = SAMPLES / "woven" / "scene.glb"
FEW = dict(device="cpu", rays=200, repeats=1, views=2)
TRIANGLE = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def test_a_file_is_baked_to_a_file(tmp_path):
    output = tmp_path / "out.glb"
    baked = raykiln.bake(WOVEN, output=output, method="single", **FEW)
    assert baked.glb is None and output.read_bytes()[:4] == b"glTF"
    assert baked.report["schema"] == "raykiln.bake/1"
    assert baked.verdict == baked.report["verdict"] == "faster"
    assert raykiln.verify(WOVEN, str(output), **FEW)["verify"]["mismatches"] == 0


def test_bytes_are_baked_to_bytes_alike():
    first, second = (raykiln.bake(source, method="single", **FEW).glb for source in (WOVEN, WOVEN.read_bytes()))
    assert hashlib.sha256(first).digest() == hashlib.sha256(second).digest()
    assert raykiln.bake(TRIANGLE, name="triangle.obj", **FEW).verdict == "left alone"


def test_options_are_those_of_the_program(tmp_path):
    baked = raykiln.bake(WOVEN, method="single", keep=["a*", "b"], max_position_error_ratio=1e-5, prune=True, **FEW)
    assert baked.report["options"]["keep"] == ["a*", "b"]
    assert baked.report["options"]["max_position_error_ratio"] == 1e-5
    header = json.loads(baked.glb[20 : 20 + int.from_bytes(baked.glb[12:16], "little")])
    made_by = header["asset"]["extras"]["raykiln"]
    assert made_by["version"] == raykiln.__version__ and made_by["options"]["prune"] == "true"


@pytest.mark.parametrize(
    "options, words",
    [
        (dict(magic=1), "--magic"),
        (dict(method="magic"), "magic"),
        (dict(method="single", entry_cost=3), "--entry-cost"),
        (dict(prune="perhaps"), "--prune"),
        (dict(output="x.txt"), "x.txt"),
    ],
)
def test_wrong_options_are_errors(options, words):
    with pytest.raises(raykiln.Error, match=words):
        raykiln.bake(WOVEN, **options)


def test_bad_input_is_an_error(tmp_path):
    for source in (b"glTF but no more", tmp_path / "absent.glb"):
        with pytest.raises(raykiln.Error):
            raykiln.bake(source)
    with pytest.raises(TypeError):
        raykiln.bake(TRIANGLE, output=tmp_path / "out.glb")
    with pytest.raises(TypeError):
        raykiln.bake(3)
    with pytest.raises(TypeError):
        raykiln.bake(WOVEN, seed=None)


def test_inspect_tells_what_a_scene_is_made_of():
    for source in (WOVEN, WOVEN.read_bytes()):
        assert raykiln.inspect(source)["schema"] == "raykiln.inspect/1"


def test_groups_are_arrays():
    (scene,) = (SAMPLES / "instanced").glob("scene.gl*")
    report, groups = raykiln.inspect(scene), raykiln.groups(scene)
    assert len(groups["names"]) == len(groups["mesh"]) == report["before"]["mesh_groups"]
    assert groups["triangles"].sum() == report["before"]["triangles_stored"]
    assert groups["geometries"].sum() == report["before"]["geometries"]
    count = report["before"]["instances"]
    assert groups["instance_transform"].shape == (count, 3, 4) and groups["instance_bounds"].shape == (count, 2, 3)
    assert groups["triangles"][groups["instance_group"]].sum() == report["before"]["triangles_placed"]
    assert np.all(groups["instance_bounds"][:, 0] <= groups["instance_bounds"][:, 1])


def test_provenance_names_each_triangle_once(tmp_path):
    output = tmp_path / "out.glb"
    report = raykiln.bake(WOVEN, output=output, method="single", **FEW).report
    origin = raykiln.provenance(WOVEN, output)
    columns = ["source_node", "source_copy", "source_mesh", "source_primitive", "source_triangle"]
    rows = np.stack([origin[column] for column in columns], axis=1)
    assert len(rows) == report["input"]["triangles"] and rows.min() >= 0
    assert len(np.unique(rows, axis=0)) == len(rows)
    assert set(origin["group"]) == {0}


def test_the_lock_is_released():
    """While a thread bakes, this one goes on."""
    thread = threading.Thread(target=raykiln.bake, args=(WOVEN,), kwargs=dict(FEW, rays=20_000))
    start, turns, longest = time.monotonic(), 0, 0.0
    thread.start()
    last = time.monotonic()
    while thread.is_alive():
        time.sleep(0.001)
        now = time.monotonic()
        turns, longest, last = turns + 1, max(longest, now - last), now
    thread.join()
    assert turns > 10 and longest < 0.5 * (time.monotonic() - start)
