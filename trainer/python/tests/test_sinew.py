"""The module as its user meets it."""

import pickle
import signal
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import sinew

sys.path.insert(0, str(Path(__file__).parent.parent / "examples"))
from ten_lines import flag  # noqa: E402

QUICK = "[validation]\nmix_candidates = []\nstart_seeds = 1\n[refine]\nrounds = 1\n"


@pytest.fixture(scope="module")
def sheet():
    return flag(shapes=16, across=9, down=6)


@pytest.fixture(scope="module")
def package(sheet):
    return sinew.train(*sheet, shapes=range(0, 16, 2), components=(3, 1), config=QUICK)


@pytest.fixture(scope="module")
def baked(package):
    return package.bake(bones=6)


def test_training_reports_and_repeats(sheet, package):
    heard = []
    again = sinew.train(
        *sheet, shapes=range(0, 16, 2), components=(3, 1), config=QUICK, progress=lambda *what: heard.append(what)
    )
    assert again == package
    assert any(total > 0 and done == total for _, done, total, _ in heard)
    assert all(isinstance(stage, str) for stage, *_ in heard)


def test_packages_are_kept(tmp_path, package, baked):
    for one in (package, baked):
        one.save(tmp_path / "a.sinew")
        assert sinew.load(tmp_path / "a.sinew") == one
        assert pickle.loads(pickle.dumps(one)) == one
    assert (package.kind, baked.kind) == ("compact", "baked")
    # A bone that no vertex needs is left out.
    assert 1 <= baked.bone_count <= 6
    assert package.components == baked.components
    np.testing.assert_array_equal(package.rest, baked.rest)
    np.testing.assert_array_equal(package.faces, baked.faces)
    component = package.components[-1]
    assert component.minimum <= 0 <= component.maximum and component.level == 1
    assert package.components[component.parent].level == 0


def test_sequences_are_read(tmp_path, sheet):
    positions, faces = sheet
    np.save(tmp_path / "positions.npy", positions)
    np.save(tmp_path / "faces.npy", faces.astype(np.uint32))
    for given, read in zip(sheet, sinew.read(tmp_path)):
        np.testing.assert_array_equal(given, read)
    with pytest.raises(sinew.SinewError, match="missing"):
        sinew.read(tmp_path / "missing.abc")


def test_weights_play_the_shapes_they_came_from(sheet, package):
    positions, _ = sheet
    weights = package.encode(positions, fit="positions")
    assert weights.shape == (16, len(package.components)) and weights.dtype == np.float32
    player = package.player()
    diagonal = np.linalg.norm(np.ptp(positions[0], axis=0))
    played = player.frame(weights[4])
    # The encoder looks past where a shape stands.
    played = played - played.mean(0) + positions[4].mean(0)
    assert np.linalg.norm(played - positions[4], axis=1).mean() < 0.02 * diagonal
    figures = package.evaluate(positions)
    assert figures["shapes"] == 8 and figures["position_projection"]["e_rms"] > 0


def test_frames_are_written_into_the_callers_memory(package):
    player = package.player()
    out, normals = np.full_like(package.rest, np.nan), np.full_like(package.rest, np.nan)
    assert player.frame(np.zeros(len(package.components)), out=out, normals=normals) is out
    np.testing.assert_array_equal(out, package.rest)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-5)
    weights = np.array([component.maximum for component in package.components], np.float32)
    np.testing.assert_array_equal(player.frame(weights), player.frame(list(map(float, weights))))
    np.testing.assert_array_equal(player.weights, weights)


def test_bones_carry_the_mesh(baked):
    player = baked.player("bones")
    weights = np.array([0.5 * component.maximum for component in baked.components], np.float32)
    maps = player.bones(weights).reshape(-1, 3, 4)
    assert maps.shape == (baked.bone_count, 3, 4)
    exact = baked.player("exact").frame(weights)
    diagonal = np.linalg.norm(np.ptp(baked.rest, axis=0))
    assert np.linalg.norm(player.frame() - exact, axis=1).mean() < 0.05 * diagonal
    with pytest.raises(sinew.SinewError, match="exact tier"):
        baked.player("exact").bones()


def test_a_held_vertex_follows(package):
    player = package.player()
    before = player.frame()
    player.hold(8)
    target = before[8] + [0, 0, 0.05]
    left = [player.drag(8, target) for _ in range(20)]
    assert left[-1] < 0.05 and np.abs(player.weights).max() > 0
    after = player.frame()
    assert np.linalg.norm(after[8] - target) == pytest.approx(left[-1], abs=1e-4)
    player.let_go(8)
    with pytest.raises(sinew.SinewError):
        player.let_go(8)


