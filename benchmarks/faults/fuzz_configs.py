"""Fuzzed config files: each is run, or refused with one line per problem; never a traceback.

    python -m benchmarks.faults.fuzz_configs [--quick] [--markdown]

Half are valid files of which entries were replaced, renamed, dropped or nested, half valid texts
with a piece cut out and letters put in (hypothesis, from a fixed seed). What loads is checked as
`flocsim ensemble` does; its identity is taken; and a replicate of spheres is run, unless its forces
need code that would have to be compiled beyond the first few kinds.
"""

import re
import sys
import tempfile
from collections import Counter
from pathlib import Path

import attrs
from hypothesis import HealthCheck, given, seed, settings

from benchmarks.reporting import Table, parse_arguments, print_heading
from flocsim.ensembles.collision.draw import run_safely
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.config.schema import TABLES, TOP_KEYS
from flocsim.ensembles.estimates.statistics import borders
from flocsim.ensembles.preflight import check_study
from flocsim.ensembles.storage.identity import identity_of, short
from flocsim.ensembles.study import Study
from flocsim.errors import FlocsimError
from tests.helpers.config_mutations import GARBLED, MUTATED

MOST_KINDS = 4
"""Kinds of compiled code; each takes some 20 s to compile when it is new."""

MOST_STEPS = 2000
BY_LINE = r"\.toml:\d+: .* a config never needs that"
"""A message of the text's limits, which names a line."""

KEY = re.compile("|".join(
    [*TABLES, *TOP_KEYS, "forces", "not valid TOML", "not UTF-8", "unknown", BY_LINE]
))  # fmt: skip


@attrs.define
class Fuzz:
    """What has become of the configs."""

    path: Path
    counts: Counter = attrs.Factory(Counter)
    wrong: list = attrs.Factory(list)
    kinds: set = attrs.Factory(set)

    def take(self, text):
        """Load, check and run a config file of this text."""
        self.path.write_bytes(text.encode("utf-8", "surrogatepass"))
        try:
            self.counts[self.outcome()] += 1
        except FlocsimError as error:
            self.counts["refused"] += 1
            self.judge(str(error), text)
        except Exception as error:
            self.wrong.append(f"{type(error).__name__}: {error}\n{text}")

    def judge(self, message, text):
        """Every line of a refusal says which key or what else is wrong, and nothing else."""
        for line in message.split("\n"):
            if not (line.isprintable() and KEY.search(line)):
                self.wrong.append(f"a message that names no key: {line}\n{text}")

    def outcome(self):
        """How far the config at hand comes."""
        config = load_config(self.path)
        check_study(config)
        shapes = attrs.evolve(config.shapes, vertices=(1,))
        steps = min(config.integrator.max_steps, MOST_STEPS)
        method = attrs.evolve(config.integrator, max_steps=steps, accuracy=None)
        study = Study(attrs.evolve(config, shapes=shapes, integrator=method), flocs=[])
        identity = identity_of(study)
        assert len(short(identity)) == 16
        assert borders(config.stop, config.replicates)[-1] == config.replicates
        kind = identity["kernels.spheres"]
        if kind not in self.kinds and len(self.kinds) >= MOST_KINDS:
            return "checked, not run"
        self.kinds.add(kind)
        row, note = run_safely(study, study.places[0], 0)
        if note and "Error" in note["why"]:
            raise RuntimeError(note["why"])
        return "run" if row["outcome"] < 6 else "run, failed with a reason"


def main():
    """Print the table; exit code 1 where a config gave a traceback or an empty message."""
    arguments = parse_arguments(__doc__)
    print_heading(("hypothesis",))
    count = 500 if arguments.quick else 20_000
    with tempfile.TemporaryDirectory() as folder:
        fuzz = Fuzz(Path(folder) / "study.toml")

        @seed(1)
        @settings(max_examples=count, deadline=None, database=None,
                  suppress_health_check=list(HealthCheck))  # fmt: skip
        @given(MUTATED | GARBLED)
        def throw(text):
            fuzz.take(text)

        throw()
    table = Table("Fuzzed config files", ("end", "configs"))
    for end, number in fuzz.counts.most_common():
        table.add(end, number)
    table.add("traceback, or a message without a key", len(fuzz.wrong))
    table.print(arguments.markdown)
    print(*fuzz.wrong[:3], sep="\n\n")
    return 1 if fuzz.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
