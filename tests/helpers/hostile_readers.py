"""Readers of every kind of file, each with the maker of hostile ones: valid files that are changed
through h5py, in their bytes, in their JSON, and sealed again (tests/helpers/hostile_files.py)."""

import math
import random
import traceback
import warnings

import numpy as np

from flocsim.ensembles.storage.identity import short
from flocsim.errors import ConfigError, FileError, FlocsimError
from tests.helpers import hostile_files
from tests.helpers.hostile_files import hdf5_file


def read_results_file(path):
    """Read it in all ways."""
    from flocsim.ensembles.contents import text_of
    from flocsim.io.results.file import read_results

    read_results(path)
    text_of(path)


def read_kernel_file(path):
    """Read it, and make the tables for other models."""
    from flocsim.io.results.file import read_results
    from flocsim.io.results.kernel_tables import kernel_matrix

    read_results_file(path)
    kernel = read_results(path).kernel
    if kernel is not None:
        for mechanism in kernel.mechanisms:
            for vertices in kernel.vertices.tolist():
                kernel_matrix(kernel, mechanism, vertices)


def read_strengths_file(path):
    """Read it, describe it, draw it."""
    from flocsim.io.plots.curves import over_rate
    from flocsim.io.results.strength_file import read_strengths, table_of

    found = read_strengths(path)
    table_of(found)
    over_rate(found)


def read_library_file(path):
    """Read it, and make the shapes."""
    from flocsim.ensembles.contents import text_of
    from flocsim.io.shape_library import read_library

    entries = read_library(path)
    for entry in entries:
        for fit in entry.fits.values():
            assert np.isfinite(fit.vertices).all() and np.isfinite(fit.radius)
            assert math.isfinite(fit.shape.area)
        assert math.isfinite(entry.equivalent_radius / entry.spheroradius)
    text_of(path)


def read_picture_file(path):
    """Read it as a picture and as a mask, and look for flocs."""
    from flocsim.io.images.masks import read_masks, segment_mask
    from flocsim.io.images.pictures import segment
    from flocsim.io.images.reading import read_grey

    try:
        grey = read_grey(path)
        assert np.isfinite(grey).all() and grey.min() >= 0.0 and grey.max() <= 1.0
        if grey.size < 20_000:
            segment(grey)
    finally:
        for _, mask in read_masks(path):
            if mask.size < 20_000:
                segment_mask(mask)


def read_masks_file(path):
    """Read the masks and look for flocs."""
    from flocsim.io.images.masks import read_masks, segment_mask

    for _, mask in read_masks(path):
        assert mask.ndim == 2 and mask.min() >= 0
        if mask.size < 20_000:
            segment_mask(mask)


def read_swarm_file(path):
    """Read it, describe it, and make the shapes."""
    from flocsim.ensembles.contents import text_of
    from flocsim.io.plots.swarm import shape_of
    from flocsim.io.results.swarm_file import read_swarm

    found = read_swarm(path)
    replicates, _, bodies = found.groups["snapshots"]["cluster"].shape
    for replicate in range(min(replicates, 3)):
        for body in range(min(bodies, 5)):
            assert math.isfinite(shape_of(found, replicate, body).area)
    text_of(path)


def read_sweep_file(path):
    """Read it, and describe it."""
    from flocsim.ensembles.contents import text_of
    from flocsim.ensembles.sweep import read_joined

    read_joined(path)
    text_of(path)


def read_trajectory_file(path):
    """Read it; the motion that was believed is one."""
    from flocsim.io.trajectory import read_trajectory

    found = read_trajectory(path)
    assert np.isfinite(found.position).all() and len(found.shapes) == found.position.shape[1]


class SwarmJournalReader:
    """Makes journals of one study of swarms, and takes what they hold as a resumed run does."""

    def __init__(self, folder):
        from flocsim.ensembles.storage.row_store import key_of
        from flocsim.ensembles.swarms.study import SwarmStudy
        from flocsim.io.journal import CHUNK, PART
        from tests.helpers.swarm_study import swarm_config

        self.study, self.identity, self.parts = SwarmStudy(swarm_config(folder)), {"seed": 1}, []
        [condition], known = self.study.conditions, {"identity": short(self.identity)}
        for replicate in range(2):
            key, records = (key_of(condition), replicate), []

            def keep(name, about, data, key=key, records=records):
                records.append((PART, *key, known | about | {"name": name}, data))

            row, _ = self.study.run_task(condition, replicate, lambda: False, None, keep)
            rows = np.array([tuple(row[name] for name in self.study.row.names)], self.study.row)
            self.parts += [*records, (CHUNK, *key, known, rows.tobytes())]

    def make(self, rng, folder):
        """A hostile journal."""
        return hostile_files.journal_file(rng, folder, self.parts)

    def read(self, path):
        """Take what it has, and make results of it where all is there."""
        from flocsim.ensembles.storage.resume import Beginning, refuse_other_sessions, take_journal
        from flocsim.ensembles.storage.row_store import RowStore
        from flocsim.ensembles.swarms.results import results
        from flocsim.io.journal import Journal
        from flocsim.io.results.swarm_file import table_of

        journal = Journal(path)
        try:
            if journal.problem:
                raise FileError(journal.problem)  # as a run that begins says
            store = RowStore(journal, self.study.conditions, self.study.row)
            start = Beginning(store, self.identity)
            refuse_other_sessions(start, self.study)
            take_journal(start, self.study)
            assert all(remark.isprintable() for remark in start.remarks), start.remarks
            for parts in store.parts.values():
                left = self.study.left_of(parts)
                assert left is None or np.isfinite(left["motion"]).all()
            if store.intervals(0) == [(0, 2)]:
                table_of(results(self.study, start, 2, {}, None, True))
            if start.remarks:
                raise FileError(start.remarks[0])  # a part of it was refused
        finally:
            journal.release()