def test_what_cannot_be_used_is_named(tmp_path, sheet, package, baked):
    positions, faces = sheet
    holed = positions.copy()
    holed[3, 7, 1] = np.nan
    far = faces.copy()
    far[2, 1] = 999
    player = package.player()
    with pytest.raises(sinew.SinewError, match="shape 3, vertex 7"):
        sinew.train(holed, faces)
    with pytest.raises(sinew.SinewError, match="face 2 names vertex 999"):
        sinew.train(positions, far)
    with pytest.raises(sinew.SinewError, match="face 0 names vertex -1"):
        sinew.train(positions, np.array([[-1, 0, 1]]))
    with pytest.raises(sinew.SinewError, match=r"\(N, V, 3\)"):
        sinew.train(positions[:, :, :2], faces)
    with pytest.raises(sinew.SinewError, match="shape 16"):
        sinew.train(positions, faces, shapes=[0, 16])
    with pytest.raises(sinew.SinewError, match="recipe"):
        sinew.train(positions, faces, recipe="soup")
    with pytest.raises(sinew.SinewError, match="nonsense"):
        sinew.train(positions, faces, config="nonsense = 1")
    with pytest.raises(sinew.SinewError, match="vertices"):
        package.encode(positions[:, :-1])
    with pytest.raises(sinew.SinewError, match="trained on"):
        package.evaluate(positions, shapes=[2])
    with pytest.raises(sinew.SinewError, match="compact"):
        baked.encode(positions)
    with pytest.raises(sinew.SinewError, match="float32"):
        player.frame(out=np.empty(package.rest.shape))
    with pytest.raises(sinew.SinewError, match="C order"):
        player.frame(out=np.empty(package.rest.shape[::-1], np.float32).T)
    with pytest.raises(sinew.SinewError, match="weights must have shape"):
        player.frame(np.zeros(3))
    with pytest.raises(sinew.SinewError, match="weight 1 is NaN"):
        player.frame([0, np.nan] + [0] * (len(package.components) - 2))
    read_only = np.empty_like(package.rest)
    read_only.flags.writeable = False
    with pytest.raises(sinew.SinewError, match="writable"):
        player.frame(out=read_only)
    with pytest.raises(sinew.SinewError):
        sinew.load(tmp_path / "missing.sinew")
    with pytest.raises(sinew.SinewError):
        sinew.Package.from_bytes(package.to_bytes()[:-5])
    assert not np.isnan(player.frame()).any(), "refusals left the player as it was"


@settings(deadline=None, max_examples=60)
@given(place=st.integers(0, 10**9), flip=st.integers(1, 255))
def test_damaged_bytes_are_refused_or_the_same(package, place, flip):
    damaged = bytearray(package.to_bytes())
    damaged[place % len(damaged)] ^= flip
    try:
        sinew.Package.from_bytes(bytes(damaged))
    except sinew.SinewError:
        return
    pytest.fail("a flipped byte was not seen")


def test_a_progress_that_raises_stops_the_training(sheet):
    def fall(*_):
        raise ZeroDivisionError("of its own")

    with pytest.raises(ZeroDivisionError, match="of its own"):
        sinew.train(*sheet, config=QUICK, progress=fall)


def test_control_c_stops_a_training(sheet):
    timer = threading.Timer(0.3, signal.raise_signal, [signal.SIGINT])
    # Long enough that it is not done by then.
    positions, faces = flag(shapes=30, across=30, down=20)
    timer.start()
    before = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        sinew.train(positions, faces, epochs=2000)
    assert time.monotonic() - before < 30


def test_two_threads_on_one_player_are_told(package):
    player = package.player()
    told, wrong = [], []

    def play():
        for _ in range(300):
            try:
                player.frame(np.random.default_rng().normal(size=len(package.components)))
            except RuntimeError as error:
                told.append(str(error))
            except Exception as error:  # noqa: BLE001
                wrong.append(error)

    threads = [threading.Thread(target=play) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong and all("another thread" in text for text in told)


def test_ten_thousand_frames_take_no_memory(package):
    resource = pytest.importorskip("resource")
    player, out = package.player(), np.empty_like(package.rest)
    weights = np.random.default_rng(0).normal(size=(100, len(package.components))).astype(np.float32)

    def play(rounds):
        for n in range(rounds):
            player.frame(weights[n % 100], out=out)

    play(1000)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    play(10_000)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 1024, "less than a megabyte"
