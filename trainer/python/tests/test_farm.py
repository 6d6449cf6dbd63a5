"""The farm on a cluster of two nodes of which one is lost."""

import csv
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import sinew
from sinew.farm import farm, learn_one

ray = pytest.importorskip("ray", reason="Ray is not installed")
sys.path.insert(0, str(Path(__file__).parent.parent / "examples"))
from ten_lines import flag  # noqa: E402

QUICK = "components = [3, 1]\n[validation]\nmix_candidates = []\nstart_seeds = 1\n[refine]\nrounds = 1\n"


@pytest.fixture
def sequences(tmp_path):
    for n in range(8):
        folder = tmp_path / "sequences" / f"flag{n}"
        folder.mkdir(parents=True)
        positions, faces = flag(shapes=16, across=16 + n, down=9)
        np.save(folder / "positions.npy", positions)
        np.save(folder / "faces.npy", faces.astype(np.uint32))
    return sorted((tmp_path / "sequences").iterdir())


def test_the_table_is_complete_when_a_worker_is_lost(tmp_path, sequences):
    from ray.cluster_utils import Cluster

    alone = {path.name: learn_one(str(path), QUICK, 0, 4) for path in sequences}
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    try:
        lost = cluster.add_node(num_cpus=1)
        cluster.wait_for_nodes()
        ray.init(address=cluster.address, log_to_driver=False)
        done_before = []

        def lose():
            # In the middle: some are done, some wait, and one is being learned there.
            while len(done_before) < 2:
                time.sleep(0.02)
                done_before[:] = (tmp_path / "out").glob("*.json")
            cluster.remove_node(lost, allow_graceful=False)

        thread = threading.Thread(target=lose)
        thread.start()
        table = farm(sequences, tmp_path / "out", settings={"quick": QUICK}, every=4)
        thread.join()
        assert len(done_before) < 8, "the worker was lost too late to matter"
    finally:
        ray.shutdown()
        cluster.shutdown()
    assert [row["sequence"] for row in table] == [path.name for path in sequences]
    for row in table:
        data, figures = alone[row["sequence"]]
        assert (tmp_path / "out" / f"{row['sequence']}-quick-seed0.sinew").read_bytes() == data
        assert row["sha256"] == figures["sha256"] and row["positions"] == figures["positions"]
    with open(tmp_path / "out" / "figures.csv", newline="") as file:
        assert len(list(csv.DictReader(file))) == 8


def test_what_was_done_is_not_done_again_and_what_is_refused_is_said(tmp_path, sequences):
    (tmp_path / "sequences" / "still").mkdir()
    two = [sequences[0], tmp_path / "sequences" / "still"]
    try:
        first = farm(two, tmp_path / "out", settings={"quick": QUICK}, every=4)
        made = (tmp_path / "out" / "flag0-quick-seed0.sinew").stat().st_mtime_ns
        again = farm(two, tmp_path / "out", settings={"quick": QUICK}, every=4)
    finally:
        ray.shutdown()
    assert first == again and "still" in first[1]["error"]
    assert (tmp_path / "out" / "flag0-quick-seed0.sinew").stat().st_mtime_ns == made
    assert sinew.load(tmp_path / "out" / "flag0-quick-seed0.sinew").kind == "compact"


def test_sequences_without_names_of_their_own_are_refused(tmp_path):
    with pytest.raises(sinew.SinewError, match="rename one"):
        farm([tmp_path / "a.abc", tmp_path / "b" / "a.usd"], tmp_path / "out")
    with pytest.raises(sinew.SinewError, match="no sequences"):
        farm([], tmp_path / "out")
    assert not (tmp_path / "out").exists()
