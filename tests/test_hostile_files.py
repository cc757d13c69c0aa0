"""Damaged and hand-made files of every kind are read or refused in one line."""

import pytest
from hypothesis import settings

from flocsim.__main__ import main
from tests.helpers.hostile_readers import MAKERS, is_refused, made
from tests.helpers.tiers import rest_slow

EXAMPLES = settings().max_examples // 3


@pytest.mark.parametrize("kind", MAKERS)
def test_any_file_is_read_or_refused_in_one_line(tmp_path, kind):
    read = MAKERS[kind][1]
    refused = [is_refused(read, made(kind, number, tmp_path)) for number in range(EXAMPLES)]
    assert any(refused)


def end_of(words, capfd):
    """Return the exit code of a command and the lines of its standard error."""
    try:
        code = main(words)
    except SystemExit as end:
        code = end.code
    return code, capfd.readouterr().err.splitlines()


OF_RESULTS = [kind for kind in MAKERS if kind not in ("pictures", "masks")]
LONG = {
    "report": ["-o", "out.html"], "strength": ["-o", "out.h5", "--count", "1"],
    "trajectory": ["-o", "out.png"], "plot": ["--format", "png", "--figures", "overview"],
}  # fmt: skip
"""Commands that are tried in the slow run only."""


@pytest.mark.parametrize("kind", rest_slow(OF_RESULTS, lambda kind: kind == "results"))
def test_commands_end_with_plain_lines(in_tmp, capfd, kind):
    for number in range(2 if kind == "results" else 20):
        path = str(made(kind, number, in_tmp))
        lines = [["info", path], ["compare", path, path], ["export", "csv", path, "-o", "out.csv"]]
        if kind != "results":
            lines += [[name, path, *more] for name, more in LONG.items()]
        for words in lines:
            code, errors = end_of(words, capfd)
            assert code in (0, 2, 65, 74), (number, words, errors)
            assert not any("Traceback" in line for line in errors), (number, errors)


@pytest.mark.parametrize("files", rest_slow([8, 150], lambda files: files == 8))
@pytest.mark.parametrize("kind", ["pictures", "masks"])
def test_fit_ends_with_plain_lines(tmp_path, capfd, kind, files):
    options = ["--vertices", "4", "--overwrite", "-o", str(tmp_path / "o.h5")]
    for number in range(files):
        path = made(kind, number, tmp_path)
        masks = ["--masks"] if kind == "masks" or number % 4 == 0 else []
        code, errors = end_of(["fit", str(path), "--pixel-size", "1e-6", *masks, *options], capfd)
        ours = (path.name, "flocsim: ", str(tmp_path), "warning: ")
        foreign = [line for line in errors if not line.startswith(ours)]
        assert code in (0, 2, 70) and not foreign, (number, code, errors)
        assert not any("internal error" in line for line in errors), (number, errors)
