"""Runs a study of swarms on the ranks of a job, into a results file.

Rank 0 locks the journal, finds what is there, deals out what is missing, and writes the results.
All ranks make the same study from what rank 0 has read, and compare what they would compute.
"""

import contextlib
import json
import math
import shlex
import sys
import time
from collections.abc import Sequence
from typing import Any

import attrs
import numpy as np

from flocsim.body import Body
from flocsim.compiler.interpreter_calls import refuse_interpreter
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.parallel.agreement import Facts, disagreement
from flocsim.ensembles.parallel.communicator import Communicator
from flocsim.ensembles.storage.identity import differences, short
from flocsim.ensembles.storage.resume import REMEDY, RESUME, claim
from flocsim.ensembles.storage.stored_json import is_session, stored
from flocsim.ensembles.suspension.assembly import Found, found_in, results_of, table_of
from flocsim.ensembles.suspension.checks import Form
from flocsim.ensembles.suspension.dealing import Alive, Dealer, Kept, follow_dealer
from flocsim.ensembles.suspension.identity import identity_of
from flocsim.ensembles.suspension.study import SwarmStudy, flocs_of
from flocsim.errors import ConfigError, FileError, UsageError
from flocsim.forces import ContactForce
from flocsim.interruption import INTERRUPTION, STOPPED
from flocsim.io.files import ordinary_target
from flocsim.io.journal.journal import Journal
from flocsim.io.journal.records import SESSION, encode
from flocsim.io.outputs import data_rule
from flocsim.io.provenance import now, provenance, storable
from flocsim.io.results.swarm_file import read_swarm, write_swarm
from flocsim.io.terminal import Progress, tell
from flocsim.plausibility.doubts import Names, doubts_of
from flocsim.swarms.islands import run_islands
from flocsim.swarms.swarm import Swarm, check_box
from flocsim.system import System

LAYOUT = "swarm 2"
"""The form of the journal's records."""

INTERNAL = 70


def check_swarm(config: Config) -> None:
    """Raise the FlocsimError that the study would meet: forces, sizes, library, room in the box."""
    if not any(isinstance(force, ContactForce) for force in config.forces):
        raise ConfigError(
            "bodies that meet need a contact force, found none among "
            f"{', '.join(config.force_names)}: add [forces.contact]"
        )
    swarm, _, _ = SwarmStudy(config).swarm(0)
    for law in swarm.system.pieces.laws.values():
        refuse_interpreter(law)
    refuse_interpreter(run_islands, swarm.fillings())


def run_swarms(
    config: Config, comm: Communicator, mode: str, overwrite: bool = False, quiet: bool = False
) -> int:
    """Run a config's study into its results file; the exit code, on all ranks."""
    output = config.output.file
    with contextlib.ExitStack() as resources:
        journal: Journal | None = None
        remarks: list[str] = []
        if comm.rank == 0:
            journal, remarks = claim(output, mode, overwrite)
            resources.callback(journal.release)
        study = SwarmStudy(
            config, flocs=comm.broadcast(flocs_of(config) if comm.rank == 0 else None)
        )
        swarm, _, _ = study.swarm(0)
        identity = identity_of(study, swarm)
        refuse_disagreement(comm, identity)
        check_room(study, swarm, comm)
        if comm.rank > 0:
            comm.barrier()  # rank 0 compiles
            follow_dealer(study, comm)
            return int(comm.broadcast(None))
        assert journal is not None
        lead = Lead(study, swarm, identity, comm, journal, quiet)
        code = lead.run(output, mode, overwrite, remarks)
        comm.broadcast(code)
        return code


def refuse_disagreement(comm: Communicator, identity: dict) -> None:
    """UsageError on rank 0 where a rank would compute something else."""
    facts = comm.gather(Facts(identity))
    if facts is None:
        return
    lines = [disagreement(rank, facts[0], each) for rank, each in enumerate(facts) if rank > 0]
    if unlike := [line for line in lines if line]:
        raise UsageError(unlike[0])


