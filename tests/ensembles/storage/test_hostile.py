"""What a resumed run takes from files that an enemy has written, with right checksums."""

import io
import random
import shutil

import h5py
import pytest

from flocsim.ensembles.parallel.communicator import Communicator, SharedError
from flocsim.ensembles.runner import run_to_file
from flocsim.ensembles.storage.resume import NEW, RESUME
from flocsim.ensembles.storage.unfinished import read_unfinished
from flocsim.errors import FlocsimError
from flocsim.io.journal import ROWS, SESSION
from tests.helpers.journals import change, records_in
from tests.helpers.sealed import read_sealed, seal
from tests.helpers.small_study import small_config
from tests.helpers.swarm_study import swarm_config

SPHERES = {"shapes": {"vertices": [1]}, "replicates": 3}
ODD = (None, -1, 0, 2**62, 0.5, "", "x", "[]", "[1]", "{", "null", "\x1b", b"", b"1", b"\xff" * 500)


@pytest.fixture(scope="module", params=["pairs", "swarms"])
def journal(request, tmp_path_factory):
    """(config of a study, its journal) where all has been computed, but no results are written."""
    folder = tmp_path_factory.mktemp(request.param)
    make = small_config if request.param == "pairs" else swarm_config
    config = make(folder, SPHERES) if request.param == "pairs" else make(folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("flocsim.ensembles.runner.facts", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            run_to_file(config, Communicator(), folder / "r.h5", NEW)
    return config, folder / "r.h5.journal"


def test_any_odd_record_is_computed_again_or_refused_in_one_line(journal, tmp_path):
    config, original = journal
    outcomes = []
    for number in range(40):
        rng = random.Random(number)
        path = tmp_path / f"{number}.h5.journal"
        shutil.copy(original, path)
        table = rng.choice([SESSION, ROWS, ROWS])
        if not (found := records_in(path, table)):
            continue
        record = rng.choice(found)
        column = rng.choice([name for name in record if name not in ("id", "digest")])
        change(path, table, record["id"], **{column: rng.choice(ODD)})
        output = path.with_name(f"{number}.h5")
        for look in (
            lambda path=path: read_unfinished(path),
            lambda output=output: run_to_file(config, Communicator(), output, RESUME),
        ):
            try:
                look()
                outcomes.append("taken")
            except (SharedError, FlocsimError) as error:
                assert str(error).isprintable()
                outcomes.append("refused")
    assert {"taken", "refused"} <= set(outcomes)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """The bytes of a finished study's results file."""
    folder = tmp_path_factory.mktemp("finished")
    run_to_file(small_config(folder, SPHERES), Communicator(), folder / "r.h5", NEW)
    return read_sealed(folder / "r.h5")


def put(name, value):
    """A change of a scalar of the group ``run``."""

    def change(file):
        del file[f"run/{name}"]
        file[f"run/{name}"] = value

    return change


CHANGES = (
    [put("identity", text) for text in ("[]", "{", "[" * 10**5, "NaN", 7, "")]
    + [put(name, text) for name in ("failed", "history")
       for text in ("{}", "[1]", '[{"a": ' * 50, 1.5)]
    + [lambda file: file["replicates/failure"].attrs.modify("flag_meanings", "a b c")]
)  # fmt: skip


@pytest.mark.parametrize(
    "change",
    CHANGES[::2] + [pytest.param(each, marks=pytest.mark.slow) for each in CHANGES[1::2]],
)
def test_results_that_no_run_has_written_are_not_extended(tmp_path, finished, change):
    image = io.BytesIO(finished)
    with h5py.File(image, "r+") as file:
        change(file)
    before = seal(image.getvalue())
    (tmp_path / "r.h5").write_bytes(before)
    config = small_config(tmp_path, SPHERES | {"replicates": 4})
    with pytest.raises(SharedError) as caught:
        run_to_file(config, Communicator(), tmp_path / "r.h5", RESUME)
    error = caught.value.args[0]
    assert isinstance(error, FlocsimError)
    assert str(error).isprintable()
    assert (tmp_path / "r.h5").read_bytes() == before