class JournalReader:
    """Makes journals of one study, and takes what they hold as a resumed run does."""

    def __init__(self, folder):
        from flocsim.ensembles.config.loader import load_config
        from flocsim.ensembles.study import Study
        from tests.helpers.small_study import write_small

        path = write_small(folder, vertices="[1]")
        self.study = Study(load_config(path), flocs=[])
        self.identity = {"seed": 1, "kernels.spheres": "x"}
        self.parts = hostile_files.journal_parts(self.identity, short(self.identity), self.rows())

    def rows(self):
        """Two good rows."""
        from flocsim.ensembles.kind import ROW
        from flocsim.io.results.schema import FURTHER_RUNS, SHAPE_COLUMNS

        rows = np.zeros(2, ROW)
        rows["inside"], rows["bond"], rows["floc_i"], rows["floc_j"] = 1, 1, -1, -1
        rows["r_i"], rows["r_j"], rows["D_0"] = 1e-5, 2e-5, 4e-5
        for name in SHAPE_COLUMNS:
            rows[name] = 1.0
        for run in FURTHER_RUNS:
            for name in ("outcome", "inside", "bond"):
                rows[f"{run}_{name}"] = rows[name][0], 255
        return rows

    def make(self, rng, folder):
        """A hostile journal."""
        return hostile_files.journal_file(rng, folder, self.parts)

    def read(self, path):
        """Take its rows and look at them."""
        from flocsim.ensembles.storage.resume import Beginning, refuse_other_sessions, take_journal
        from flocsim.ensembles.storage.row_store import RowStore
        from flocsim.io.journal import Journal

        journal = Journal(path)
        try:
            if journal.problem:
                raise FileError(journal.problem)
            start = Beginning(RowStore(journal, self.study.conditions), self.identity)
            refuse_other_sessions(start, self.study)
            take_journal(start, self.study)
            for place in range(len(self.study.conditions)):
                for first, stop in start.store.intervals(place):
                    start.store.rows(place, first, stop)
            assert all(remark.isprintable() for remark in start.remarks), start.remarks
        finally:
            journal.release()


MAKERS = {
    "results": (hdf5_file(hostile_files.valid_results), read_results_file),
    "kernels": (hdf5_file(hostile_files.valid_kernel), read_kernel_file),
    "libraries": (hdf5_file(hostile_files.valid_library), read_library_file),
    "compounds": (hdf5_file(hostile_files.valid_compounds), read_library_file),
    "strengths": (hdf5_file(hostile_files.valid_strengths), read_strengths_file),
    "swarms": (hdf5_file(hostile_files.valid_swarm), read_swarm_file),
    "sweeps": (hdf5_file(hostile_files.valid_sweep), read_sweep_file),
    "trajectories": (hdf5_file(hostile_files.valid_trajectory), read_trajectory_file),
    "pictures": (hostile_files.picture_file, read_picture_file),
    "masks": (hostile_files.masks_file, read_masks_file),
}
JOURNALS = {"journals": JournalReader, "swarm_journals": SwarmJournalReader}
KINDS = (*MAKERS, *JOURNALS)


def reader(name, folder):
    """Return (maker of hostile files, function that reads one) of a kind."""
    if name in JOURNALS:
        journals = JOURNALS[name](folder)
        return journals.make, journals.read
    return MAKERS[name]


def outcome(read, path):
    """("read" or "refused" or what is wrong, why) of one file."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            read(path)
        return "read", ""
    except AssertionError:
        return "wrongly accepted", traceback.format_exc()
    except FlocsimError as error:
        lines = str(error).split("\n")
        plain = all(line.isprintable() for line in lines)
        if not plain or (len(lines) > 1 and not isinstance(error, ConfigError)):
            return "not one plain line", repr(str(error))
        return "refused", ""
    except Exception:
        return "traceback", traceback.format_exc()


def made(make, name, number, folder):
    """The file of a number; a change that its library refuses to write is left out."""
    for attempt in range(100):
        try:
            return make(random.Random(f"{name} {number} {attempt}"), folder)
        except Exception:
            continue
    raise RuntimeError(f"no file of {name} could be made")
