"""The bank: 200 recordings with a mistake each, named, placed and mended in 9 of 10; 60 sound ones without any."""

import faulty_recordings as bank
import numpy as np
import pytest
from checked import MODEL, checked, mended, written

import snarelab
from snarelab.identification.fitting.recorded import read_all
from snarelab.models.model_file import load_model

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("each_diagnosis_once")]
DRAWN = 10
MISSED = 0.1


def cases(tmp_path, seed, mistake):
    """An arm's recordings with a mistake, in a folder of their own, and what is found in them."""
    made = bank.machine(seed)
    runs, name, places = mistake(made, seed)
    folder = tmp_path / str(seed)
    folder.mkdir()
    paths = written(folder, made, runs)
    return made, name, places, folder, paths, checked(folder, paths)


def left(paths, found):
    """Recordings that a finding does not ask to leave out."""
    out = [f.mend.partition("leave out ")[2].partition(",")[0] for f in found]
    return [path for path in paths if path.name not in out]


def same(folder, paths, sound):
    """Whether the mended model file reads the numbers that a sound recording has."""
    other = folder / "sound"
    other.mkdir()
    texts = [(folder / "arm.toml", paths), (other / "arm.toml", sound(other))]
    one, two = (read_all(load_model(model), files)[0] for model, files in texts)
    return set(one.data_vars) == set(two.data_vars) and all(
        np.allclose(one[x], two[x], rtol=1e-9, atol=1e-12) for x in ("time", *one.data_vars)
    )


@pytest.mark.parametrize("mistake", bank.MISTAKES, ids=lambda mistake: mistake.__name__)
def test_mistakes_are_found_in_nine_of_ten_arms(tmp_path, mistake):
    """By name, at the right place and at no other; the mend leaves nothing to find, and the sound recording's numbers
    where they were only written otherwise."""
    missed = []
    for seed in range(20, 20 + DRAWN):
        made, name, places, folder, paths, found = cases(tmp_path, seed, mistake)
        told = [f for f in found if f.fault or f.name == name]
        good = bool(told) and all(f.name == name and f.at in places for f in told)
        (folder / "arm.toml").write_text(mended(MODEL, found))
        after = [f for f in checked(folder, left(paths, found)) if f.fault]
        good = good and not after
        if good and mistake in bank.SAME:
            good = same(folder, paths, lambda other, m=made, s=seed: written(other, m, bank.sound(mistake, m, s)[0]))
        if not good:
            missed.append((seed, [(f.name, f.at, f.message) for f in found]))
    assert len(missed) <= MISSED * DRAWN, missed


def diagnosed(folder, made, text, runs, held):
    (folder / "arm.toml").write_text(text)
    written(folder, made, [*runs, *held], text)
    paths = [folder / f"run{k}.csv" for k in range(len(runs) + len(held))]
    answer = snarelab.diagnose(folder / "arm.toml", paths[: len(runs)], holdout=paths[len(runs) :])
    return answer.verdict, {(e.name, e.at) for e in answer.effects}


@pytest.mark.parametrize(
    "mistake",
    [m for m in bank.MISTAKES if m not in bank.SAME],
    ids=lambda mistake: mistake.__name__,
)
def test_a_mend_gives_the_verdict_of_the_sound_recording(tmp_path, mistake):
    """Where the mend is an estimate, or leaves samples or recordings out: on two arms, of three at most. Two joints and
    no physics missing: a mend that is not quite right is told as some."""
    missed, good = [], 0
    for seed in range(23, 33):
        made = bank.machine(seed, n_joints=2, missing=False)
        runs, name, _ = mistake(made, seed)
        folder = tmp_path / str(seed)
        folder.mkdir()
        paths = written(folder, made, runs)
        found = checked(folder, paths)
        if not any(f.name == name for f in found):
            continue
        kept = [run for path, run in zip(paths, runs, strict=True) if path in left(paths, found)]
        held = mistake(made, seed + bank.HELD_OUT)[0][:1]
        as_it_should_be, lines = bank.sound(mistake, made, seed)
        sound_held, _ = bank.sound(mistake, made, seed + bank.HELD_OUT)
        verdict, names = diagnosed(folder, made, mended(MODEL, found), kept, held)
        sound_verdict, sound_names = diagnosed(folder, made, lines + MODEL, as_it_should_be, sound_held[:1])
        assert verdict != "data_fault"
        # A load that is turned is missing physics in either: the same is to be named.
        if (verdict, names if sound_names else set()) != (sound_verdict, sound_names):
            missed.append((seed, names, sound_names))
        else:
            good += 1
        if good == 2 or len(missed) == 2:
            break
    assert good == 2, missed


@pytest.mark.parametrize("seed", range(100, 160))
def test_sound_recordings_raise_nothing(tmp_path, seed):
    """As loggers leave them: clocks that jitter, lost rows, coarse encoders, and physics that the model lacks."""
    made = bank.machine(seed, n_joints=2 + seed % 4)
    paths = written(tmp_path, made, [bank.disturbed(made, seed), bank.record(made, seed + 500)])
    assert [(f.name, f.at, f.message) for f in checked(tmp_path, paths)] == []


def test_a_heavy_load_far_beside_a_link_raises_nothing(tmp_path):
    """0.6 of the last link's mass and half a kilogram more, a third of a metre off."""
    wrong = []
    for seed in range(20, 20 + DRAWN):
        made = bank.machine(seed)
        paths = written(tmp_path, made, bank.load_turned(made, seed)[0])
        wrong += [(seed, f.name, f.at) for path in paths for f in checked(tmp_path, [path])[:1]]
    assert len(wrong) <= 1, wrong
