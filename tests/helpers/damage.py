"""Byte flips and truncations of journals and results files: all found, nothing wrong believed."""

import shutil
from pathlib import Path

import numpy as np

from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.kind import ROW
from flocsim.ensembles.storage.identity import identity_of
from flocsim.ensembles.storage.resume import Beginning, take_journal
from flocsim.ensembles.storage.row_store import RowStore
from flocsim.ensembles.study import Study
from flocsim.errors import FlocsimError
from flocsim.io import groups
from flocsim.io.journal import Journal
from flocsim.io.results.file import read_results
from tests.helpers.jobs import make_study, run_here
from tests.helpers.results_files import same_data

WHOLE_RERUNS = 25
"""Damaged journals that are finished and compared with the undisturbed run, byte for byte."""


def damaged(data, rng):
    """(bytes with one fault, its name): a flipped bit, or an end that is missing."""
    place = int(rng.integers(len(data)))
    if rng.random() < 0.25:
        return data[:place], "truncated"
    changed = bytearray(data)
    changed[place] ^= 1 << int(rng.integers(8))
    return bytes(changed), "flipped"


def a_journal(root):
    """(folder, bytes) of a study of which the journal holds all."""
    folder = make_study(root / "damage")
    keep = Journal.remove
    Journal.remove = lambda self: self.fold_log() and self.lock.remove()
    try:
        run_here(folder)
    finally:
        Journal.remove = keep
    return folder, (folder / "study.h5.journal").read_bytes()


def damage_journal(root, reference, count, rng):
    """Return what is wrong with how so many faults in a journal end."""
    folder, data = a_journal(root)
    (folder / "study.h5").unlink()
    study = Study(load_config(folder / "study.toml"))
    identity = identity_of(study)
    truth = read_results(reference).replicates
    wrong = []
    for number in range(count):
        changed, kind = damaged(data, rng)
        (folder / "study.h5.journal").write_bytes(changed)
        problem = believed_wrong(folder, study, identity, truth, changed)
        if not problem and number < WHOLE_RERUNS:
            problem = finished_wrong(folder, changed, reference)
        if problem:
            wrong.append(f"journal {kind}: {problem}")
    return wrong


def believed_wrong(folder, study, identity, truth, changed):
    """What is wrong with the rows that are taken from a damaged journal; "" if nothing."""
    journal = Journal(folder / "study.h5.journal")
    try:
        if journal.problem or not changed:
            return ""  # refused as a whole, or nothing
        start = Beginning(RowStore(journal, study.conditions), identity)
        take_journal(start, study)
        if not start.remarks and start.store.there() < truth["outcome"].size:
            return "not detected"
        return "" if rows_agree(start.store, study, truth) else "a wrong row was believed"
    except FlocsimError:
        return ""
    finally:
        journal.release()
        for each in folder.glob("study.h5.journal*"):
            each.unlink()


def rows_agree(store, study, truth):
    """Whether all rows that a store has are those of the undisturbed run."""
    for place in range(len(study.conditions)):
        at = np.unravel_index(place, study.shape[:3])
        for first, stop in store.intervals(place):
            rows = store.rows(place, first, stop)
            for name in ROW.names:
                if rows[name].tobytes() != truth[name][at][first:stop].tobytes():
                    return False
    return True


def finished_wrong(folder, changed, reference):
    """What is wrong with the study once it is finished from a damaged journal; "" if nothing."""
    copy = folder.with_name("damage-copy")
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(folder, copy)
    (copy / "study.h5.journal").write_bytes(changed)
    try:
        output = run_here(copy)
    except FlocsimError as error:
        return "" if "journal" in str(error) else str(error)
    return f"bytes differ: {apart}" if (apart := same_data(reference, output)) else ""


def damage_results(root, reference, count, rng):
    """Return what is wrong with how a results file with so many faults is refused: each is found
    before HDF5 parses the file."""
    data = Path(reference).read_bytes()
    path = root / "damaged.h5"
    wrong, opened, parse = [], [], groups.open_hdf5
    groups.open_hdf5 = lambda *words, **more: opened.append(words) or parse(*words, **more)
    try:
        for _ in range(count):
            changed, kind = damaged(data, rng)
            path.write_bytes(changed)
            if problem := read_wrong(path, opened):
                wrong.append(f"results {kind}: {problem}")
    finally:
        groups.open_hdf5 = parse
    return wrong


def read_wrong(path, opened):
    """What is wrong with how a damaged results file is refused; "" if nothing."""
    opened.clear()
    try:
        read_results(path)
    except FlocsimError:
        return "parsed before it was refused" if opened else ""
    return "not detected"
