"""What an unfinished study has so far: read from its journal, which is neither locked nor changed.

The job that writes the journal only ever appends to it, so that what is whole in it stays as it is
while it is read here.
"""

from pathlib import Path

from flocsim.ensembles.kinds import kinds
from flocsim.ensembles.storage.plan import ASKED
from flocsim.ensembles.storage.stored_json import is_session
from flocsim.ensembles.storage.unfinished import Unfinished
from flocsim.errors import FileError
from flocsim.io.journal.records import SESSION, Record, scan
from flocsim.io.json_text import matches


def read_unfinished(path: str | Path) -> Unfinished:
    """What the journal at ``path`` holds; FileError where it holds no finished replicate."""
    path = Path(path)
    try:
        with open(path, "rb") as file:
            records = [each for each in scan(file) if isinstance(each, Record)]
    except OSError as error:
        raise FileError(f"{path} could not be read: {error.strerror}") from error
    sessions = [each.description for each in records if each.kind == SESSION]
    sessions = [each for each in sessions if is_session(each)]
    if not sessions:
        raise FileError(f"{path} is no journal of an unfinished run, or has just begun: try again")
    asked = sessions[-1].get("asked")
    # Pairs come first, and are all that says nothing of itself.
    first, *others = kinds().values()
    said = [each for each in others if each.asked and matches(asked, ASKED | each.asked)]
    return (said or [first])[0].so_far(path, sessions, records)
