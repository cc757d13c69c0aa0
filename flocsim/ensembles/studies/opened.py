"""What a script has of a file: `flocsim.open`."""

import os
from typing import Any

from flocsim.ensembles.contents import file_kind
from flocsim.io.files import held


def open_any(path: str | os.PathLike, folder: str | os.PathLike | None = None) -> Any:
    """What a file of `flocsim ensemble`, `swarm`, `kernel`, `sweep` or `strength` holds, checked;
    the table of replicates of pairs stays on the disk until it is asked for.

    ``folder``: where the config of a study lay, its shape library and its own modules, which are
    run then whatever they are (default: where the results lie). FileError for a file that is
    absent, damaged, or of another kind.
    """
    source = held(path)
    return file_kind(source, "opened").opened(source, folder)