def check_room(study: SwarmStudy, swarm: Swarm, comm: Communicator) -> None:
    """UsageError on rank 0 where the bodies of a replicate find no place, or its box is too small
    for them: before the first runs for hours. Every rank looks at its share; ``swarm``: any one."""
    first: tuple[int, str] | None = None
    for replicate in range(comm.rank, study.config.replicates, comm.size):
        try:
            drawn, box, _ = study.placed(replicate)
            width, height = study.periods(box)
            check_box(drawn.shapes, (width or math.inf, height or math.inf), swarm.reach)
        except UsageError as error:
            first = replicate, str(error)
            break
    found = comm.gather(first)
    if found is None:
        return
    if faults := sorted(each for each in found if each is not None):
        replicate, why = faults[0]
        raise UsageError(f"swarm {replicate} of {study.config.replicates} (from 0): {why}")


@attrs.define
class Lead:
    """What rank 0 does."""

    study: SwarmStudy
    swarm: Swarm
    identity: dict
    comm: Communicator
    journal: Journal
    quiet: bool
    done: int = 0

    def run(self, output: str, mode: str, overwrite: bool, remarks: Sequence[str]) -> int:
        """Find what is missing, deal it out, write the results; the exit code."""
        replicates, moments = self.study.config.replicates, len(self.study.stops)
        progress = Progress(replicates * moments, self.quiet, noun="snapshots")
        for line in [*remarks, *(f"warning: {line}" for line in self.doubts())]:
            progress.warn(line)
        if mode == RESUME and not overwrite and self.is_finished(output):
            self.finish_others()
            progress.say(f"{output} has all {replicates} replicates: nothing was run")
            return 0
        found, lines = self.found()
        for line in lines:
            progress.warn(line)
        self.journal.append(encode(SESSION, self.session()))
        missing = {each: found[each].left for each in range(replicates) if not found[each].ended}
        self.done = sum(min(len(each.moments), moments) for each in found.values())
        progress.say(self.announcement(replicates - len(missing)))
        began = time.monotonic()
        if missing:
            progress.say("compiling what no run on this machine has compiled before …")
            warm(self.swarm)
            progress.say(f"compiled or loaded in {time.monotonic() - began:.1f} s")
        self.comm.barrier()
        progress.start(replicates * moments - self.done)

        def told(message: Kept | Alive) -> None:
            going = ""
            if isinstance(message, Alive):
                going = str(message)
            else:
                self.done += message.is_moment
            progress.report(replicates * moments - self.done, going)

        dealer = Dealer(self.comm, missing, self.journal.append, told)
        dealer.run(self.study)
        self.journal.sync()
        wall = progress.finish()
        if dealer.halted:
            who = INTERRUPTION.name if INTERRUPTION.requested else "a signal to another rank"
            tell(
                f"flocsim: stopped by {who}: {self.done} snapshots and the states of all swarms "
                f"are in {self.journal.path}; go on with --resume", sys.stderr,
            )  # fmt: skip
            return STOPPED
        return self.write(output, overwrite, wall)

    def finish_others(self) -> None:
        """Let ranks go that have nothing to do."""
        self.comm.barrier()
        Dealer(self.comm, {}, self.journal.append, lambda kept: None).run(self.study)

    def doubts(self) -> list[str]:
        """Lines on what is implausible."""
        config = self.study.config
        names = Names(
            fluid="fluid", body="bodies", buoyancy="fluid.buoyancy = true", drop="give {} = false",
            forces=tuple(f"forces.{name}" for name in config.force_names),
        )  # fmt: skip
        return doubts_of([largest_pair(self.swarm)], names)

    def session(self) -> dict[str, Any]:
        """What the journal says of this run."""
        return {
            "identity": self.identity, "short": short(self.identity), "layout": LAYOUT,
            "date": now(), "command": shlex.join(sys.argv),
            "replicates": self.study.config.replicates, "moments": len(self.study.stops),
        }  # fmt: skip

    def is_finished(self, output: str) -> bool:
        """Whether the results file has all replicates of this study; UsageError where it is of
        another one, or has another number of them."""
        if not ordinary_target(output).exists():
            return False
        results = read_swarm(output)
        try:
            identity = stored(results.run, "identity")
        except ValueError as error:
            raise FileError(f"{output} holds no readable results of a swarm: {error}") from error
        if lines := differences(identity, self.identity):
            raise UsageError(f"{output} is of another study: {'; '.join(lines[:5])}; {REMEDY}")
        count, asked = len(results.scales["replicate"]), self.study.config.replicates
        if count == asked:
            return True
        raise UsageError(
            f"{output} has {count} replicates, and {asked} are asked for: name another output, or "
            "begin anew by --overwrite, which keeps it under another name"
        )

    def found(self) -> tuple[dict[int, Found], list[str]]:
        """({replicate: what the journal has of it}, remarks); UsageError where it is of another
        study, FileError where no flocsim wrote it."""
        path, sessions = self.journal.path, []
        for record in self.journal.records:
            if record.kind == SESSION:
                sessions.append(record.description)
        for about in sessions:
            if not is_session(about):
                raise FileError(f"{path} was begun by no flocsim: move it away")
            if lines := differences(about["identity"], self.identity):
                raise UsageError(f"{path} is of another study: {'; '.join(lines[:5])}; {REMEDY}")
            if about["layout"] != LAYOUT:
                raise UsageError(f"{path} was written by another version of flocsim: {REMEDY}")
        return found_in(self.journal, self.study.config.replicates, form_of(self.study, self.swarm))

    def announcement(self, existing: int) -> str:
        scene, ranks = self.study.scene, self.comm.size
        line = (
            f"{self.study.config.replicates} swarms of {scene.number} bodies, "
            f"{scene.duration:g} s, on {ranks} rank{'s' if ranks > 1 else ''}"
        )
        return line + (f"; {existing} of them are finished" if existing else "")

    def write(self, output: str, overwrite: bool, wall: float) -> int:
        """Write the results from the journal, print them; the exit code."""
        config = self.study.config
        kernels = str(self.identity["kernels.swarms"])
        run = provenance(config.text, config.seed, kernels) | {
            "overrides": storable(json.dumps(config.overrides)),
            "identity": storable(json.dumps(self.identity, sort_keys=True)),
            "ranks": self.comm.size,
            "wall_time": wall,
            "preset": config.preset or "",
            "periodic": self.study.scene.periodic,
            "warnings": storable(json.dumps(self.doubts())),
        }
        found, _ = self.found_again()
        results, failed = results_of(self.study, found, self.journal, run)
        write_swarm(output, results, data_rule(overwrite))
        self.journal.remove()
        for line in failed[:5]:
            tell(f"flocsim: {line}", sys.stderr)
        if not self.quiet:
            tell(table_of(results))
            tell(f"{output}: {config.replicates} swarms in {wall:.1f} s")
        return INTERNAL if len(failed) == config.replicates else 0

    def found_again(self) -> tuple[dict[int, Found], list[str]]:
        """What the journal has now."""
        self.journal.read_all()
        return self.found()


def form_of(study: SwarmStudy, swarm: Swarm) -> Form:
    """What the study's records look like; ``swarm``: any of its swarms."""
    classes = len(study.scene.bounds) + 1
    return Form(len(swarm.bodies), classes, len(study.stops), study.scene.duration)


def largest_pair(swarm: Swarm) -> System:
    """A System of the two largest bodies, for what is said of a swarm."""
    bodies = sorted((body for body in swarm.bodies if not body.fixed),
                    key=lambda body: -body.shape.equivalent_radius)[:2]  # fmt: skip
    return attrs.evolve(swarm.system, bodies=bodies)


def warm(swarm: Swarm) -> None:
    """Compile all that a swarm needs, or load it, by running a few of its bodies for no time."""
    bodies: list[Body] = [*swarm.bodies[:1], *(body for body in swarm.bodies if body.fixed)]
    box = tuple(None if np.isinf(side) else side for side in swarm.box)
    few = Swarm(bodies, swarm.forces, swarm.integrator, swarm.fluid, box=box)
    few.gauge().neighbours(few.system.motion()[0])
    few.begin(1e-9).advance(1e-9)
