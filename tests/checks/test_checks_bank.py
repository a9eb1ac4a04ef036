"""The bank: 170 recordings with a mistake each in at least 9 of 10, 60 sound ones without any."""

import faulty_recordings as bank
import pytest
from checked import MODEL, checked, mended, written

pytestmark = pytest.mark.slow
DRAWN = 10
MISSED = 0.1


@pytest.mark.parametrize("mistake", bank.MISTAKES, ids=lambda mistake: mistake.__name__)
def test_mistakes_are_found_in_nine_of_ten_arms(tmp_path, mistake):
    missed = []
    for seed in range(20, 20 + DRAWN):
        made = bank.machine(seed)
        runs, name, places = mistake(made, seed)
        folder = tmp_path / str(seed)
        folder.mkdir()
        paths = written(folder, made, runs)
        found = checked(folder, paths)
        named = [f for f in found if f.name == name and f.at in places]
        (folder / "arm.toml").write_text(mended(MODEL, found))
        if not named or (name != "mixed" and any(f.fault for f in checked(folder, paths))):
            missed.append((seed, [(f.name, f.at, f.message) for f in found]))
    assert len(missed) <= MISSED * DRAWN, missed


@pytest.mark.parametrize("seed", range(100, 160))
def test_sound_recordings_raise_nothing(tmp_path, seed):
    made = bank.machine(seed, n_joints=2 + seed % 4)
    paths = written(tmp_path, made, [bank.record(made, seed), bank.record(made, seed + 500)])
    assert [(f.name, f.at, f.message) for f in checked(tmp_path, paths)] == []
